"""`make poses`: cameras that came are checked, adjusted and written; or left alone."""

import hashlib
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from alignerf.cli import poses
from alignerf.exports import formats
from alignerf.io import faults
from alignerf.readers import colmap_models, transforms
from alignerf.scenes import cameras
from alignerf.sfm import mistakes
from tests import courtyard_photos

WIDTH, HEIGHT, VIEWS, PERTURBED_PX = 320, 240, 10, 3.0


@pytest.fixture(scope="module")
def photographed(tmp_path_factory):
    """Photos of the courtyard at rest, and the arrays of their true cameras."""
    folder = tmp_path_factory.mktemp("photos")
    names, lenses, camtoworlds = courtyard_photos.write(folder, VIEWS, WIDTH, HEIGHT)
    return folder, {
        "names": np.array(names),
        "split": np.array(["train"] * VIEWS),
        "pixtocams": lenses,
        "camtoworlds": camtoworlds,
        "width": WIDTH,
        "height": HEIGHT,
    }


@pytest.fixture
def scan(photographed, tmp_path, monkeypatch):
    """A function: poses -> a scan with them; the working folder is a fresh one."""
    photos, arrays = photographed
    monkeypatch.chdir(tmp_path)

    def make(camtoworlds):
        folder = tmp_path / "my scan"
        folder.mkdir()
        os.symlink(photos, folder / "images")
        formats.write_transforms(
            folder / "transforms.json", arrays | {"camtoworlds": camtoworlds}
        )
        return folder

    return make


def perturbed(arrays, seed=1):
    rng = np.random.default_rng(seed)
    poses, lenses = arrays["camtoworlds"], arrays["pixtocams"]
    return cameras.perturb_poses(poses, lenses, PERTURBED_PX, rng)


def digests(folder):
    return {
        path: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def error_deg(found, true):
    """Largest turn between poses after their similarity."""
    moved = cameras.apply_similarity(found, *cameras.align_similarity(found, true))
    turns = np.einsum("nji,njk->nik", true[:, :, :3], moved[:, :, :3])
    cosine = (np.trace(turns, axis1=1, axis2=2) - 1) / 2
    return np.degrees(np.arccos(cosine.clip(-1, 1))).max()


@pytest.mark.whole
def test_wrong_poses_are_adjusted_and_written_in_every_format(
    scan, photographed, tmp_path, capsys
):
    _, arrays = photographed
    given = perturbed(arrays)
    folder = scan(given)
    before = digests(folder)
    poses.main([str(folder)])
    assert digests(folder) == before
    out = tmp_path / "results" / "my_scan" / "adjusted"
    report = json.loads((out / "report.json").read_text())
    told = report["adjustment"]
    assert told["halved"]
    assert 0.3 * PERTURBED_PX < told["pose_error_px"] < 2 * PERTURBED_PX
    said = f"poses are off by {told['pose_error_px']:.2f} px"
    assert said in capsys.readouterr().out
    # nerfstudio's file and COLMAP's model have one set of cameras.
    views, _ = transforms.read(out)
    own = colmap_models.cameras_of(out / "sparse" / "0")
    pose_of = {shot.name: shot.pose for shot in own.shots}
    in_model = np.stack([pose_of[f"{name}.png"] for name in views.names])
    np.testing.assert_allclose(in_model, views.camtoworlds, atol=1e-6)
    true = arrays["camtoworlds"]
    assert error_deg(views.camtoworlds, true) < 0.15 * error_deg(given, true)
    assert len(own.points[0]) > 100
    assert (out / "points.ply").is_file()
    assert len(list((out / "images").glob("*.png"))) == VIEWS


def test_right_poses_stay(scan, photographed, tmp_path, capsys):
    poses.main([str(scan(photographed[1]["camtoworlds"]))])
    said = capsys.readouterr().out
    assert "cameras stay as they came" in said
    assert said.rstrip().endswith("adjusted, the report alone")
    (out,) = tmp_path.glob("results/*/adjusted")
    assert [path.name for path in out.glob("[!.]*")] == ["report.json"]


@pytest.mark.whole
def test_a_mistake_of_the_file_is_named_and_undone(
    scan, photographed, tmp_path, capsys
):
    folder = scan(mistakes.turned(photographed[1]["camtoworlds"]))
    poses.main([str(folder)])
    said = capsys.readouterr().out
    assert "OpenCV's axes for OpenGL's: undone (opencv)" in said
    (out,) = tmp_path.glob("results/*/adjusted")
    views, _ = transforms.read(out)
    assert error_deg(views.camtoworlds, photographed[1]["camtoworlds"]) < 1e-3
    assert list(out.glob("images/*"))
    # Told what they are, nothing else is named; onto what is there, without photos.
    poses.main([str(folder), "--pose-convention", "opencv", "--no-photos"])
    assert "cameras stay as they came" in capsys.readouterr().out
    assert list(out.glob("transforms.json"))
    assert not (out / "images").exists()


def test_photos_without_cameras_are_refused(photographed, tmp_path, capsys):
    assert faults.exit_code(poses.main, [str(photographed[0])]) == 1
    assert "no cameras came with these photos" in capsys.readouterr().err


def test_neither_jax_nor_snakemake_is_imported(root):
    code = "import sys; from alignerf.cli import poses; "
    code += "print({'jax', 'flax', 'snakemake'} & set(sys.modules))"
    found = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True
    )
    assert found.stdout.strip() == "set()", found.stderr
