"""The whole chain with another program's trainings alone: photos to the page."""

import csv
import json
import shlex
import sys

import numpy as np
import pytest

from alignerf.io import archives

CONFIG = """
scenes:
  tiny:
    source: courtyard
    poses: truth
    test_every: 4
    perturb_px: 2.0
    courtyard: {{ views: 14, width: 88, height: 64, supersample: 1 }}
methods:
  theirs:
    rounds: 1
    changes: cameras
    external:
      train: {program} train {{data}} {{model}} {more}
      render: >-
        {program} render {{data}} {{model}} {{renders}} --depth {{depth}}
        --geometry results/{{scene}}/images/truth/depth
flow: {{ estimator: dis_fine, tolerance_px: 4.0 }}
"""


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.whole
def test_another_program_goes_in_rounds_to_the_page(tmp_path, root, forked, subtests):
    script = root / "tests" / "workflow" / "stand_in.py"
    program = f"{shlex.quote(sys.executable)} {shlex.quote(str(script))}"
    # Neither is read by a shell.
    tmp_path = tmp_path / "a folder; $(exit)"
    tmp_path.mkdir()
    config = tmp_path / "theirs.yaml"
    options = ("--configfile", config, "--cores", "2", "--")
    folder = tmp_path / "results" / "tiny"
    with subtests.test("a failure"):
        config.write_text(CONFIG.format(program=program, more="--fail"))
        target = "results/tiny/theirs/round0/timing.json"
        code, output = forked.snakemake(tmp_path, *options, target)
        assert code != 0
        *_, error, log, _ = output.strip().splitlines()
        said = "ended with exit code 1; its last line: stand_in: no more memory"
        assert error == f"error: {sys.executable} {said}"
        assert log.endswith("results/tiny/theirs/round0/logs/train.log")
    config.write_text(CONFIG.format(program=program, more=""))
    code, output = forked.snakemake(tmp_path, *options, "tiny")
    assert code == 0, output[-3000:]
    with subtests.test("cameras"):
        check_cameras(folder)
    with subtests.test("tables"):
        check_tables(folder)
    with subtests.test("verdict"):
        check_verdict(folder)


def check_cameras(folder):
    """The second training has better ones, and renders that fit its photos better."""
    path = folder / "theirs" / "round0" / "corrected" / "poses_corrected.json"
    report = json.loads(path.read_text())
    error_px = report["pose_error_px"]
    assert error_px["before"] == error_px["given"] > 1
    assert error_px["after"] < 0.7 * error_px["given"]
    # Its depth came along: cameras took steps.
    assert report["only_turned"] == 0
    data = json.loads((folder / "theirs/round1/data/transforms.json").read_text())
    corrected = archives.read(path.with_name("cameras.npz"), ["names", "camtoworlds"])
    of_view = dict(zip(*map(list, corrected.values()), strict=True))
    for frame in data["frames"]:
        name = frame["file_path"].removeprefix("images/").removesuffix(".png")
        pose = np.array(frame["transform_matrix"])[:3]
        np.testing.assert_allclose(pose, of_view[name], atol=1e-9)


def check_tables(folder):
    table = rows_of(folder / "tables" / "misalignment.csv")
    oracle = [row for row in table if row["test_set"] == "oracle"]
    assert [row["warping"] for row in oracle] == ["none", "once"]
    assert {row["field"] for row in table} == {"stand_in.py, cameras corrected"}
    assert "aligned_pose" not in {row["test_set"] for row in table}
    # Cameras that were corrected make better renders.
    assert float(oracle[1]["difference_db"]) > 0.2
    for row in oracle:
        assert float(row["train_time_s"]) > 0
        assert row["params"] == row["steps"] == row["rays_seen"] == ""
    assert float(oracle[1]["data_time_s"]) > 0
    lines = rows_of(folder / "trainings.csv")
    assert [line["folder"] for line in lines] == ["theirs/round0", "theirs/round1"]


def check_verdict(folder):
    found = json.loads((folder / "verdict.json").read_text())
    assert found["evidence"]["epochs"] is None
    assert "Poses are off" in "\n".join(found["verdict"])
    assert "too short" not in "\n".join(found["verdict"])
    page = (folder / "index.html").read_text()
    assert "Poses are off" in page
    cost = (folder / "logs" / "preflight.log").read_text()
    assert "without those of other programs" in cost
    for path in folder.rglob("*.log"):
        assert "Traceback" not in path.read_text()
