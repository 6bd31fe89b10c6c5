"""Cameras that have moved: their points, and the cameras of held-out views."""

import dataclasses
import json

import numpy as np
import pycolmap
import pytest
from scipy.spatial.transform import Rotation

from alignerf import correct_poses
from alignerf.exports import formats, held_out
from alignerf.readers import transforms
from alignerf.scenes import cameras, prepared
from tests import export_cases as cases


def test_cameras_that_moved_have_points_of_their_own(taken, tmp_path):
    config, scene, views = taken
    arrays = prepared.read_cameras(scene / "cameras.npz")
    arrays["camtoworlds"][:, :, 3] *= 1.001
    arrays["camtoworlds"][arrays["split"] == "test", :, 3] += 0.01
    np.savez(tmp_path / "moved.npz", **arrays)
    more = ("--cameras", tmp_path / "moved.npz")
    out = cases.exported(scene, tmp_path, *more, config=config)
    wanted = views._replace(camtoworlds=arrays["camtoworlds"])
    model, _ = cases.check_cameras(out, wanted)
    cases.check_points(model, wanted, 1.0)
    # Held-out cameras have not moved, so they see none.
    seen = {i.name.removesuffix(".png"): i.num_points3D for i in model.images.values()}
    train = arrays["names"][arrays["split"] == "train"].tolist()
    assert {name for name, count in seen.items() if count} <= set(train)
    colours = np.array([p.color for p in model.points3D.values()])
    assert colours.any(axis=1).mean() > 0.9
    ply = pycolmap.Reconstruction()
    ply.import_PLY(str(out / formats.POINTS))
    assert ply.num_points3D() == model.num_points3D()
    content = json.loads((out / "transforms.json").read_text())
    assert content["ply_file_path"] == formats.POINTS
    text = (out / "README.txt").read_text()
    assert "learn from are corrected by this run" in text
    assert "held-out photos are as given: no training has moved them" in text
    assert f"triangulated anew from {len(train)} photos" in text


def test_held_out_cameras_are_fitted_and_marked(made, views, tmp_path):
    """A flow that a camera's own error has made moves it back."""
    true = prepared.read_cameras(made / "cameras.npz")
    test = np.flatnonzero(true["split"] == "test")
    off = {key: array.copy() for key, array in true.items()}
    off["camtoworlds"][:, :, 3] += [0.01, 0.0, 0.005]
    np.savez(tmp_path / "off.npz", **off)
    loaded = prepared.load(made, tmp_path / "off.npz")
    write_flows(tmp_path, loaded, prepared.load(made))
    more = ("--fit-held-out", tmp_path / "flow", tmp_path / "depth")
    out = cases.exported(made, tmp_path, "--cameras", tmp_path / "off.npz", *more)
    found, _ = transforms.read(out)
    for view in range(len(loaded.names)):
        wanted = (true if view in test else off)["camtoworlds"][view]
        np.testing.assert_allclose(found.camtoworlds[view], wanted, atol=2e-3)
    content = json.loads((out / "transforms.json").read_text())
    marked = [i for i, frame in enumerate(content["frames"]) if "camera" in frame]
    assert marked == test.tolist()
    assert content["frames"][marked[0]]["camera"] == "fitted to its own photo"
    assert f"{len(test)} held-out photos" in (out / "README.txt").read_text()


def write_flows(folder, loaded, right):
    """Flow and depth of test views, from a scene's cameras to the right ones."""
    for name in ("flow", "depth"):
        (folder / name).mkdir()
    y, x = np.indices((loaded.height, loaded.width)) + 0.5
    for view in loaded.views("test"):
        name = f"{loaded.names[view]}.npz"
        depth = np.full(x.shape, 2.0, np.float32) + (x > 40) + 0.3 * (y > 30)
        pixels = np.stack([x, y, np.ones_like(x)], axis=-1)
        rays = pixels @ loaded.pixtocams[view].T * [1, -1, -1]
        pose = loaded.camtoworlds[view]
        points = (rays * depth[..., None]) @ pose[:, :3].T + pose[:, 3]
        camera = right.pixtocams[view], right.camtoworlds[view]
        landed, _ = cameras.project(points.reshape(-1, 3), *camera)
        flow_px = (landed.reshape(*x.shape, 2) - pixels[..., :2]).astype(np.float32)
        np.savez(folder / "flow" / name, flow_px=flow_px, valid=x > 0)
        np.savez(folder / "depth" / name, depth=depth.astype(np.float32))


def test_held_out_cameras_go_where_corrected_ones_went(made, tmp_path):
    """By the flow of the renders before: their lens, and what was taken out after."""
    right = prepared.load(made)
    off = right.camtoworlds.copy()
    off[:, :, 3] += [0.01, 0.0, 0.005]
    zoom = np.diag([1.02, 1.02, 1.0])
    before = dataclasses.replace(
        right, camtoworlds=off, pixtocams=zoom @ right.pixtocams
    )
    write_flows(tmp_path, before, right)
    similarity = 1.05, Rotation.from_rotvec([0, 0.1, 0.02]).as_matrix(), np.ones(3)
    report = {"focal_ratio": 1.02, "frame": correct_poses.frame_of(*similarity)}
    (tmp_path / "report.json").write_text(json.dumps(report))
    frame = held_out.frame_of(tmp_path / "report.json")
    # Of corrected cameras the lens is right, and test views stand where they stood.
    after = dataclasses.replace(before, pixtocams=right.pixtocams)
    folders = tmp_path / "flow", tmp_path / "depth", tmp_path / "out.npz"
    assert held_out.fit(after, made / "cameras.npz", *folders, frame)
    found = prepared.load(made, tmp_path / "out.npz").camtoworlds
    wanted = cameras.apply_similarity(right.camtoworlds, *similarity)
    for view in after.views("test"):
        np.testing.assert_allclose(found[view], wanted[view], atol=2e-3)


@pytest.mark.parametrize(
    "frame",
    [
        {},
        {"scale": 1, "rotation": [[1]], "translation": [0, 0, 0]},
        {"scale": 0, "rotation": np.eye(3).tolist(), "translation": [0, 0, 0]},
        {"scale": 1, "rotation": [["a", []]], "translation": [0, 0, 0]},
    ],
)
def test_a_report_without_a_frame_is_named(tmp_path, frame):
    path = tmp_path / "report.json"
    path.write_text(json.dumps({"focal_ratio": 1.0, "frame": frame}))
    with pytest.raises(ValueError, match=r"report.json: .*frame"):
        held_out.frame_of(path)


def test_a_held_out_camera_without_a_flow_stays(made, tmp_path, caplog):
    loaded = prepared.load(made)
    size = loaded.height, loaded.width
    for view in loaded.views("test"):
        name = f"{loaded.names[view]}.npz"
        flow_px = np.zeros((*size, 2), np.float32)
        np.savez(tmp_path / name, flow_px=flow_px, valid=np.zeros(size, bool))
    (tmp_path / "depth").mkdir()
    for view in loaded.views("test"):
        depth = np.ones(size, np.float32)
        np.savez(tmp_path / "depth" / f"{loaded.names[view]}.npz", depth=depth)
    own = made / "cameras.npz"
    out = tmp_path / "cameras.npz"
    assert held_out.fit(loaded, own, tmp_path, tmp_path / "depth", out) == []
    before, after = map(prepared.read_cameras, (own, out))
    np.testing.assert_array_equal(before["camtoworlds"], after["camtoworlds"])
    assert "stays: only 0 pixels have a flow" in caplog.text
