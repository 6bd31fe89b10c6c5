"""Courtyard: what is rendered agrees with the cameras and the motion asked for."""

import cv2
import numpy as np
import pytest

from alignerf.courtyard import rays as courtyard_rays
from alignerf.courtyard import scene as courtyard
from alignerf.courtyard import world as of_world
from alignerf.scenes import cameras
from tests import courtyard_photos

WIDTH, HEIGHT, VIEWS = 80, 60, 12


@pytest.fixture(scope="module")
def world():
    return courtyard.build_world(seed=0)


@pytest.fixture(scope="module")
def posed():
    return courtyard.make_cameras(views=VIEWS, width=WIDTH, height=HEIGHT, seed=0)


def see(world, posed, view, displacements=None, **options):
    if displacements is None:
        displacements = courtyard.at_rest()
    pixtocams, camtoworlds = posed
    return courtyard.render(
        world,
        pixtocams[view],
        camtoworlds[view],
        WIDTH,
        HEIGHT,
        displacements,
        **options,
    )


def moved(motion, motion_m, seed=0):
    return courtyard.draw_displacements(
        views=VIEWS, motion=motion, motion_m=motion_m, seed=seed
    )


def test_same_seed_gives_same_photo_and_other_seed_another(world, posed):
    # The one of the fixture is built once for all tests.
    twin = of_world.build_world(seed=0)
    other = courtyard.build_world(seed=1)
    for view in (0, VIEWS // 2):
        photo = see(world, posed, view)
        np.testing.assert_array_equal(photo, see(twin, posed, view))
        assert np.mean(photo != see(other, posed, view)) > 0.5


def test_cameras_surround_the_boxes_at_the_stated_range():
    for seed in range(20):
        pixtocams, poses = courtyard.make_cameras(
            views=48, width=400, height=300, seed=seed
        )
        axes = poses[:, :, :3]
        np.testing.assert_allclose(
            np.einsum("nij,nik->njk", axes, axes),
            np.tile(np.eye(3), (48, 1, 1)),
            0,
            1e-9,
        )
        np.testing.assert_allclose(np.linalg.det(axes), 1)
        ground_m = np.hypot(poses[:, 0, 3], poses[:, 1, 3] - 0.2)
        assert (ground_m >= 1.2).all()
        assert (ground_m <= 1.9).all()
        middle, depth = cameras.project(np.array([0, 0.2, 0.2]), pixtocams[0], poses[0])
        assert depth > 1
        assert np.abs(middle - [200, 150]).max() < 60
        # Neighbours follow each other along the arc: the test views are spread.
        azimuth = np.arctan2(poses[:, 0, 3], 0.2 - poses[:, 1, 3])
        assert (np.diff(azimuth) > 0).all()


@pytest.mark.parametrize("zooms", [(1, 0.5), (1, 0.5, 0.25), (1, 2, 4, 8), range(1, 6)])
@pytest.mark.parametrize("every", [2, 4, 8])
def test_each_part_of_the_views_has_all_zooms(zooms, every):
    size = {"views": 80, "width": 40, "height": 30}
    lenses, poses = courtyard.make_cameras(**size)
    zoomed, same = courtyard.make_cameras(**size, zooms=zooms)
    np.testing.assert_array_equal(poses, same)
    # Pixel to camera: a longer lens has smaller pixels, and the middle stays.
    times = lenses[:, 0, 0] / zoomed[:, 0, 0]
    middle = zoomed @ np.array([20, 15, 1])
    np.testing.assert_allclose(middle, np.tile([0, 0, 1], (80, 1)), atol=1e-12)
    for part in (times[::every], np.delete(times, np.s_[::every])):
        assert set(np.round(part, 9)) == set(zooms)


def test_depth_agrees_between_views(world, posed):
    """A point seen at its depth in one view is seen, or hidden, in another."""
    pixtocams, poses = posed
    x, y = courtyard.pixel_centres(WIDTH, HEIGHT)
    agreed = []
    for view in range(VIEWS - 1):
        camera = pixtocams[view], poses[view]
        depth_m, _ = courtyard_photos.seen(
            world, *camera, WIDTH, HEIGHT, courtyard.at_rest()
        )
        directions = courtyard_rays.ray_directions(x, y, *camera)
        points = poses[view, :, 3] + depth_m.reshape(-1, 1) * np.transpose(directions)
        there, depth = cameras.project(points, pixtocams[view + 1], poses[view + 1])
        inside = ((there > 0) & (there < [WIDTH, HEIGHT])).all(axis=1) & (depth > 0)
        seen = courtyard_rays.cast(
            world,
            pixtocams[view + 1],
            poses[view + 1],
            *there[inside].T,
            courtyard.at_rest(),
        )
        ratio = seen.t / depth[inside]
        # Nothing may be seen through a surface that the first view saw.
        assert ratio.max() < 1 + 1e-6
        agreed.append(np.mean(ratio > 1 - 1e-6))
    assert np.mean(agreed) > 0.7


def test_scene_is_unbounded_and_full(world, posed):
    nearest, farthest, ids = np.inf, 0.0, set()
    for camera in zip(*posed, strict=True):
        depth_m, object_id = courtyard_photos.seen(
            world, *camera, WIDTH, HEIGHT, courtyard.at_rest()
        )
        assert np.isfinite(depth_m).all()
        nearest = min(nearest, depth_m.min())
        farthest = max(farthest, depth_m.max())
        ids |= set(np.unique(object_id))
    assert nearest > 0.2
    assert 100 < farthest < 320
    assert ids == set(range(len(courtyard.OBJECTS)))


def test_boxes_hide_what_a_ray_march_finds_behind_them(world, posed):
    """Depth against a brute-force march in steps of 2 mm through the boxes."""
    pixtocams, poses = posed
    rng = np.random.default_rng(0)
    shifts = moved("uniform", 0.1)[0]
    x, y = rng.uniform(0, WIDTH, 300), rng.uniform(0, HEIGHT, 300)
    hits = courtyard_rays.cast(world, pixtocams[0], poses[0], x, y, shifts)
    steps = np.arange(0.3, 4.0, 0.002)
    points = poses[0, :, 3] + steps[:, None, None] * np.transpose(hits.directions)
    inside = np.zeros(points.shape[:2], bool)
    ids = courtyard_rays.part_objects(world)
    for box, object_id in zip(world.boxes, ids, strict=False):
        local = (points - box.centre - shifts[object_id]) @ box.rotation
        inside |= (np.abs(local) < box.half).all(axis=-1)
    first = np.where(inside.any(axis=0), steps[inside.argmax(axis=0)], np.inf)
    on_box = hits.part < len(world.boxes)
    # The march may miss a wire or a corner, it never finds more than there is.
    assert (hits.t <= first + 1e-9).all()
    close = np.abs(hits.t - first)[on_box & (hits.t < 3.9)] < 0.003
    assert on_box.sum() > 50
    assert close.mean() > 0.9


def test_displacements_stay_in_their_disc():
    ids = [courtyard.OBJECTS.index(n) for n in courtyard.MOVING]
    still = [k for k in range(len(courtyard.OBJECTS)) if k not in ids]
    for seed in range(10):
        moves = courtyard.draw_displacements(
            views=400, motion="uniform", motion_m=0.03, seed=seed
        )
        length = np.linalg.norm(moves, axis=-1)
        assert (length[:, still] == 0).all()
        assert (moves[..., 2] == 0).all()
        assert length.max() <= 0.03
        # Uniform in a disc: the mean length is two thirds of the radius.
        np.testing.assert_allclose(length[:, ids].mean(0), 0.02, rtol=0.1)
        np.testing.assert_allclose(moves[:, ids].mean(0), 0, atol=0.003)


def test_two_states_are_two_and_equally_likely():
    ids = [courtyard.OBJECTS.index(n) for n in courtyard.MOVING]
    moves = courtyard.draw_displacements(
        views=600, motion="two_states", motion_m=0.05, seed=4
    )
    for k in ids:
        states, counts = np.unique(moves[:, k], axis=0, return_counts=True)
        assert len(states) == 2
        np.testing.assert_allclose(
            sorted(np.linalg.norm(states, axis=-1)), [0, 0.05], atol=1e-12
        )
        assert counts.min() > 240


def test_no_motion_and_one_moving_object():
    assert not courtyard.draw_displacements(views=5, motion="none").any()
    moves = courtyard.draw_displacements(views=50, motion="uniform", moving=("arm",))
    arm = courtyard.OBJECTS.index("arm")
    assert set(np.flatnonzero(moves.any(axis=(0, 2)))) == {arm}


def test_larger_photo_shrinks_to_the_small_one(world):
    """A photo at twice the size, averaged, is the photo with twice the samples."""
    small, large = (
        courtyard.render(
            world,
            *(v[1] for v in courtyard.make_cameras(views=3, width=w, height=h)),
            w,
            h,
            courtyard.at_rest(),
            supersample=n,
        ).astype(float)
        for w, h, n in ((64, 48, 4), (128, 96, 2))
    )
    mean = large.reshape(48, 2, 64, 2, 3).mean(axis=(1, 3))
    assert np.abs(mean - small).max() <= 1.5


def test_photos_have_detail_at_the_pixel(world, posed):
    """A model blurred by a pixel must lose visibly."""
    for view in (0, 4, 8):
        image = see(world, posed, view).astype(np.float32) / 255
        blurred = cv2.GaussianBlur(image, (0, 0), 1.0)
        assert -10 * np.log10(np.mean((image - blurred) ** 2)) < 27
