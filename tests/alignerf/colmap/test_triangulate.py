"""Points of given cameras: where things are, and how right the cameras are."""

import json

import numpy as np
import pytest

from alignerf import facts, poses
from alignerf.captures import base
from alignerf.colmap import mapping, triangulate
from alignerf.courtyard import scene as courtyard
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.exports import formats
from alignerf.io import images
from alignerf.scenes import cameras, prepared
from tests import courtyard_photos

WIDTH, HEIGHT, VIEWS = 240, 180, 6


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Photos of the courtyard at rest, and the arrays of their true cameras."""
    folder = tmp_path_factory.mktemp("photos")
    # Names that COLMAP's own lists of pairs would break at.
    names, *cameras = courtyard_photos.write(folder, VIEWS, WIDTH, HEIGHT)
    views = dict(zip(("pixtocams", "camtoworlds"), cameras, strict=True))
    views |= {"names": np.array(names), "width": WIDTH, "height": HEIGHT}
    world, at_rest = courtyard.build_world(seed=0), courtyard.at_rest()
    depths = [
        courtyard_photos.seen(world, *camera, WIDTH, HEIGHT, at_rest)[0]
        for camera in zip(*cameras, strict=True)
    ]
    return folder, views, depths


def found_of(scene, folder, **changes):
    folder.mkdir()
    return triangulate.triangulate(scene[0], folder, scene[1] | changes, seed=0)


def test_points_lie_on_what_is_seen(scene, tmp_path):
    _, views, depths = scene
    found = found_of(scene, tmp_path / "a")
    assert len(found.points) > 100
    assert found.mean_reprojection_error_px < 0.6
    # No camera has moved.
    np.testing.assert_allclose(found.camtoworlds, views["camtoworlds"], atol=1e-9)
    ratios = []
    for i, depth_m in enumerate(depths):
        lens, pose = views["pixtocams"][i], views["camtoworlds"][i]
        at, depth = cameras.project(found.points, lens, pose)
        inside = (depth > 0) & (at > 0).all(-1) & (at < [WIDTH, HEIGHT]).all(-1)
        x, y = at[inside].astype(int).T
        ratios.append(depth[inside] / depth_m[y, x])
    # Others are hidden by something nearer, or at its rim.
    ratios = np.concatenate(ratios)
    assert np.median(np.abs(ratios - 1)) < 0.02


def test_the_same_on_every_run(scene, tmp_path):
    one, other = (found_of(scene, tmp_path / name) for name in "ab")
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.errors_px, other.errors_px)


def test_wrong_cameras_show_before_anything_is_trained(scene, tmp_path, rng):
    views = scene[1]
    moved = cameras.perturb_poses(views["camtoworlds"], views["pixtocams"], 1.5, rng)
    right = found_of(scene, tmp_path / "right").mean_reprojection_error_px
    wrong = found_of(scene, tmp_path / "wrong", camtoworlds=moved)
    assert wrong.mean_reprojection_error_px > 2 * right


def test_blank_photos_have_no_points(scene, tmp_path):
    for name in scene[1]["names"]:
        blank = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
        images.write(tmp_path / f"{name}.png", blank)
    found = found_of((tmp_path, *scene[1:]), tmp_path / "work")
    assert found.points.shape == found.colours.shape == (0, 3)


def given_scene(folder, scene, *, blank=False):
    """The same as a user's transforms.json."""
    photos, views, _ = scene
    (folder / "images").mkdir(parents=True)
    for name in views["names"]:
        photo = images.read(photos / f"{name}.png")
        images.write(folder / "images" / f"{name}.png", photo | (255 * blank))
    split = np.full(VIEWS, "train")
    formats.write_transforms(folder / "transforms.json", views | {"split": split})
    return {"source": "transforms", "path": str(folder), "test_every": 3}


@pytest.mark.parametrize("downscale", [1, 2])
def test_given_poses_get_points_and_facts(scene, tmp_path, downscale):
    config = given_scene(tmp_path / "given", scene) | {"downscale": downscale}
    poses.main(config, tmp_path / "out")
    report = json.loads((tmp_path / "out" / "poses.json").read_text())
    assert report["points"] > 20
    # In pixels of the photo, whatever the size of training.
    assert 0.05 < report["mean_reprojection_error_px"] < 1.0
    assert set(report["reprojection_errors_px"]) == set(scene[1]["names"])
    loaded = prepared.load(tmp_path / "out")
    found = facts.point_facts(loaded)
    assert 0 < found["nearest"] < found["median_depth"]


def test_points_can_be_left_out_and_may_be_missing(scene, tmp_path, caplog):
    config = given_scene(tmp_path / "given", scene)
    poses.main(config | {"triangulate": False}, tmp_path / "out")
    blank = given_scene(tmp_path / "blank", scene, blank=True)
    poses.main(blank, tmp_path / "none")
    for out in ("out", "none"):
        report = json.loads((tmp_path / out / "poses.json").read_text())
        assert report["points"] is None
        assert report["mean_reprojection_error_px"] is None
        assert not (tmp_path / out / prepared.POINTS).exists()
    assert f"{blank['path']}: its views share no points" in caplog.text


@pytest.mark.parametrize(
    ("has", "asked", "wanted"),
    [
        *(("input", None, True), ("input", False, False), ("input", True, True)),
        *(("truth", None, False), ("truth", True, True)),
        # COLMAP's poses come with points.
        *(("colmap", None, False), ("colmap", True, False)),
    ],
)
def test_points_are_found_where_they_are_missing(has, asked, wanted):
    source = "transforms" if has == "input" else "courtyard"
    scene = {"source": source, "path": "p", "poses": has, "triangulate": asked}
    # Crops have them from the whole photos.
    scene, crops = map(of_scenes.checked, (scene, scene | {"crop": {"of": "other"}}))
    assert base.of(scene).wants_matches(scene) is wanted
    assert not base.of(crops).wants_matches(crops)


def test_a_full_disk_is_told_as_the_system_tells_it():
    said = "[database_sqlite.cc:1243] SQLite error: database or disk is full"
    told = pytest.raises(OSError, match=r"No space left on device: 'given\.db'")
    with told, mapping.room_for("given.db"):
        raise RuntimeError(said)
    with pytest.raises(RuntimeError, match="another"), mapping.room_for("given.db"):
        raise RuntimeError("another")
