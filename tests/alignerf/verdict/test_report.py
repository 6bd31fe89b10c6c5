"""The verdict as one object, and its lines for a terminal."""

import math

import pytest

from alignerf.verdict import causes, remedies, report
from tests.alignerf.verdict.test_causes import FAULTS, WELL

GAIN = remedies.Gain("aligned", 1.2, 0.8, 1.6, 2.0, "aligned", True, "oracle")


def of(e, gains=()):
    return report.of(e, causes.find(e), list(gains), [])


def level_of(told, cause):
    return next(one["level"] for one in told.causes if one["cause"] == cause)


@pytest.mark.parametrize("cause", FAULTS)
def test_a_gauge_is_beyond_its_limit_where_its_cause_is_named(cause):
    """And every other cause that is fine is said to be."""
    e = WELL._replace(**FAULTS[cause])
    told, named = of(e), {finding.cause for finding in causes.find(e)}
    assert cause in named
    for one in told.causes:
        assert (one["level"] in ("sure", "likely")) == (one["cause"] in named), one
        beyond = one["value"] > one["limit"]
        if one["cause"] == "undertrained":
            beyond = one["value"] < one["limit"]
        # Test views and PSNR have rules of their own.
        if one["cause"] not in ("sparse", "few_views"):
            assert beyond == (one["cause"] in named), one


def test_what_is_fine_is_listed_where_all_is():
    told = of(WELL)
    assert {one["level"] for one in told.causes} == {"not seen"}
    assert told.headline == "Aligned, as far as 0.50 px can show."
    lines = report.terminal(told)
    assert lines[0] == "VERDICT   Aligned, as far as 0.50 px can show."
    fine = " ".join(" ".join(lines).split("FINE")[1].split())
    assert "camera poses (0.12 of 0.4 px)" in fine
    assert "exposure (0.04 of 0.16 stops)" in fine


def test_what_a_short_training_cannot_tell_is_not_called_fine():
    told = of(WELL._replace(passes=0.1))
    untold = {one["cause"] for one in told.causes if one["level"] == "untold"}
    assert untold == {"camera", "motion", "lens_shift", "lens_distortion", "sparse"}
    (line,) = [line for line in report.terminal(told) if line.startswith("NOT TOLD")]
    assert "camera poses" in line


def test_what_is_within_its_error_is_said_so():
    """A shift beyond its limit that the views do not agree on is not named."""
    told = of(WELL._replace(shift_px=0.11, shift_errors=1.0))
    (one,) = [one for one in told.causes if one["cause"] == "lens_shift"]
    assert one["level"] == "not seen"
    assert one["text"] == "principal point (0.22 px, within its error)"


def test_an_unknown_number_is_untold():
    told = of(WELL._replace(psnr_test_db=math.nan))
    assert level_of(told, "sparse") == "untold"
    assert "nan" not in " ".join(report.terminal(told))


def test_windows_are_the_gauge_where_they_tell():
    apart = causes.of_windows.Windows(
        *(2, 160, 19, 5, 0.72, 0.6, 0.9, 1.9, 0.66, 0.3, 0.8)
    )
    told = of(WELL._replace(windows=apart))
    (poses,) = [one for one in told.causes if one["cause"] == "camera"]
    assert (poses["value"], poses["limit"]) == (0.66, 0.5)
    assert poses["level"] == "sure"
    apart = apart._replace(corrected_px=0.3)
    corrected = "With the cameras that this run has put right the shift is 0.30 px."
    assert corrected in of(WELL._replace(windows=apart), [GAIN]).measured
    # Cameras that did not move were not put right.
    stayed = GAIN._replace(on_the_way=True, cameras_moved=0)
    assert corrected not in of(WELL._replace(windows=apart), [stayed]).measured


def test_a_command_stands_on_a_line_of_its_own(monkeypatch):
    monkeypatch.setenv(report.advice.provenance.EXPORT, "make export SCENE=a")
    told = of(WELL._replace(**FAULTS["camera"]), [GAIN])
    assert told.do_first["command"] == "make export SCENE=a"
    lines = report.terminal(told)
    place = [line[:8] for line in lines].index("DO FIRST")
    assert lines[place + 1] == " " * 14 + "make export SCENE=a"
    assert "`" not in "".join(lines)
    assert told.tried[0]["pays"]
    assert any(line.startswith("TRIED     aligned: +1.20 dB") for line in lines)


def test_lines_fit_a_terminal():
    e = WELL._replace(**FAULTS["camera"], **FAULTS["motion"], poses_given=True)
    lines = report.terminal(of(e, [GAIN]))
    assert max(map(len, lines)) <= report.WIDTH
    assert all(
        line[: report.INDENT].strip() == line[: report.INDENT].rstrip()
        for line in lines
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (0.123, "0.12"), (4, "4"), (0.045, "0.045"), (12.3, "12")],
)
def test_numbers_have_two_digits(value, text):
    assert report.number(value) == text
    assert report.number(math.nan) == "unknown"
