"""Pinhole cameras by property, over random cameras and at extremes."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from alignerf.courtyard import scene as courtyard
from alignerf.scenes import cameras
from tests import camera_twins, twins


def random_rotation(rng):
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return rotation * np.sign(np.linalg.det(rotation))


def random_poses(rng, n, *, scale=1.0):
    rotations = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    rotations *= np.sign(np.linalg.det(rotations))[:, None, None]
    return np.concatenate([rotations, scale * rng.normal(size=(n, 3, 1))], axis=-1)


def random_pixtocam(rng):
    fx, fy = rng.uniform(50, 500, 2)
    cx, cy = rng.uniform(20, 80, 2)
    return np.linalg.inv(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]))


@pytest.mark.parametrize("seed", range(20))
def test_a_point_on_a_pixels_ray_projects_to_its_centre(seed):
    rng = np.random.default_rng(seed)
    pixtocam, (pose,) = random_pixtocam(rng), random_poses(rng, 1, scale=10)
    x, y = rng.integers(0, 100, (2, 50))
    rays = cameras.pixels_to_rays(x, y, pixtocam, pose)
    depth = np.exp(rng.uniform(-5, 12, (50, 1)))
    pixels, depths = cameras.project(
        rays.origins + depth * rays.directions, pixtocam, pose
    )
    assert_allclose(pixels, np.stack([x + 0.5, y + 0.5], axis=-1), atol=1e-6)
    assert_allclose(depths, depth[:, 0], rtol=1e-6)
    assert_allclose(np.linalg.norm(rays.viewdirs, axis=-1), 1)
    _, behind = cameras.project(rays.origins - rays.directions, pixtocam, pose)
    assert (behind < 0).all()


@pytest.mark.parametrize("xp", [np, jnp])
def test_rays_of_a_thousand_cameras(xp):
    """On photos of a few to ten thousand pixels, in float64 and in float32."""
    rng = np.random.default_rng(0)
    n = 1000
    size = 10 ** rng.uniform(0, 4, (n, 2))
    focal = size.max(axis=-1, keepdims=True) * rng.uniform(0.5, 3, (n, 2))
    camtopix = np.zeros((n, 3, 3))
    camtopix[:, [0, 1], [0, 1]] = focal
    camtopix[:, :2, 2] = size * rng.uniform(0.4, 0.6, (n, 2))
    camtopix[:, 2, 2] = 1
    pixels = np.floor(size * rng.uniform(size=(n, 2))).astype(int).T
    given = np.linalg.inv(camtopix), random_poses(rng, n, scale=10)
    if xp is jnp:
        given = twins.f32(*given)
    rays = cameras.pixels_to_rays(*(xp.asarray(v) for v in pixels), *given)
    pixtocams, poses = twins.f64(*given)
    rtol = 1e-6 if xp is jnp else 1e-12
    wanted = camera_twins.pixel_ray(*pixels, pixtocams, poses)
    length = np.linalg.norm(wanted, axis=-1, keepdims=True)
    twins.assert_close(rays.directions, wanted, rtol=rtol, scale=length)
    twins.assert_close(rays.viewdirs, wanted / length, rtol=rtol, scale=1.0)
    radius = camera_twins.ray_radius(*pixels, pixtocams, poses)
    # The twin's own differences of neighbours hold 1e-12 of a radius of 1e-4.
    twins.assert_close(rays.radii[:, 0], radius, rtol=max(rtol, 1e-10))
    twins.assert_close(rays.origins, poses[:, :, 3], rtol=rtol)


def test_axes_are_those_of_opengl():
    """x right, y up, looking along -z, from the centre of a 4x2 image."""
    pixtocam = cameras.intrinsics(10.0, 4, 2)
    pose = np.eye(4)[:3]
    pixels, depth = cameras.project(
        np.array([[0.0, 0, -5], [1, 0, -5], [0, 1, -5]]), pixtocam, pose
    )
    assert_allclose(pixels, [[2, 1], [4, 1], [2, -1]])
    assert_allclose(depth, 5)


def test_a_point_in_the_cameras_plane_has_a_finite_image():
    pixels, _ = cameras.project(
        np.array([[1.0, 0, 0], [0, 0, 0]]),
        cameras.intrinsics(10.0, 4, 2),
        np.eye(4)[:3],
    )
    assert np.isfinite(pixels).all()


def test_rescaled_intrinsics_keep_rays_through_corners():
    rng = np.random.default_rng(0)
    pixtocam = random_pixtocam(rng)
    # 101x67 made smaller by 4 is 25x17, not 25.25x16.75.
    small = cameras.rescale_intrinsics(pixtocam, 25 / 101, 17 / 67)
    assert_allclose(small @ [25, 17, 1], pixtocam @ [101, 67, 1])
    assert_allclose(small @ [0, 0, 1], pixtocam @ [0, 0, 1])


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_normalised_poses(scale):
    rng = np.random.default_rng(0)
    for _ in range(400):
        poses = random_poses(rng, int(rng.integers(4, 30)), scale=scale)
        # Spreads that differ, else no axis is the longest.
        poses[:, :, 3] = poses[:, :, 3] * [1, 0.5, 0.1] + scale * rng.normal(size=3)
        turn = random_rotation(rng)
        poses = cameras.apply_similarity(poses, 1.0, turn, np.zeros(3))
        frame = cameras.frame_of(poses)
        normalised, transform = frame.normalised(poses), frame.transform()
        wanted = camera_twins.normalised_poses(poses)
        error = np.abs(wanted - normalised).max(axis=(1, 2, 3))
        assert error.min() < 1e-9
        # The transform says of points what the poses say of cameras.
        moved = poses[:, :, 3] @ transform[:3, :3].T + transform[:3, 3]
        assert_allclose(moved, normalised[:, :, 3], atol=1e-9)
        assert_allclose(np.linalg.det(normalised[:, :, :3]), 1)


@pytest.mark.parametrize("seed", range(20))
def test_a_similarity_is_recovered(seed):
    rng = np.random.default_rng(seed)
    poses = random_poses(rng, int(rng.integers(2, 12)))
    if seed % 3 == 0:
        # Cameras on a line: only their orientations fix the turn about it.
        poses[:, :, 3] = np.arange(len(poses))[:, None] * rng.normal(size=3)
    given = np.exp(rng.normal() * 3), random_rotation(rng), 10 * rng.normal(size=3)
    found = cameras.align_similarity(poses, cameras.apply_similarity(poses, *given))
    for value, expected in zip(found, given, strict=True):
        assert_allclose(value, expected, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("views", [1, 3])
def test_cameras_at_one_place_have_no_scale(views):
    """A panorama's turn and place are found all the same."""
    rng = np.random.default_rng(0)
    poses = random_poses(rng, views)
    poses[:, :, 3] = poses[0, :, 3]
    given = 1.0, random_rotation(rng), rng.normal(size=3)
    moved = cameras.apply_similarity(poses, *given)
    found = cameras.align_similarity(poses, moved)
    for value, expected in zip(found, given, strict=True):
        assert_allclose(value, expected, atol=1e-9)
    found = cameras.align_similarity(random_poses(rng, views), moved)
    assert np.isfinite(np.concatenate([np.ravel(value) for value in found])).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [5e-324, 1e-200, 1e-160, 1e-100, 1e-8, 1e17])
