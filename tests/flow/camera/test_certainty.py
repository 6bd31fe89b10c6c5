"""flow.camera.certainty: it covers the true error, and tells what is flat."""

import cv2
import numpy as np
import pytest

from alignerf import align_test_poses, evaluate
from alignerf.scenes import cameras
from flow.camera import certainty
from flow.camera import fit as camera_fit
from flow.camera import motion as camera_motion
from flow.estimation import estimate
from flow.warping import controls

SIZE = WIDTH, HEIGHT = 160, 120
PIXTOCAM = cameras.intrinsics(140.0, *SIZE)
BORDER = 20
BLOCK_PX = HEIGHT // align_test_poses.SQUARES
HALF = controls.checkerboard(HEIGHT, WIDTH, block_px=BLOCK_PX)


def noise(rng, sigma_px):
    """A field of unit variance, [h, w] and a border."""
    field = rng.normal(size=(HEIGHT + 2 * BORDER, WIDTH + 2 * BORDER))
    field = cv2.GaussianBlur(field, (0, 0), sigma_px)
    return (field / field.std()).astype(np.float32)


def pair(rng, levels, moved_px, *, wrong=3.0, relief=0.0):
    """(render, photo, depth, flow_px between them) of a wall, its texture of so many
    levels; relief: of its depth. Each image has noise, and wrong brightness.
    """
    texture = noise(rng, 1.5) + noise(rng, 4)
    texture *= levels / texture.std()
    bumps = cv2.resize(
        rng.uniform(-0.5, 0.5, (4, 5)), SIZE, interpolation=cv2.INTER_CUBIC
    )
    points = camera_motion.points_of(PIXTOCAM, 3 / (1 + relief * bumps))
    flat = points._replace(rays=points.rays.reshape(-1, 3), rho=points.rho.ravel())
    change = rng.normal(size=7) * camera_fit.units(flat)
    change[6] = 0
    motion = camera_motion.moved(camera_motion.STILL, change)
    length_px = np.median(np.linalg.norm(camera_motion.flow(motion, points), axis=-1))
    motion = camera_motion.moved(camera_motion.STILL, change * moved_px / length_px)
    flow_px = camera_motion.flow(motion, points)
    y, x = np.indices((HEIGHT, WIDTH))
    place = (np.stack([x, y], axis=-1) + BORDER + flow_px).astype(np.float32)
    inside = (slice(BORDER, -BORDER),) * 2
    images = [
        clean + wrong * noise(rng, 6)[inside] + 2 * rng.normal(size=clean.shape)
        for clean in (cv2.remap(texture, place, None, cv2.INTER_CUBIC), texture[inside])
    ]
    render, photo = (
        np.repeat(np.round(128 + one).clip(0, 255)[..., None], 3, axis=2).astype("u1")
        for one in images
    )
    return render, photo, 1 / points.rho, flow_px


def errors_px(render, photo, depth, true_px):
    """(true, stated) error of each half by the camera that the other one asks for."""
    flow_px, valid, _ = estimate.flow_and_validity(render, photo, method="dis_fine")
    margin_px = int(align_test_poses.MARGIN * BLOCK_PX)
    for half in (HALF, ~HALF):
        usable = valid & align_test_poses.within(~half, margin_px)
        found = camera_fit.split(flow_px, usable, PIXTOCAM, depth, log_focal=0.0)
        off = (found.camera_px - true_px)[half]
        points = camera_motion.points_of(PIXTOCAM, depth)
        stated = certainty.error_px(
            render, photo, found.motion, points, found.valid, half
        )
        yield float(np.sqrt((off**2).sum(axis=-1).mean())), stated


def test_the_stated_error_covers_the_true_one(rng):
    """Scenes of any texture, relief and motion: 95 % within two of it, all in three."""
    found = [
        error
        for _ in range(16)
        for error in errors_px(
            *pair(
                rng,
                levels=np.exp(rng.uniform(np.log(2), np.log(30))),
                moved_px=rng.uniform(0.3, 4),
                wrong=rng.uniform(0, 8),
                relief=rng.uniform(0, 0.5),
            )
        )
    ]
    ratio = np.divide(*np.transpose(found))
    assert (ratio < 2).mean() >= 0.95
    assert (ratio < 3).all()
    # It says something: it is not always large.
    assert np.median(ratio) > 0.3


@pytest.mark.parametrize("moved_px", [0.5, 3.0])
def test_a_flat_photo_is_refused_and_a_textured_one_is_used(rng, moved_px):
    for levels in (0.0, 0.5, 20.0):
        found = [
            *errors_px(*pair(rng, levels, moved_px)),
            *errors_px(*pair(rng, levels, moved_px)),
        ]
        true, stated = np.transpose(found)
        if levels < 1:
            # NaN is refused, too.
            assert not (stated <= evaluate.MAX_ERROR_PX).any()
            assert max(true) > evaluate.MAX_ERROR_PX
        else:
            assert max(stated) < evaluate.MAX_ERROR_PX / 2
            assert max(true) < evaluate.MAX_ERROR_PX / 2


def test_texture_in_one_corner_says_nothing_of_the_rest(rng):
    render, photo, depth, flow_px = pair(rng, 25.0, 2.0)
    flat = pair(rng, 0.0, 2.0)[:2]
    corner = np.zeros((HEIGHT, WIDTH), bool)
    corner[:BLOCK_PX, : 2 * BLOCK_PX] = True
    images = [
        np.where(corner[..., None], one, other)
        for one, other in zip((render, photo), flat, strict=True)
    ]
    for one in (images, (render, photo)):
        (_, stated), _ = errors_px(*one, depth, flow_px)
        assert (stated < evaluate.MAX_ERROR_PX) == (one is not images)


def test_what_shows_nothing_has_no_error():
    grey = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    points = camera_motion.points_of(PIXTOCAM, np.full((HEIGHT, WIDTH), 2.0))
    for fitted in (HALF, HALF & False):
        found = certainty.error_px(
            grey, grey, camera_motion.STILL, points, fitted, ~HALF
        )
        assert np.isnan(found)


def test_what_is_far_away_tells_no_step_and_has_an_error(rng):
    render, photo, *_ = pair(rng, 25.0, 2.0)
    points = camera_motion.points_of(PIXTOCAM, np.full((HEIGHT, WIDTH), np.inf))
    still = camera_motion.STILL
    assert certainty.error_px(render, photo, still, points, HALF, ~HALF) > 0
