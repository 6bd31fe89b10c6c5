"""The verdict on the page: gauges, what to do first, a summary."""

import pytest

from alignerf.exports import readme
from alignerf.page import told
from alignerf.verdict import report
from tests.alignerf.page import conftest as cases


def gauge(value, limit, level, **more):
    return told.gauge(cases.cause("camera", level, value, limit, "px", **more))


@pytest.mark.parametrize(
    ("more_is_better", "value", "limit", "share"),
    [
        (False, 0.4, 0.4, 1),
        (False, 0.2, 0.4, 0.5),
        (False, 9.0, 0.4, told.LARGEST),
        (False, 0.0, 0.4, 0),
        # More is worse here, too.
        (True, 4.0, 0.5, 0.125),
        (True, 0.5, 0.5, 1),
        (True, 0.0, 0.5, told.LARGEST),
        # Where none is right.
        (False, 1, 0, told.LARGEST),
    ],
)
def test_a_bar_is_as_long_as_its_share_of_the_limit(
    more_is_better, value, limit, share
):
    found = gauge(value, limit, "likely", more_is_better=more_is_better)
    assert found["share"] == pytest.approx(share)


@pytest.mark.parametrize(
    ("value", "limit", "level"),
    [(None, 0.4, "ok"), (0.2, 0.4, "cannot tell"), (0, 0, "ok")],
)
def test_what_cannot_be_told_has_no_bar(value, limit, level):
    assert gauge(value, limit, level)["share"] is None


def test_each_level_has_a_sign_of_its_own():
    signs = {gauge(1, 1, level)["sign"] for level in report.LEVELS}
    assert len(signs) == len(report.LEVELS) == 4


def test_bars_of_fixes_share_a_scale_with_a_zero():
    found = told.fixes([cases.fix("a", 1.2, pays=True), cases.fix("b", -0.5)])
    first, second = found["rows"]
    assert (found["low"], found["high"]) == pytest.approx((-0.8, 1.5))
    assert (first["kind"], second["kind"]) == ("ok", "faulty")
    assert first["text_of"] == ("+1.2", "+0.9 to +1.5")
    unclear = told.fixes([cases.fix("c", 0.1)])["rows"][0]
    assert (unclear["kind"], unclear["sign"]) == ("unclear", "\u2013")
    assert told.fixes([]) is None
    # Where it may not be claimed, a gain is no harm; nor without an interval.
    assert told.fixes([cases.fix("few", 1.2)])["rows"][0]["kind"] == "unclear"
    (alone,) = told.fixes([cases.fix("a", 0.7) | {"low": None, "high": None}])["rows"]
    assert (alone["kind"], alone["text_of"]) == ("unclear", ("+0.70", "unknown"))


def test_what_gains_are_against_is_said_once_or_in_each_row():
    apart = [cases.fix("a", 1.0), cases.fix("b", 1.0) | {"test_set": "aligned_pose"}]
    alone = told.fixes(apart[1:])
    assert alone["against"] == "on held-out photos, by cameras moved to fit them"
    both = told.fixes(apart)
    assert both["against"] == ""
    assert [row["notes"] for row in both["rows"]] == [
        ["against ground truth"],
        ["on held-out photos, by cameras moved to fit them"],
    ]


def test_a_command_stands_once(results, causes):
    first = told.read(results)["do_first"]
    assert first["text"] == "Correct the cameras: the command below."
    assert first["command"] == "make photos <x>"


def test_a_trainer_s_command_is_that_of_the_export_s_readme():
    lines = " ".join(readme.TEXT.replace("\\", " ").split())
    for name in told.TRAINERS:
        said = [told.trainers(place)[name] for place in (".", "PATH_OF_THIS_FOLDER")]
        assert any(one in lines for one in said), name
    assert "'my scene'" in told.trainers("my scene")["Brush"]


def test_a_summary_has_what_to_do_and_what_is_fine(results, causes):
    text = told.summary("my scene", told.read(results), [("photos", "5")], "make x")
    lines = text.splitlines()
    assert lines[:2] == ["my scene: Misaligned by 2.3 px: poses are off.", "A < B & C."]
    assert lines[2:4] == [
        "Do first: Correct the cameras: the command below.",
        "    make photos <x>",
    ]
    assert "Tried: warped: -0.4 dB" in lines
    assert "Faulty: camera's name (2.2 px)" in lines
    assert "Cannot tell: lens_shift's name (None px)" in lines
    assert lines[-1] == "For other programs: make x"


@pytest.mark.parametrize("text", ["", "[]", "{", "\x00"])
def test_a_broken_file_is_named(results, text):
    (results / "verdict.json").write_text(text)
    with pytest.raises(ValueError, match=r"verdict\.json: not the JSON"):
        told.read(results)
