"""The verdict on the page: gauges, what to do first, a summary."""

import pytest

from alignerf.page import told
from tests.alignerf.page import conftest as cases


def gauge(value, limit, level, name="camera", unit="px", says=None):
    return told.gauge(cases.cause(name, level, value, limit, unit, says))


@pytest.mark.parametrize(
    ("name", "value", "limit", "filled"),
    [
        ("camera", 0.4, 0.4, 0.5),
        ("camera", 0.2, 0.4, 0.25),
        ("camera", 0.6, 0.4, 0.75),
        ("camera", 9.0, 0.4, 1.0),
        ("camera", 0.0, 0.4, 0.0),
        # More is better: half full where it is the limit.
        ("undertrained", 4.0, 0.5, 0.0625),
        ("undertrained", 0.5, 0.5, 0.5),
        ("undertrained", 0.1, 0.5, 1.0),
        ("undertrained", 0.0, 0.5, 1.0),
        # Where none is right.
        ("swapped", 1, 0, 1.0),
        ("swapped", 0, 0, 0.0),
    ],
)
def test_a_gauge_is_half_full_at_its_limit(name, value, limit, filled):
    assert gauge(value, limit, "likely", name)["filled"] == pytest.approx(filled)


def test_what_cannot_be_told_has_no_length():
    for value, level in ((None, "not seen"), (0.2, "untold")):
        assert gauge(value, 0.4, level)["filled"] is None


def test_the_numbers_say_where_it_is_fine_or_are_the_cause_s_own_words():
    assert gauge(2.2, 0.4, "sure")["numbers"] == "2.2 px (fine: up to 0.4)"
    assert gauge(0, 0, "not seen", unit="swapped")["numbers"] == "0 swapped"
    own = gauge(0, 0, "not seen", "few_views", "too few", "48, 12 are enough")
    assert own["numbers"] == "48, 12 are enough"


def test_a_command_stands_once(results, causes):
    first = told.read(results)["do_first"]
    assert first["text"] == "Correct the cameras: the command below."
    assert first["command"] == "make photos <x>"


def test_a_summary_has_what_to_do_and_what_is_fine(results, causes):
    text = told.summary("my scene", told.read(results), [("photos", "5")], "make x")
    lines = text.splitlines()
    assert lines[:2] == ["my scene: Misaligned by 2.3 px: poses are off.", "A < B & C."]
    assert lines[2:4] == [
        "Do first: Correct the cameras: the command below.",
        "    make photos <x>",
    ]
    assert "Tried: warped: -0.4 dB" in lines
    assert "Sure: camera's name 2.2 px (fine: up to 0.4)" in lines
    assert "Untold: lens_shift's name" in lines
    assert lines[-1] == "For other programs: make x"


@pytest.mark.parametrize("text", ["", "[]", "{", "\x00"])
def test_a_broken_file_is_named(results, text):
    (results / "verdict.json").write_text(text)
    with pytest.raises(ValueError, match=r"verdict\.json: not the JSON"):
        told.read(results)
