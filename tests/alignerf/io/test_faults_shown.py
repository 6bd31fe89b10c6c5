"""Values and names in messages: bounded, and nothing that a terminal obeys."""

import io
import sys

import pytest

from alignerf.io import faults

DEEP = []
for _ in range(100_000):
    DEEP = [DEEP]
# Nine to the tenth values, in ten lists.
BOMB = "lol"
for _ in range(10):
    BOMB = [BOMB] * 9


@pytest.mark.parametrize(
    "value",
    [
        "x" * 1_000_000,
        "a\nerror: forged\r\x1b[2J\u202e\u2028",
        "\udc80",
        ["\x1b]0;title\x07"] * 1000,
        {"\x9b31m": None},
        10**5000,
        DEEP,
        BOMB,
        {"x": BOMB},
        5e-324,
        None,
    ],
    ids=range(11),
)
def test_a_value_of_a_file_is_short_and_prints(value):
    for most in (60, 20):
        text = faults.shown(value, most)
        assert 0 < len(text) <= most
        assert text.isprintable()


@pytest.mark.parametrize("value", ["a b", 1.5, True, [1, "x"], "Zürich"])
def test_a_plain_value_is_shown_as_python_writes_it(value):
    assert faults.shown(value) == repr(value)


def test_a_long_text_says_that_there_is_more():
    assert faults.shown("x" * 100).endswith("...")
    assert faults.shown(list(range(100))).endswith("...")


def test_names_are_short_and_print():
    text = faults.some_names(["a\nb", "c" * 1000, "\x1b[0m", "d", "e"])
    assert text.startswith("'a\\nb', ccc")
    assert text.endswith("..., '\\x1b[0m' and 2 more")
    assert text.isprintable()
    assert len(text) < 300


def test_a_terminal_of_ascii_shows_other_letters_escaped(monkeypatch):
    written = io.BytesIO()
    stream = io.TextIOWrapper(written, encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    assert faults.exit_code(lambda: print("Zürich \U0001f4f7", flush=True)) == 0
    assert written.getvalue() == b"Z\\xfcrich \\U0001f4f7\n"
