"""Names of jobs, and what their logs tell."""

import pytest

from alignerf.cli import folders, report
from alignerf.io import progress


@pytest.mark.parametrize(
    ("rule", "wildcards", "name"),
    [
        ("train", {"training": "plain/round0"}, "plain: training"),
        ("render", {"training": "warped/round2"}, "warped, round 2: renders"),
        ("train", {"training": "pretrain/base"}, "pretrain base: training"),
        ("export_folder", {"method": "m"}, "m: files for other programs"),
        ("evaluate", {"training": "a/round0", "moved": ""}, "a: scores"),
        (
            "evaluate",
            {"training": "a/round0", "moved": "_aligned_pose"},
            "a: scores, with moved cameras",
        ),
        (
            "decompose",
            {"training": "a/round0", "photos": "_photos", "split": "train"},
            "a: parts of the flow, train photos",
        ),
        (
            "export_folder",
            {"method": "aligned", "what": "cameras"},
            "aligned: files for other programs, cameras",
        ),
        ("a_new_rule", {}, "a new rule"),
    ],
)
def test_a_job_has_its_methods_name(rule, wildcards, name):
    alone = report.name_of(rule, wildcards | {"scene": "chair"}, ["chair"])
    assert alone.startswith(name)
    several = report.name_of(rule, wildcards | {"scene": "chair"}, ["chair", "fox"])
    assert several == f"chair: {alone}"
    # Windows are scenes of their own.
    window = report.name_of(rule, wildcards | {"scene": "chair_crops"}, ["chair"])
    assert window == f"chair_crops: {alone}"


def test_names_are_of_rules_that_there_are():
    assert set(report.NAMES) <= folders.taken_names()


def test_what_progress_writes_is_read_again(capsys):
    shown = progress.Progress("training", 100, done=20)
    shown.log_every_s = 0.0
    shown.advance(60, loss=0.5)
    line = capsys.readouterr().err.strip()
    found = progress.read(line)
    assert found.text == "step 80/100"
    assert found.left_s >= 0
    assert progress.read("COLMAP: features: for 1:30").text.endswith("for 1:30")
    assert progress.read("error: 1/2 is wrong") is None


def test_the_last_line_of_a_log_tells_how_far_a_job_is(tmp_path):
    log = tmp_path / "a.log"
    assert report.last_shown([log]) is None
    log.write_text("begun\nviews: view 1/9    eta 0:40\rviews: view 3/9    eta 1:40\n")
    assert report.last_shown([log]) == ("view 3/9", 100)
    with open(log, "a") as file:
        file.write("x" * 10_000 + "\nwritten\n")
    assert report.last_shown([log]) is None
    log.write_bytes(b"\xff\n" * 5000)
    assert report.last_shown([log]) is None


def test_warnings_are_told_once_and_progress_is_not(tmp_path):
    log = tmp_path / "a.log"
    log.write_text("warning: a\nv: view 1/2    eta 0:01\nb\nwarning: a\n")
    assert report.said([log]) == ["warning: a", "b", "warning: a"]
    assert report.warnings([log, tmp_path / "none.log"]) == ["warning: a"]
