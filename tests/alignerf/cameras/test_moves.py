"""What moves of cameras have in common: exact cases, and moves that are not sure."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from alignerf.cameras import moves
from alignerf.scenes import cameras

# A long lens that faces one way; what it sees is at DEPTH.
FOCAL_PX, SIZE, DEPTH = 3000.0, (256, 256), 5.0


def narrow(rng, count):
    """Poses [n, 3, 4] that look along -z to what is at DEPTH."""
    poses = np.repeat(np.eye(4)[None, :3], count, axis=0)
    poses[:, :, 3] = rng.uniform(-1, 1, size=(count, 3)) * [1, 1, 0.2]
    for pose in poses:
        towards = pose[:, 3] + [0, 0, DEPTH]
        turn, _ = Rotation.align_vectors(towards[None], [[0, 0, 1]])
        pose[:, :3] = turn.as_matrix()
    return poses


def moved(poses, turns_px, steps_px):
    """Poses after turns [n, 3] and steps [n, 3] along their axes, in px at DEPTH."""
    found = poses.copy()
    for pose, turn_px, step_px in zip(found, turns_px, steps_px, strict=True):
        pose[:, 3] += pose[:, :3] @ step_px * DEPTH / FOCAL_PX
        turn = Rotation.from_rotvec(turn_px / FOCAL_PX)
        pose[:, :3] = pose[:, :3] @ turn.as_matrix()
    return found


def hidden(rng, poses, px, common_px=(0.0, 0.0)):
    """Poses that turn, and step so far that what is at DEPTH stays where it is."""
    x, y = (rng.normal(size=(len(poses), 2)) * px + common_px).T
    none = np.zeros_like(x)
    # Up and right, and looking down and left.
    turns, steps = np.stack([-y, x, none], -1), np.stack([x, y, none], -1)
    return moved(poses, turns, steps)


def apart_px(seen_by, true, similarity, rng):
    """Root mean square of px by which cameras see the moved scene elsewhere."""
    errors = []
    pixtocam = cameras.intrinsics(FOCAL_PX, *SIZE)
    for given, pose in zip(seen_by, true, strict=True):
        pixels = rng.uniform(size=(40, 2)) * SIZE
        depth = rng.uniform(0.8, 1.3, size=(40, 1)) * DEPTH
        rays = np.concatenate([pixels, np.ones((40, 1))], axis=1) @ pixtocam.T
        places = depth * rays @ cameras.OPENGL_FROM_OPENCV @ pose[:, :3].T + pose[:, 3]
        scale, turn, shift = similarity
        seen, _ = cameras.project(scale * places @ turn.T + shift, pixtocam, given)
        errors.append(((seen - pixels) ** 2).sum(axis=-1).mean())
    return float(np.sqrt(np.mean(errors)))


@pytest.mark.parametrize("seed", range(10))
def test_a_similarity_is_recovered(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 12))
    poses = np.concatenate(
        [
            Rotation.random(count, rng=seed).as_matrix(),
            rng.normal(size=(count, 3, 1)),
        ],
        axis=-1,
    )
    if seed % 3 == 0:
        # Cameras on a line.
        poses[:, :, 3] = np.arange(count)[:, None] * rng.normal(size=3)
    turn = Rotation.random(rng=seed + 100).as_matrix()
    given = np.exp(rng.normal() * 3), turn, 10 * rng.normal(size=3)
    found = moves.in_common(poses, cameras.apply_similarity(poses, *given))
    for value, expected in zip(found, given, strict=True):
        assert_allclose(value, expected, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("count", [7, 40])
def test_where_cameras_only_turn_their_centres_hold_the_frame(rng, count):
    poses = narrow(rng, count)
    turned = moved(poses, rng.normal(size=(count, 3)), np.zeros((count, 3)))
    scale, turn, shift = moves.in_common(turned, poses)
    assert scale == pytest.approx(1, abs=1e-5)
    # 0.02 px, where the mean of the turns is up to half a pixel.
    assert Rotation.from_matrix(turn).magnitude() * FOCAL_PX < 0.02
    assert np.linalg.norm(shift) * FOCAL_PX / DEPTH < 0.02


@pytest.mark.parametrize("drift", [1.0, 1.02])
def test_moves_that_hide_each_other_do_not_move_what_others_see(drift):
    """Turns and steps of 3 px, and 8 px in common: 0.3 px of them can be seen."""
    errors = {"by moves": [], "by centres and axes": []}
    for seed in range(10):
        rng = np.random.default_rng(seed)
        true = narrow(rng, 34)
        given = hidden(rng, true, 3.0, (8.0, -5.0))
        given = moved(given, 0.3 * rng.normal(size=(34, 3)), np.zeros((34, 3)))
        given[:, :, 3] *= drift
        train, test = slice(0, 28), slice(28, None)
        for name, function in (
            ("by moves", moves.in_common),
            ("by centres and axes", cameras.align_similarity),
        ):
            similarity = function(true[train], given[train])
            error_px = apart_px(given[test], true[test], similarity, rng)
            errors[name].append(error_px)
    errors = {name: np.mean(found) for name, found in errors.items()}
    # Most of it is the held-out cameras' own: at other depths a step is no turn.
    assert errors["by moves"] < 1.0
    assert errors["by moves"] < 0.85 * errors["by centres and axes"]


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_do_not_matter(rng, unit):
    poses = narrow(rng, 12)
    target = hidden(rng, poses, 2.0, (3.0, 1.0))
    scale, turn, shift = moves.in_common(poses, target)
    for one in (poses, target):
        one[:, :, 3] *= unit
    found = moves.in_common(poses, target)
    assert_allclose(found[0], scale, rtol=1e-9)
    assert_allclose(found[1], turn, atol=1e-9)
    assert_allclose(found[2] / unit, shift, atol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 3, 10, 30])
def test_cameras_at_one_place_have_a_frame_without_a_scale(rng, count):
    poses = narrow(rng, count)
    poses[:, :, 3] = rng.normal(size=3)
    target = moved(poses, 30 * rng.normal(size=(count, 3)), np.zeros((count, 3)))
    target[:, :, 3] += rng.normal(size=3)
    scale, turn, shift = moves.in_common(poses, target)
    assert scale == 1
    assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert_allclose(poses[0, :, 3] @ turn.T + shift, target[0, :, 3], atol=1e-2)


@pytest.mark.parametrize("count", [2, 10, 30])
def test_of_a_panorama_whose_cameras_stepped_no_scale_is_told(rng, count):
    """The given cameras are at one place, the corrected ones are not."""
    given = narrow(rng, count)
    given[:, :, 3] = rng.normal(size=3)
    steps = rng.normal(size=(count, 3))
    corrected = moved(given, rng.normal(size=(count, 3)), steps)
    scale, turn, shift = moves.in_common(corrected, given)
    assert scale == 1
    assert Rotation.from_matrix(turn).magnitude() * FOCAL_PX < 3
    middle = corrected[:, :, 3].mean(axis=0) @ turn.T + shift
    assert_allclose(middle, given[0, :, 3], atol=3 * DEPTH / FOCAL_PX)


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("place", [0, 3])
def test_poses_that_are_not_finite_are_refused(rng, value, place):
    poses = narrow(rng, 5)
    wrong = poses.copy()
    wrong[2, 1, place] = value
    for pair in ((poses, wrong), (wrong, poses)):
        with pytest.raises(ValueError, match="a pose is not finite"):
            moves.in_common(*pair)


def test_cameras_that_turned_round_do_not_make_the_fit_run_away(rng):
    poses = narrow(rng, 9)
    turned = moved(poses, np.full((9, 3), 1.7) * FOCAL_PX, np.zeros((9, 3)))
    scale, turn, shift = moves.in_common(turned, poses)
    assert np.isfinite([scale, *shift]).all()
    assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)


def test_where_nothing_moves_there_is_nothing_in_common(rng):
    poses = narrow(rng, 9)
    scale, turn, shift = moves.in_common(poses, poses)
    assert scale == pytest.approx(1, abs=1e-12)
    assert_allclose(turn, np.eye(3), atol=1e-12)
    assert_allclose(shift, 0, atol=1e-12)
