"""Courtyard: what is rendered, what is known to be true, and that both agree."""

import cv2
import numpy as np
import pytest

from alignerf import cameras
from alignerf.scenes import courtyard, courtyard_rays, courtyard_textures

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
    twin = courtyard.build_world(seed=0)
    other = courtyard.build_world(seed=1)
    for view in (0, VIEWS // 2):
        photo = see(world, posed, view)
        for mine, theirs in zip(photo, see(twin, posed, view), strict=True):
            np.testing.assert_array_equal(mine, theirs)
        assert np.mean(photo.image != see(other, posed, view).image) > 0.5


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


@pytest.mark.parametrize(("views", "width"), [(0, 10), (3, 0)])
def test_impossible_cameras_are_refused(views, width):
    with pytest.raises(ValueError, match="at least 1"):
        courtyard.make_cameras(views=views, width=width, height=10)


def test_depth_agrees_between_views(world, posed):
    """A point seen at its depth in one view is seen, or hidden, in another."""
    pixtocams, poses = posed
    x, y = courtyard.pixel_centres(WIDTH, HEIGHT)
    agreed = []
    for view in range(VIEWS - 1):
        photo = see(world, posed, view, supersample=1)
        directions = courtyard_rays.ray_directions(x, y, pixtocams[view], poses[view])
        points = poses[view, :, 3] + photo.depth_m.reshape(-1, 1) * np.transpose(
            directions
        )
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
    for view in range(VIEWS):
        photo = see(world, posed, view, supersample=1)
        assert np.isfinite(photo.depth_m).all()
        nearest = min(nearest, photo.depth_m.min())
        farthest = max(farthest, photo.depth_m.max())
        ids |= set(np.unique(photo.object_id))
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


def misaligned(world, motion, perturb_px, view):
    """Photo, oracle, true flow and validity where pose and objects are off."""
    size = width, height = 160, 120
    pixtocams, poses = courtyard.make_cameras(views=4, width=width, height=height)
    given = cameras.perturb_poses(
        poses, pixtocams, perturb_px, np.random.default_rng(3)
    )
    shifts = courtyard.draw_displacements(views=4, motion=motion, motion_m=0.04, seed=5)
    photo_camera = pixtocams[view], poses[view]
    oracle_camera = pixtocams[view], given[view]
    photo = courtyard.render(world, *photo_camera, *size, shifts[view], supersample=4)
    oracle = courtyard.render(
        world, *oracle_camera, *size, courtyard.at_rest(), supersample=4
    )
    flow_px, valid = courtyard.true_flow(
        world, oracle_camera, photo_camera, *size, shifts[view]
    )
    return photo, oracle, flow_px, valid


def residual(photo, oracle, flow_px, where):
    """Mean difference in grey levels of the warped photo from the oracle.

    Both are blurred by a pixel, else interpolation at the finest detail is what is
    measured; pixels near the edge of an object mix what moves differently.
    """
    height, width = where.shape
    x, y = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in (width, height)))
    soft = [cv2.GaussianBlur(r.image, (0, 0), 1.0) for r in (photo, oracle)]
    warped = cv2.remap(
        soft[0], x + flow_px[..., 0], y + flow_px[..., 1], cv2.INTER_CUBIC
    )
    inner = cv2.erode(np.uint8(where), np.ones((7, 7))) > 0
    assert inner.sum() > 100
    return np.abs(warped.astype(float) - soft[1])[inner].mean()


@pytest.mark.parametrize("motion", ["none", "uniform", "two_states"])
@pytest.mark.parametrize("view", [0, 1, 3])
def test_photo_warped_by_true_flow_is_the_oracle(world, motion, view):
    photo, oracle, flow_px, valid = misaligned(world, motion, 2.0, view)
    assert valid.mean() > 0.85
    ids = np.uint8(oracle.object_id)
    edge = cv2.dilate(ids, np.ones((7, 7))) != cv2.erode(ids, np.ones((7, 7)))
    where = valid & ~edge
    warped = residual(photo, oracle, flow_px, where)
    apart = residual(photo, oracle, 0 * flow_px, where)
    assert warped < 1.5
    assert warped < 0.25 * apart
    # The wrong sign or order must not pass.
    assert residual(photo, oracle, -flow_px, where) > apart
    assert residual(photo, oracle, flow_px[..., ::-1].copy(), where) > 2 * warped


