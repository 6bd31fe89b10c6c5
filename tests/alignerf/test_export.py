"""What other programs are given: read back by our own sources and by pycolmap."""

import json

import numpy as np
import pycolmap
import pytest
from PIL import Image

from alignerf import export
from alignerf.cameras import transients
from alignerf.colmap import structure
from alignerf.io import faults
from alignerf.readers import transforms
from alignerf.scenes import cameras, prepared
from tools.bench import cases


@pytest.fixture
def scene(tmp_path):
    cases.write_scene(tmp_path / "scene", cases.orbit(width=48, height=32))
    return tmp_path / "scene"


@pytest.fixture
def moved(scene, rng):
    """Cameras of their own: other poses, and a lens that differs in one view."""
    found = prepared.read_cameras(scene / "cameras.npz")
    found["camtoworlds"][:, :, 3] += 0.01 * rng.normal(size=(len(found["names"]), 3))
    found["pixtocams"][2] = cameras.intrinsics(66.0, 48, 32)
    np.savez(scene.parent / "moved.npz", **found)
    return scene.parent / "moved.npz"


def run(scene, *more):
    out = scene.parent / "out"
    arguments = ["--scene", scene, "--out", out, *more]
    return faults.exit_code(export.main, [str(part) for part in arguments]), out


def test_cameras_come_back_from_transforms_and_from_colmap(scene, moved):
    code, out = run(scene, "--cameras", moved)
    assert code == 0
    wanted = prepared.read_cameras(moved)
    views, left_out = transforms.read(out)
    assert left_out == []
    assert list(views.names) == wanted["names"].tolist()
    np.testing.assert_allclose(views.pixtocams, wanted["pixtocams"], atol=1e-6)
    np.testing.assert_allclose(views.camtoworlds, wanted["camtoworlds"], atol=1e-6)
    model = pycolmap.Reconstruction(out / "sparse" / "0")
    assert len(model.cameras) == 2
    found = structure.convert(model, wanted["names"].tolist())
    assert found.names == wanted["names"].tolist()
    np.testing.assert_allclose(
        np.linalg.inv(found.camtopix), wanted["pixtocams"], atol=1e-6
    )
    np.testing.assert_allclose(found.camtoworlds, wanted["camtoworlds"], atol=1e-6)
    assert not found.distortion.any()


def test_points_of_the_poses_come_along(scene, rng):
    points = rng.normal(size=(30, 3))
    colours = rng.integers(0, 256, (30, 3), dtype=np.uint8)
    np.savez(scene / prepared.POINTS, points=points, colours=colours)
    _, out = run(scene)
    model = pycolmap.Reconstruction(out / "sparse" / "0")
    found = sorted((p.xyz.tolist(), p.color.tolist()) for p in model.points3D.values())
    wanted = sorted(zip(points.tolist(), colours.tolist(), strict=True))
    assert found == wanted
    scene_json = json.loads((out / "transforms.json").read_text())
    ply = pycolmap.Reconstruction()
    ply.import_PLY(str(out / scene_json["ply_file_path"]))
    found = sorted((p.xyz.tolist(), p.color.tolist()) for p in ply.points3D.values())
    assert [colour for _, colour in found] == [colour for _, colour in wanted]
    np.testing.assert_allclose(
        [point for point, _ in found], [point for point, _ in wanted], atol=1e-6
    )


def test_warped_photos_bring_their_masks(scene, rng):
    loaded = prepared.load(scene)
    warped, valid = scene.parent / "warped", scene.parent / "flow"
    warped.mkdir()
    valid.mkdir()
    masks = {}
    for view in loaded.views("train"):
        name = loaded.names[view]
        image = rng.integers(0, 256, (32, 48, 3), dtype=np.uint8)
        Image.fromarray(image).save(warped / f"{name}.png")
        masks[name] = rng.uniform(size=(32, 48)) < 0.5
        np.savez(valid / f"{name}.npz", flow_px=np.zeros(2), valid=masks[name])
    code, out = run(scene, "--warped", warped, "--valid", valid)
    assert code == 0
    found = json.loads((out / "transforms.json").read_text())
    for frame, view in zip(found["frames"], range(len(loaded.names)), strict=True):
        name = loaded.names[view]
        source = warped if name in masks else scene / "images"
        shown = [
            np.asarray(Image.open(path))
            for path in (out / frame["file_path"], source / f"{name}.png")
        ]
        np.testing.assert_array_equal(*shown)
        # nerfstudio takes a mask of each photo or of none, and of one channel.
        mask = Image.open(out / frame["mask_path"])
        assert mask.mode == "L"
        mask = np.asarray(mask)
        wanted = masks.get(name, np.ones_like(mask, bool))
        np.testing.assert_array_equal(mask == 255, wanted)
        assert set(np.unique(mask)) <= {0, 255}


def test_what_comes_and_goes_is_black_in_masks(scene):
    name = prepared.load(scene).names[1]
    shown = np.zeros((8, 12), bool)
    shown[2:4, 6:9] = True
    transients.write(scene / "transients.npz", {name: shown})
    code, out = run(scene, "--transients", scene / "transients.npz")
    assert code == 0
    found = json.loads((out / "transforms.json").read_text())
    for frame in found["frames"]:
        counts = np.asarray(Image.open(out / frame["mask_path"])) == 255
        assert counts.shape == (32, 48)
        if name not in frame["file_path"]:
            assert counts.all()
            continue
        # A photo is four times as large, and a border around the mask is black, too.
        assert not counts[8:16, 24:36].any()
        assert counts.sum() == counts.size - 4 * 5 * 16
    transients.write(scene / "transients.npz", {})
    code, out = run(scene, "--transients", scene / "transients.npz")
    assert code == 0
    assert not (out / "masks").exists()


@pytest.mark.parametrize("pays", [True, False])
def test_cameras_that_brought_nothing_are_not_handed_on(scene, moved, pays, caplog):
    """A run's verdict decides; another method's gain is nothing to this one's."""
    verdict = scene.parent / "verdict.json"
    gains = [{"method": "aligned", "pays": pays}, {"method": "other", "pays": not pays}]
    verdict.write_text(json.dumps({"verdict": ["Aligned."], "gains": gains}))
    more = ("--cameras", moved, "--if-pays", verdict, "aligned")
    code, out = run(scene, *more)
    assert code == 0
    views, _ = transforms.read(out)
    wanted = moved if pays else scene / "cameras.npz"
    wanted = prepared.read_cameras(wanted)["camtoworlds"]
    np.testing.assert_allclose(views.camtoworlds, wanted, atol=1e-6)
    assert ("aligned did not show in this run" in caplog.text) == (not pays)


@pytest.mark.parametrize(
    ("break_it", "more", "reason"),
    [
        (lambda f: None, ["--warped", "here"], "--warped and --valid go together"),
        (
            lambda f: next((f / "images").iterdir()).write_bytes(b"PNG"),
            [],
            "images/view",
        ),
        (lambda f: (f / "cameras.npz").unlink(), [], "cameras.npz"),
    ],
)
def test_bad_input_is_one_line_and_nothing_written(
    scene, capsys, break_it, more, reason
):
    break_it(scene)
    code, out = run(scene, *more)
    assert code == 1
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1
    assert not out.exists()
