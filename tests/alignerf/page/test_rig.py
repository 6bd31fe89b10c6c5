"""The drawing of the cameras: which way is up, and where corrections point."""

import numpy as np
import pytest

from alignerf.page import rig
from alignerf.scenes import prepared


@pytest.fixture
def told(results):
    """(options) -> what is drawn of the results' scene."""
    return lambda moved=None, turns=None: rig.told(results, turns or {}, moved)


def test_up_in_the_photos_is_up_in_the_drawing(told, results):
    scene = prepared.load(results)
    found = np.array(told()["cameras"])
    # Corners: left above, right above, right below, left below.
    above, below = found[:, [1, 2], 1].mean(axis=1), found[:, [3, 4], 1].mean(axis=1)
    assert (above > below + 0.01).all()
    # The frusta open where the cameras look: towards each other, on an arc.
    centre, end = found[:, 0], found[:, 1:].mean(axis=1)
    assert np.ptp(end[:, 0]) < np.ptp(centre[:, 0])
    assert len(found) == len(scene.names)


@pytest.mark.parametrize(("turn", "edge"), [(1, [1, 4]), (2, [3, 4]), (3, [2, 3])])
def test_photos_that_are_turned_stand_upright(told, results, turn, edge):
    """The edge that comes up by so many turns clockwise is on top in the drawing."""
    names = prepared.load(results).names
    found = np.array(told(turns=dict.fromkeys(names, turn))["cameras"])
    others = [k for k in (1, 2, 3, 4) if k not in edge]
    assert (found[:, edge, 1].mean(axis=1) > found[:, others, 1].mean(axis=1)).all()


def test_arrows_are_those_of_cameras_that_moved_and_all_alike(told, results):
    found = told(results / "moved.npz")
    has = {
        name: arrow is not None
        for name, arrow in zip(found["names"], found["arrows"], strict=True)
    }
    assert has == {"04": True, "05": True} | dict.fromkeys(
        ("01", "<b>&'02", "03"), False
    )
    lengths = [np.linalg.norm(np.diff(a, axis=0)) for a in found["arrows"] if a]
    # 0.01 of 3 units of length, in a frame where all cameras are within 1.
    scale = rig.cameras.frame_of(
        prepared.read_cameras(results / "cameras.npz")["camtoworlds"]
    ).scale
    np.testing.assert_allclose(lengths, 0.01 * scale * found["times"], atol=2e-4)
    assert 0.3 * rig.ARROW < lengths[0] <= rig.ARROW


def test_a_turn_alone_is_seen_by_its_arrow():
    poses = np.eye(4)[None, :3]
    angle = 0.002
    turn = np.array(
        [
            [np.cos(angle), 0, np.sin(angle)],
            [0, 1, 0],
            [-np.sin(angle), 0, np.cos(angle)],
        ]
    )
    after = np.concatenate([turn, np.zeros((3, 1))], axis=1)[None]
    (arrow,), times = rig.arrows(poses, after, 0.1)
    step = arrow[1] - arrow[0]
    # Looking along -z, a turn about y by a positive angle goes to -x.
    assert step[0] == pytest.approx(-0.1 * np.sin(times * angle))
    assert abs(step[1]) < 1e-12


def test_without_corrections_there_are_no_arrows(told):
    found = told()
    assert not found["moving"]
    assert set(found["arrows"]) == {None}


def test_points_lie_in_the_frame_of_the_cameras(told, results):
    path = results / "images/points.npz"
    given = prepared.read_cameras(results / "cameras.npz")["camtoworlds"]
    np.savez(
        path,
        points=np.concatenate([given[:, :, 3], 1000 * np.ones((1, 3))]),
        colours=np.zeros((6, 3), np.uint8),
    )
    found = told()
    # The last is far away, and left out.
    centres = np.array(found["cameras"])[:, 0]
    np.testing.assert_allclose(found["points"]["places"], centres, atol=2e-4)
    path.unlink()
    assert told()["points"] == {"places": [], "colours": []}


def test_many_points_become_few(told, results):
    points = np.random.default_rng(1).normal(size=(9000, 3))
    colours = np.zeros((9000, 3), np.uint8)
    np.savez(results / "images/points.npz", points=points, colours=colours)
    assert 500 < len(told()["points"]["places"]) <= rig.MAX_POINTS
