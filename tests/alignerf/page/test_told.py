"""The verdict on the page: gauges, what to do first, a summary."""

import json

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


@pytest.mark.parametrize(
    ("key", "value", "fault"),
    [
        ("because", [1], "because is not lines of text"),
        ("headline", "", "headline is not lines of text"),
        ("verdict", [], "verdict is not lines of text"),
        ("causes", [3], "causes: not an object"),
        ("do_first", {"text": "x", "command": 1}, "do_first: command is 1"),
        (
            "tried",
            [{"text": "x", "pays": True, "db": "1", "method": "x"}],
            "tried: db is '1'",
        ),
        ("evidence", {"overfit_px": -1}, "overfit_px is -1"),
    ],
)
def test_what_is_not_told_like_that_is_refused_by_name(results, key, value, fault):
    path = results / "verdict.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(ValueError, match=rf"verdict\.json: .*{fault}"):
        told.read(results)


def test_a_level_that_is_none_is_refused(results, causes):
    causes["causes"][0]["level"] = "maybe"
    (results / "verdict.json").write_text(json.dumps(causes))
    with pytest.raises(ValueError, match="causes: level is 'maybe'"):
        told.read(results)