@pytest.mark.parametrize("other", [5e-324, 1e-200, 1.0, 1e17])
def test_cameras_of_any_size_have_a_similarity(size, other):
    """Squares of the smallest are 0: those cameras stand at one place."""
    poses, target = np.stack([random_poses(np.random.default_rng(0), 5)] * 2)
    poses[:, :, 3] *= size
    target[:, :, 3] *= other
    scale, rotation, translation = cameras.align_similarity(poses, target)
    assert_allclose(rotation, np.eye(3), atol=1e-6)
    assert_allclose(scale, other / size if min(size, other) > 1e-9 else 1, rtol=1e-6)
    assert np.isfinite(translation).all()
    assert np.isfinite(cameras.frame_of(poses).normalised(poses)).all()


def error_px(poses, pixtocams, perturbed, ahead):
    """Error [n] in px at a depth `ahead` [n] on the optical axis of each camera."""
    points = poses[:, :, 3] - ahead[:, None] * poses[:, :, 2]
    pixels = [
        [cameras.project(point, pixtocam, one)[0] for one in pair]
        for point, pixtocam, *pair in zip(
            points, pixtocams, poses, perturbed, strict=True
        )
    ]
    return np.linalg.norm(np.diff(pixels, axis=1)[:, 0], axis=-1)


def rms(values):
    return np.sqrt((values**2).mean())


