"""Pose errors in pixels: of a known turn, and of a frame that nobody sees."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras, prepared
from alignerf.sfm import pose_error
from tools.bench import cases


@pytest.fixture
def scene(tmp_path):
    cases.write_scene(tmp_path, cases.orbit(count=9, width=64, height=48))
    return prepared.load(tmp_path)


def true_of(scene):
    found = prepared.read_cameras(scene.folder / "cameras.npz")
    return found | {"camtoworlds": scene.camtoworlds, "pixtocams": scene.pixtocams}


def points_of(scene, views):
    arrays, far = true_of(scene), np.ones((48, 64))
    return {view: pose_error.points_of(arrays, view, far) for view in views}


def test_a_turn_is_as_many_pixels_as_its_angle_times_the_focal_length(scene):
    px, views = 2.0, scene.views("train")
    focal_px = 1 / scene.pixtocams[0, 0, 0]
    turn = Rotation.from_rotvec([0, px / focal_px, 0]).as_matrix()
    other = scene.camtoworlds[1].copy()
    other[:, :3] = other[:, :3] @ turn
    camera = scene.pixtocams[1], scene.camtoworlds[1]
    for depth in (0.5, 50.0):
        found = pose_error.length_px(camera, (camera[0], other), (64, 48), depth)
        assert found == pytest.approx(px, rel=0.15)
    # One wrong camera of many is not the median.
    moved = scene.camtoworlds.copy()
    moved[views[0], :, :3] = moved[views[0], :, :3] @ turn
    state = dataclasses.replace(scene, camtoworlds=moved)
    found = pose_error.median_px(state, true_of(scene), points_of(scene, views))
    assert 0 < found < 0.5 * px


def test_a_step_counts_by_the_depth(scene):
    other = scene.camtoworlds[1].copy()
    other[:, 3] += 0.1 * other[:, 0]
    camera = scene.pixtocams[1], scene.camtoworlds[1]
    near, far = (
        pose_error.length_px(camera, (camera[0], other), (64, 48), depth)
        for depth in (1.0, 4.0)
    )
    assert near == pytest.approx(0.1 / scene.pixtocams[0, 0, 0], rel=1e-6)
    assert far == pytest.approx(near / 4, rel=1e-6)


def test_the_frame_is_no_error(scene, rng):
    turn = Rotation.random(rng=3).as_matrix()
    moved = cameras.apply_similarity(scene.camtoworlds, 2.5, turn, rng.normal(size=3))
    views = scene.views("train")
    true = true_of(scene) | {"camtoworlds": moved}
    points = {
        view: 2.5 * own @ turn.T
        + (moved[0, :, 3] - 2.5 * turn @ scene.camtoworlds[0, :, 3])
        for view, own in points_of(scene, views).items()
    }
    assert pose_error.median_px(scene, true, points) == pytest.approx(0, abs=1e-6)


def test_true_points_are_in_the_truths_frame(scene, tmp_path):
    (tmp_path / "truth" / "depth").mkdir(parents=True)
    views = scene.views("train")
    for view in views:
        path = tmp_path / "truth" / "depth" / f"{scene.names[view]}.npz"
        depth_m = np.full((48, 64), 3.0 + view)
        depth_m[:24] = np.inf
        np.savez(path, depth_m=depth_m)
    given = prepared.read_cameras(tmp_path / "cameras.npz")
    found = pose_error.true_points(scene, tmp_path / "truth", views)
    for view in views:
        camera = given["pixtocams"][view], given["camtoworlds"][view]
        pixels, depth = cameras.project(found[view], *camera)
        np.testing.assert_allclose(depth, 3.0 + view)
        assert pixels[:, 1].min() > 24