def test_motion_alone_moves_the_moving_objects_alone(world):
    ids = [courtyard.OBJECTS.index(n) for n in courtyard.MOVING]
    for view in range(4):
        photo, oracle, flow_px, valid = misaligned(world, "uniform", 0.0, view)
        still = ~np.isin(oracle.object_id, ids)
        np.testing.assert_allclose(flow_px[still], 0, atol=1e-6)
        assert 0.5 < np.linalg.norm(flow_px, axis=-1).max() < 20
        where = valid & ~still
        warped = residual(photo, oracle, flow_px, where)
        assert warped < 3
        assert warped < 0.6 * residual(photo, oracle, 0 * flow_px, where)


def test_no_difference_is_no_flow(world):
    for view in range(4):
        photo, oracle, flow_px, valid = misaligned(world, "none", 0.0, view)
        np.testing.assert_array_equal(photo.image, oracle.image)
        np.testing.assert_allclose(flow_px, 0, atol=1e-6)
        assert valid.all()


def test_flow_is_invalid_behind_a_box_that_moved_in_front(world, posed):
    pixtocams, poses = posed
    camera = pixtocams[5], poses[5]
    shifts = courtyard.at_rest()
    # Half a metre aside: the carton hides ground that the oracle shows.
    carton = courtyard.OBJECTS.index("carton")
    shifts[carton, 0] = 0.5
    _, valid = courtyard.true_flow(world, camera, camera, WIDTH, HEIGHT, shifts)
    before = see(world, posed, 5, supersample=1).object_id
    after = see(world, posed, 5, shifts, supersample=1).object_id
    np.testing.assert_array_equal(
        valid[before != carton], after[before != carton] == before[before != carton]
    )
    assert (~valid).sum() > 50


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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"motion": "shaken"}, "motion must be"),
        ({"motion": "uniform", "motion_m": -1.0}, "motion_m"),
        ({"motion": "uniform", "motion_m": float("nan")}, "motion_m"),
        ({"motion": "uniform", "moving": ("piano",)}, "piano"),
    ],
)
def test_wrong_motion_is_named(options, message):
    with pytest.raises(ValueError, match=message):
        courtyard.draw_displacements(views=2, **options)


def test_supersampling_converges(world, posed):
    images = {n: see(world, posed, 4, supersample=n).image for n in (1, 2, 4, 8)}
    far = {n: np.abs(images[n].astype(float) - images[8]).mean() for n in (1, 2, 4)}
    assert far[1] > far[2] > far[4]
    assert far[4] < 3


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
        ).image.astype(float)
        for w, h, n in ((64, 48, 4), (128, 96, 2))
    )
    mean = large.reshape(48, 2, 64, 2, 3).mean(axis=(1, 3))
    assert np.abs(mean - small).max() <= 1.5


def test_photos_have_detail_at_the_pixel(world, posed):
    """A model blurred by a pixel must lose visibly."""
    for view in (0, 4, 8):
        image = see(world, posed, view).image.astype(np.float32) / 255
        blurred = cv2.GaussianBlur(image, (0, 0), 1.0)
        assert -10 * np.log10(np.mean((image - blurred) ** 2)) < 27


def self_similarity(texture):
    """Highest normalised correlation of a texture with itself shifted or mirrored."""
    grey = texture.mean(axis=2)
    grey = grey - cv2.GaussianBlur(grey, (0, 0), 8)
    spectrum = np.fft.rfft2(grey)
    energy = (grey**2).sum()
    peaks = []
    for twin in (grey, grey[::-1], grey[:, ::-1], grey[::-1, ::-1]):
        found = np.fft.irfft2(spectrum * np.conj(np.fft.rfft2(twin)), grey.shape)
        if twin is grey:
            # A texture resembles itself unshifted, and a grain away.
            found[:12, :12] = found[-12:, :12] = found[:12, -12:] = found[
                -12:, -12:
            ] = 0
        peaks.append(found.max() / energy)
    return max(peaks)


def test_textures_do_not_repeat(world):
    tile = world.ground[0][1][1][:256, :256]
    tiled = np.block([[[tile], [tile[:, ::-1]]], [[tile[::-1]], [tile[::-1, ::-1]]]])
    assert self_similarity(tiled) > 0.9
    for _, pyramid in world.ground:
        for corner in (0, 400):
            part = pyramid[0][corner : corner + 600, corner : corner + 600]
            assert self_similarity(part) < 0.1
    for ring in world.rings:
        assert self_similarity(ring.pyramid[0][:, :2048]) < 0.2


def test_quilt_has_unit_contrast_everywhere():
    for seed, name in enumerate(("grass", "gravel", "brick")):
        rng = np.random.default_rng(seed)
        detail = courtyard_textures.quilt(name, (300, 500), rng)
        assert detail.shape == (300, 500)
        blocks = detail.reshape(6, 50, 10, 50).std(axis=(1, 3))
        assert blocks.min() > 0.4
        assert blocks.max() < 2
        assert np.abs(detail.mean()) < 0.1
