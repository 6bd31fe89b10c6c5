"""Corrected cameras, and the frame in which they stand."""

import numpy as np
import pytest

from alignerf.alignment import cameras as aligned
from alignerf.scenes import cameras, prepared
from flow.camera import correct
from flow.camera import motion as camera_motion

WIDTH, HEIGHT, FOCAL_PX, COUNT, DEPTH = 64, 48, 1600.0, 12, 5.0


@pytest.fixture
def narrow(tmp_path, rng):
    """Cameras with a long lens that face one way; of two, the photos are held out."""
    poses = np.repeat(np.eye(4)[None, :3], COUNT, axis=0)
    poses[:, :, 3] = rng.uniform(-1, 1, size=(COUNT, 3)) * [1, 1, 0.2]
    pixtocam = cameras.intrinsics(FOCAL_PX, WIDTH, HEIGHT)
    np.savez(
        tmp_path / "cameras.npz",
        pixtocams=np.stack([pixtocam] * COUNT),
        camtoworlds=poses,
        names=[f"v{i}" for i in range(COUNT)],
        width=WIDTH,
        height=HEIGHT,
        split=["test"] * 2 + ["train"] * (COUNT - 2),
    )
    return prepared.load(tmp_path)


def correction_of(turn_px, step_px):
    """A camera that turns, and steps, by so many pixels [2] of what is at DEPTH."""
    x, y = np.array(turn_px) / FOCAL_PX
    motion = camera_motion.Motion(
        rotation=np.array([-y, x, 0.0]),
        centre=np.array([*step_px, 0.0]) * DEPTH / FOCAL_PX,
        log_focal=0.0,
    )
    return correct.Correction(motion, 1.0, 0.02, 1.0, DEPTH, "")


def seen_px(scene, views, places):
    """Where these views see places [n, 3]: pixels [views, n, 2]."""
    cameras_of = zip(scene.pixtocams[views], scene.camtoworlds[views], strict=True)
    return np.stack([cameras.project(places, *camera)[0] for camera in cameras_of])


def test_a_common_turn_that_a_step_hides_is_taken_out(narrow, rng):
    """All turn by 8 px and step back by 8 px, and each by some more: no photo shows it.

    What they see must not be seen elsewhere by cameras that stay where they were.
    """
    train, test = narrow.views("train"), narrow.views("test")
    own_px = rng.normal(size=(len(train), 2))
    corrections = [
        correction_of(np.array([8.0, -5.0]) + px, np.array([-8.0, 5.0]) - px)
        for px in own_px
    ]
    found = aligned.corrected(narrow, train, corrections)
    places = np.array([[0.01, 0.02, -DEPTH], [-0.02, 0.01, -DEPTH]])
    places = narrow.camtoworlds[0, :, 3] + places
    before, after = (seen_px(one, train, places) for one in (narrow, found))
    assert np.abs((after - before).mean(axis=0)).max() < 0.1
    # Neither are the corrected cameras all turned against those that stay.
    turns = narrow.camtoworlds[train, :, :3].swapaxes(1, 2)
    turns = turns @ found.camtoworlds[train, :, :3]
    common_px = FOCAL_PX * turns.mean(axis=0)[[0, 1], [2, 2]]
    assert np.abs(common_px).max() < 0.1
    np.testing.assert_array_equal(found.camtoworlds[test], narrow.camtoworlds[test])


def test_views_left_alone_hold_the_frame(narrow):
    train = narrow.views("train")
    corrections = [correction_of([6.0, 0.0], [0.0, 0.0])]
    stays = correct.left_alone(corrections[0], "it stays")
    corrections += [stays] * (len(train) - 1)
    found = aligned.corrected(narrow, train, corrections)
    np.testing.assert_array_equal(
        found.camtoworlds[train[1:]], narrow.camtoworlds[train[1:]]
    )
    places = narrow.camtoworlds[train[0], :, 3] + [[0.0, 0.0, -DEPTH]]
    before, after = (seen_px(one, train[:1], places) for one in (narrow, found))
    # Its own share of what is taken out is one of ten.
    assert np.linalg.norm(after - before) == pytest.approx(6.0, rel=0.15)


def test_where_nothing_moves_nothing_changes(narrow):
    train = narrow.views("train")
    stays = correct.left_alone(correction_of([0.0, 0.0], [0.0, 0.0]), "it stays")
    found = aligned.corrected(narrow, train, [stays] * len(train))
    np.testing.assert_array_equal(found.camtoworlds, narrow.camtoworlds)
    scale, turn, shift = aligned.common(narrow, train, [stays] * len(train))
    assert scale == 1
    np.testing.assert_array_equal(turn, np.eye(3))
    np.testing.assert_array_equal(shift, np.zeros(3))