@pytest.mark.parametrize("perturb_px", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("by", ["rotation", "translation", "both"])
def test_the_error_where_cameras_look_and_at_other_depths(by, perturb_px):
    pixtocams, poses = courtyard.make_cameras(views=2000, width=200, height=150)
    rng = np.random.default_rng(0)
    perturbed = cameras.perturb_poses(poses, pixtocams, perturb_px, rng, by)
    depths = cameras.looked_at(poses)
    away = np.linalg.norm(poses[:, :, 3] - cameras.focus_of(poses), axis=1)
    assert_allclose(depths, away, rtol=0.01)
    squares = {"rotation": (1, 0), "translation": (0, 1), "both": (0.5, 0.5)}[by]
    for scale in (0.5, 1.0, 4.0):
        found = rms(error_px(poses, pixtocams, perturbed, scale * depths))
        expected = perturb_px * np.sqrt(squares[0] + squares[1] / scale**2)
        assert_allclose(found, expected, rtol=0.05, atol=1e-9)
    # Across the optical axis alone, and without a turn.
    moves = perturbed[:, :, 3] - poses[:, :, 3]
    assert_allclose((moves * poses[:, :, 2]).sum(axis=1), 0, atol=1e-12)
    assert (by == "rotation" or not perturb_px) == (not moves.any())
    if by == "translation":
        np.testing.assert_array_equal(perturbed[:, :, :3], poses[:, :, :3])


def at(*centres, towards=None):
    """Poses [n, 3, 4] at these centres that look at a point; None: all along -z."""
    centres = np.array(centres, dtype=float)
    poses = np.concatenate([[np.eye(3)] * len(centres), centres[..., None]], axis=2)
    for pose in poses if towards is not None else ():
        pose[:] = courtyard.look_at(pose[:, 3], np.array(towards))
    return poses


RING = [(3.0, 0, 1), (-3.0, 0, 1), (0, 3.0, 1), (0, -3.0, 1)]
OUTWARD = at(*RING, towards=(0, 0, 0)) * np.array([-1, 1, -1, 1])
APART = at((0, 0, 0), (2, 0, 0))
SQUINT = at((0, 0, 0), (2, 0, 0), towards=(1, 1e3, 0))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("poses", "expected"),
    [
        (at(*RING, towards=(0, 0, 0)), np.sqrt(10)),
        # A camera at the focus, and one that looks away from it.
        (np.concatenate([at(*RING, towards=(0, 0, 0)), at((0, 0, 0))]), np.sqrt(10)),
        (at((5, 6, 7)), 1),
        (APART, 1),
        (OUTWARD, 3),
        (at(*[(0, 0, 0)] * 3), 1),
        (SQUINT, 1),
        (at((1e17, 0, 0), (-1e17, 0, 0), (0, 1e17, 1e16), towards=(0, 0, 0)), 1e17),
    ],
    ids=["ring", "inside", "one", "parallel", "outward", "panorama", "far", "huge"],
)
def test_what_cameras_look_at_has_a_depth(poses, expected):
    """Also where no point is closest to their axes, or none ahead."""
    assert_allclose(cameras.looked_at(poses), expected, rtol=0.01)
    pixtocams = np.repeat(cameras.intrinsics(150.0, 200, 100)[None], len(poses), axis=0)
    rng = np.random.default_rng(0)
    moved = cameras.perturb_poses(poses, pixtocams, 1.0, rng, "translation")
    lengths = np.linalg.norm(moved[:, :, 3] - poses[:, :, 3], axis=1)
    assert (lengths < expected).all()
    assert lengths.any()


def test_points_say_where_parallel_cameras_look():
    """By those ahead; without any of these, as without points."""
    points = np.array([[0, 0, -5.0], [1, 0, -7], [0, 0, -9], [0, 0, 40]])
    assert_allclose(cameras.looked_at(APART, points), 7)
    assert_allclose(cameras.looked_at(APART, points[3:]), 1)
    assert_allclose(cameras.looked_at(SQUINT, np.array([[1, 50.0, 0]])), 50, rtol=0.01)


def nearest(poses, where="file"):
    names = [f"f{i}" for i in range(len(poses))]
    return cameras.nearest_rotations(where, names, poses)


@pytest.mark.parametrize("off", [0, 1e-5, 1e-3, 0.02])
def test_inexact_rotations_become_the_nearest_and_the_furthest_is_told(
    rng, off, caplog
):
    given = random_poses(rng, 50)
    moved = given.copy()
    moved[:, :, :3] += off * rng.uniform(-0.5, 0.5, (50, 3, 3))
    moved[7, :, :3] = (1 + 2 * off) * given[7, :, :3]
    found = nearest(moved)
    turns = found[:, :, :3]
    assert_allclose(
        turns @ turns.swapaxes(1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12
    )
    assert_allclose(found, given, atol=2 * off + 1e-12)
    assert_allclose(found[7], given[7], atol=1e-12)
    # No rotation drawn at random is nearer.
    for other in random_poses(rng, 20)[:, :, :3]:
        small = cameras.nearest_rotations("", ["x"], (np.eye(3) + 1e-3 * other)[None])
        near = np.linalg.norm(moved[0, :, :3] - turns[0])
        assert near <= np.linalg.norm(moved[0, :, :3] - turns[0] @ small[0]) + 1e-12
    told = [
        record.getMessage()
        for record in caplog.records
        if "file" in record.msg % record.args
    ]
    assert len(told) == (off > 1e-4)
    assert all(f"that of f7 by {200 * off:.2g} %" in line for line in told)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("times", [1e-300, 1e-30, 0.9, 1.1, 2.5, 1e30, 1e160, 1e300])
def test_scaled_mirrored_and_no_rotations_are_refused_as_such(rng, times):
    given = random_poses(rng, 9)[:, :, :3]
    with pytest.raises(
        ValueError,
        match=rf"file: its rotations are scaled by {times:.4g}:".replace("+", r"\+"),
    ):
        nearest(times * given)
    faults = {
        "is scaled by": times * given[4],
        "is mirrored": -given[4],
        "is mirrored ": times * given[4] @ np.diag([1, 1, -1]),
        "is none": np.diag([1, 1, times]) @ given[4],
        "is none: it": np.zeros((3, 3)),
        "is none: it ": given[4][[0, 0, 1]],
        "is not finite": given[4] * [1, np.nan, 1],
        "is not finite$": given[4] * [1, np.inf, 1],
    }
    for fault, matrix in faults.items():
        poses = given.copy()
        poses[4] = matrix
        with pytest.raises(ValueError, match=f"file: the rotation of 'f4' {fault}"):
            nearest(poses)
