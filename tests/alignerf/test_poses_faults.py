"""How the entry point fails: one line, and nothing lost."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from alignerf import poses
from alignerf.io import faults, images, json_files


@pytest.fixture(scope="module")
def courtyard(tmp_path_factory):
    out = tmp_path_factory.mktemp("results") / "courtyard"
    small = {"views": 4, "width": 48, "height": 36}
    config = {"source": "courtyard", "poses": "truth", "courtyard": small}
    poses.main(config, out)
    return out


def run_cli(config, out):
    """(exit status, lines of stderr) of the command as a rule runs it."""
    text = json.dumps(config)
    done = subprocess.run(
        [sys.executable, "-m", "alignerf.poses", "--config", text, "--out", str(out)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONWARNINGS": "error"},
    )
    assert done.stdout == ""
    return done.returncode, done.stderr.splitlines()


def photo_folder(folder, *, truncated=False):
    """Three photos of unrelated noise, the second possibly cut short."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    for name in "abc":
        noise = rng.integers(0, 256, (12, 16, 3), dtype=np.uint8)
        path = folder / f"{name}.jpg"
        Image.fromarray(noise.repeat(8, 0).repeat(8, 1)).save(path)
        if truncated and name == "b":
            path.write_bytes(path.read_bytes()[:2000])


def bad_configs(tmp_path):
    """[(config, what the one line of error must name)]"""
    (tmp_path / "empty").mkdir()
    photo_folder(tmp_path / "three")
    photo_folder(tmp_path / "cut", truncated=True)
    (tmp_path / "transforms.json").write_text("{")
    photos, given = {"source": "photos"}, {"source": "transforms"}
    small = {"views": 4, "width": 32, "height": 32}
    return [
        (photos | {"path": str(tmp_path / "empty")}, str(tmp_path / "empty")),
        (photos | {"path": str(tmp_path / "none")}, str(tmp_path / "none")),
        (photos | {"path": str(tmp_path / "cut")}, str(tmp_path / "cut" / "b.jpg")),
        (photos | {"path": str(tmp_path / "three")}, "registered 0 of 3 images"),
        (photos, "path"),
        (photos | {"path": str(tmp_path), "poses": "truth"}, "poses"),
        (given | {"path": str(tmp_path)}, "transforms.json"),
        ({"source": "film"}, "film"),
        ({"source": "courtyard", "sead": 1}, "sead"),
        ({"source": "courtyard", "seed": "1"}, "seed"),
        ({"source": "courtyard", "courtyard": {"views": 4.5}}, "views"),
        ({"source": "courtyard", "downscale": 0}, "downscale"),
        ({"source": "courtyard", "perturb_px": float("nan")}, "perturb_px"),
        ({"source": "courtyard", "perturb_by": "zoom"}, "perturb_by"),
        (
            {"source": "courtyard", "poses": "truth", "courtyard": {"views": 0}},
            "courtyard.views",
        ),
        (
            {"source": "courtyard", "poses": "truth", "courtyard": {"motion": "fast"}},
            "motion",
        ),
        (
            {"source": "courtyard", "poses": "truth", "courtyard": {"moving": ["cat"]}},
            "cat",
        ),
        (
            {
                "source": "courtyard",
                "colmap": {"camera_model": "OPENCV"},
                "courtyard": small,
            },
            "camera_model",
        ),
        (
            {
                "source": "courtyard",
                "poses": "truth",
                "downscale": 8,
                "courtyard": small,
            },
            "downscale",
        ),
        ("{", "JSON"),
        *((text, "") for text in ("none", "none/x.json", "", ".")),
        (str(tmp_path / "no such file"), "no such file"),
    ]


def test_every_fault_is_one_line_and_leaves_nothing(tmp_path, capsys):
    """In one process, as the command's start costs more than all of them."""
    for config, named in bad_configs(tmp_path):
        text = config if isinstance(config, str) else json.dumps(config)
        out = tmp_path / "results" / "scene"
        with pytest.raises(SystemExit) as stopped:
            faults.run(
                lambda text=text, out=out: poses.main(json_files.of_config(text), out)
            )
        assert stopped.value.code == 1
        lines = [line for line in capsys.readouterr().err.splitlines() if line]
        errors = [line for line in lines if line.startswith("error: ")]
        assert len(errors) == 1, lines
        assert lines[-1] == errors[0]
        assert named in errors[0]
        assert not out.exists()


def test_the_command_itself(tmp_path):
    out = tmp_path / "scene"
    (tmp_path / "empty").mkdir()
    status, lines = run_cli({"source": "photos", "path": str(tmp_path / "empty")}, out)
    assert status == 1
    assert lines == [f"error: no images in {tmp_path / 'empty'}"]
    assert not out.exists()


def test_a_failure_keeps_what_an_earlier_run_made(courtyard, tmp_path):
    before = {p: p.stat().st_mtime_ns for p in courtyard.rglob("*")}
    with pytest.raises(ValueError, match="no folder"):
        poses.main({"source": "photos", "path": str(tmp_path / "none")}, courtyard)
    assert before == {p: p.stat().st_mtime_ns for p in courtyard.rglob("*")}


def test_another_source_takes_the_truth_away(courtyard, tmp_path):
    shutil.copytree(courtyard, tmp_path / "scene")
    (tmp_path / "images").mkdir()
    frames = []
    for name in ("a", "b"):
        pixels = np.full((32, 40, 3), ord(name), np.uint8)
        images.write(tmp_path / "images" / f"{name}.png", pixels)
        matrix = np.eye(4)
        matrix[0, 3] = ord(name)
        frame = {"file_path": f"images/{name}", "transform_matrix": matrix.tolist()}
        frames.append(frame)
    scene = {"camera_angle_x": 1.0, "frames": frames}
    (tmp_path / "transforms.json").write_text(json.dumps(scene))
    config = {"source": "transforms", "path": str(tmp_path), "min_train_views": 1}
    poses.main(config, tmp_path / "scene")
    found = sorted(p.name for p in (tmp_path / "scene").iterdir())
    assert found == ["cameras.npz", "images", "poses.json"]
    with np.load(tmp_path / "scene" / "cameras.npz") as stored:
        assert list(stored["names"]) == ["a", "b"]
