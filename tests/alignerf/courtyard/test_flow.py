"""Courtyard: the true flow leads from oracle to photo, and textures never repeat."""

import cv2
import numpy as np
import pytest

from alignerf.courtyard import scene as courtyard
from alignerf.courtyard import textures
from alignerf.scenes import cameras
from tests import courtyard_photos


@pytest.fixture(scope="module")
def world():
    return courtyard.build_world(seed=0)


def misaligned(world, motion, perturb_px, view):
    """Photo, oracle, its objects, true flow and validity; poses and objects are off."""
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
    _, ids = courtyard_photos.seen(world, *oracle_camera, *size, courtyard.at_rest())
    return photo, oracle, ids, flow_px, valid


def residual(photo, oracle, flow_px, where):
    """Mean difference in grey levels of the warped photo from the oracle.

    Both are blurred by a pixel, else interpolation at the finest detail is what is
    measured; pixels near the edge of an object mix what moves differently.
    """
    height, width = where.shape
    x, y = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in (width, height)))
    soft = [cv2.GaussianBlur(r, (0, 0), 1.0) for r in (photo, oracle)]
    warped = cv2.remap(
        soft[0], x + flow_px[..., 0], y + flow_px[..., 1], cv2.INTER_CUBIC
    )
    inner = cv2.erode(np.uint8(where), np.ones((7, 7))) > 0
    assert inner.sum() > 100
    return np.abs(warped.astype(float) - soft[1])[inner].mean()


@pytest.mark.parametrize("motion", ["none", "uniform", "two_states"])
@pytest.mark.parametrize("view", [0, 1, 3])
def test_photo_warped_by_true_flow_is_the_oracle(world, motion, view):
    photo, oracle, ids, flow_px, valid = misaligned(world, motion, 2.0, view)
    assert valid.mean() > 0.85
    ids = np.uint8(ids)
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
    moving = [courtyard.OBJECTS.index(n) for n in courtyard.MOVING]
    for view in range(4):
        photo, oracle, ids, flow_px, valid = misaligned(world, "uniform", 0.0, view)
        still = ~np.isin(ids, moving)
        np.testing.assert_allclose(flow_px[still], 0, atol=1e-6)
        assert 0.5 < np.linalg.norm(flow_px, axis=-1).max() < 20
        where = valid & ~still
        warped = residual(photo, oracle, flow_px, where)
        assert warped < 3
        assert warped < 0.6 * residual(photo, oracle, 0 * flow_px, where)


def test_no_difference_is_no_flow(world):
    for view in range(4):
        photo, oracle, _, flow_px, valid = misaligned(world, "none", 0.0, view)
        np.testing.assert_array_equal(photo, oracle)
        np.testing.assert_allclose(flow_px, 0, atol=1e-6)
        assert valid.all()


def test_flow_is_invalid_behind_a_box_that_moved_in_front(world):
    size = 80, 60
    pixtocams, poses = courtyard.make_cameras(views=12, width=80, height=60)
    camera = pixtocams[5], poses[5]
    shifts = courtyard.at_rest()
    # Half a metre aside: the carton hides ground that the oracle shows.
    carton = courtyard.OBJECTS.index("carton")
    shifts[carton, 0] = 0.5
    _, valid = courtyard.true_flow(world, camera, camera, *size, shifts)
    before, after = (
        courtyard_photos.seen(world, *camera, *size, d)[1]
        for d in (courtyard.at_rest(), shifts)
    )
    np.testing.assert_array_equal(
        valid[before != carton], after[before != carton] == before[before != carton]
    )
    assert (~valid).sum() > 50


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
        detail = textures.quilt(name, (300, 500), rng)
        assert detail.shape == (300, 500)
        blocks = detail.reshape(6, 50, 10, 50).std(axis=(1, 3))
        assert blocks.min() > 0.4
        assert blocks.max() < 2
        assert np.abs(detail.mean()) < 0.1
