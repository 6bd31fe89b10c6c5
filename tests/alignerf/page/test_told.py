"""The verdict on the page: gauges, what to do first, a summary."""

import json

import pytest

from alignerf.page import told


def gauge(value, limit, level):
    return told.gauge(
        {"name": "x", "level": level, "value": value, "limit": limit, "unit": "px"}
    )


@pytest.mark.parametrize(
    ("value", "limit", "level", "filled"),
    [
        (0.4, 0.4, "not seen", 0.5),
        (0.2, 0.4, "not seen", 0.25),
        (0.6, 0.4, "sure", 0.75),
        (9.0, 0.4, "sure", 1.0),
        (0.0, 0.4, "not seen", 0.0),
        # More is better: seen where it is less, half full where it is the limit.
        (4.0, 0.5, "not seen", 0.0625),
        (6, 12, "sure", 1.0),
        (0.0, 0.5, "likely", 1.0),
        (0.1, 0.0, "sure", 1.0),
        (0.0, 0.0, "not seen", 0.0),
    ],
)
def test_a_gauge_is_past_its_mark_where_the_cause_is_seen(value, limit, level, filled):
    found = gauge(value, limit, level)
    assert found["filled"] == pytest.approx(filled)
    if value != limit:
        assert (found["filled"] > told.MARK) == (level in told.SEEN)


def test_what_cannot_be_told_has_no_length():
    for value, level in ((None, "not seen"), (0.2, "untold")):
        assert gauge(value, 0.4, level)["filled"] is None


def test_the_numbers_say_on_which_side_of_the_limit_it_is_fine():
    assert gauge(2.2, 0.4, "sure")["numbers"] == "2.2 px (fine: up to 0.4)"
    assert gauge(4.0, 0.5, "not seen")["numbers"] == "4 px (fine: at least 0.5)"


def test_an_unknown_level_is_refused_by_name():
    with pytest.raises(ValueError, match="level 'maybe' of a cause"):
        gauge(1, 1, "maybe")


def test_a_verdict_of_lines_alone_is_shown_as_far_as_it_goes(results):
    found = told.read(results)
    assert found["headline"] == "aligned."
    assert found["do_first"] == {"text": "nothing.", "command": None}
    assert found["measured"] == ["A < B & C."]
    assert found["gauges"] == found["tried"] == []


def test_a_summary_has_what_to_do_and_what_is_fine(results, causes):
    text = told.summary("my scene", told.read(results), [("photos", "5")], "make x")
    lines = text.splitlines()
    assert lines[0] == "my scene: Misaligned by 2.3 px: poses are off."
    assert lines[1:3] == ["Do first: correct the cameras.", "    make photos <x>"]
    assert "Tried: warped: -0.4 dB" in lines
    assert (
        "Sure: poses 2.2 px (fine: up to 0.4), number of photos 6 (fine: at least 12)"
        in lines
    )
    assert "Untold: lens" in lines
    assert lines[-1] == "For other programs: make x"


@pytest.mark.parametrize("text", ["", "[]", "{", "\x00"])
def test_a_broken_file_is_named(results, text):
    (results / "verdict.json").write_text(text)
    with pytest.raises(ValueError, match=r"verdict\.json: not the JSON"):
        told.read(results)


def test_lines_that_are_no_text_are_refused(results):
    content = {"verdict": [1], "state": "aligned", "evidence": {}}
    (results / "verdict.json").write_text(json.dumps(content))
    with pytest.raises(ValueError, match="not lines of text"):
        told.read(results)
