"""Patches are found where they are, whatever their brightness, or refused."""

import cv2
import numpy as np
import pytest

from alignerf.keypoints import patches, tracks
from tests.alignerf.keypoints import made

COUNT = 40


@pytest.fixture(scope="module")
def photo():
    return made.texture(np.random.default_rng(3), side=400)


def warps_of(affine, slope=(0.0, 0.0), count=COUNT):
    return tracks.Warps(
        np.zeros((count, 2)),
        np.tile(np.asarray(affine, float), (count, 1, 1)),
        np.tile(np.asarray(slope, float), (count, 1)),
    )


def found(reference, other, here, start, warps, *, fits_slopes=False, track=None):
    count = len(here)
    still = np.broadcast_to(np.eye(2), (count, 2, 2))
    atlas = patches.Atlas(patches.cut(reference, here))
    templates, inside = atlas.sample(np.arange(count), here, still)
    assert inside.all()
    seen = patches.Atlas(patches.cut(other, start))
    track = np.arange(count) if track is None else track
    return patches.align(templates, seen, start, warps, track, fits_slopes=fits_slopes)


def moved(photo, affine, shift):
    """The photo that sees at affine @ x + shift what this one sees at x."""
    matrix = np.concatenate([affine, np.reshape(shift, (2, 1))], axis=1)
    # OpenCV's pixels have their centres at whole numbers.
    matrix[:, 2] += matrix[:, :2] @ [0.5, 0.5] - 0.5
    return cv2.warpAffine(photo, matrix, photo.shape[::-1], flags=cv2.INTER_CUBIC)


@pytest.mark.parametrize(
    "affine",
    [np.eye(2), [[1.2, 0.1], [-0.15, 0.9]], [[0.8, -0.6], [0.6, 0.8]]],
    ids=["still", "bent", "turned"],
)
@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (0.5, 60.0), (1.1, -20.0)])
def test_a_patch_is_found_to_a_few_hundredths_of_a_pixel(
    photo, rng, affine, gain, offset
):
    affine, shift = np.array(affine), np.array([7.3, -4.6])
    middle = np.array([200.0, 200.0])
    shift = shift + middle - affine @ middle
    here = rng.uniform(140, 260, (COUNT, 2))
    there = here @ affine.T + shift
    other = np.clip(gain * moved(photo, affine, shift) + offset, 0, 255)
    start = there + rng.uniform(-1.5, 1.5, (COUNT, 2))
    got = found(
        *(np.round(photo).astype(np.uint8), np.round(other).astype(np.uint8)),
        *(here, start, warps_of(affine)),
    )
    off = np.linalg.norm(got.places - there, axis=1)
    sure = got.correlation > 0.9
    assert sure.mean() > 0.85
    assert np.median(off[sure]) < 0.04
    assert np.quantile(off[sure], 0.9) < 0.15


def test_the_slope_of_a_surface_is_found(photo, rng):
    """It moves a px of offset along the epipolar line, all views of a track alike."""
    slope, line = np.array([0.25, -0.15]), np.array([1.0, 0.4])
    affine = np.eye(2) + np.outer(line, slope)
    middle = np.array([200.0, 200.0])
    other = moved(photo, affine, middle - affine @ middle)
    here = rng.uniform(170, 230, (COUNT, 2))
    there = (here - middle) @ affine.T + middle
    photos = np.round(photo).astype(np.uint8), np.clip(np.round(other), 0, 255)
    got = found(
        *(photos[0], photos[1].astype(np.uint8), here, there + 0.7),
        warps_of(np.eye(2), line),
        fits_slopes=True,
    )
    np.testing.assert_allclose(np.median(got.slopes, axis=0), slope, atol=0.05)
    flat = found(
        *(photos[0], photos[1].astype(np.uint8), here, there + 0.7),
        warps_of(np.eye(2), line),
    )
    assert np.median(got.correlation) > np.median(flat.correlation)


def test_flat_patches_and_edges_say_that_they_are_unsure():
    flat = np.full((100, 100), 128, np.uint8)
    edge = flat.copy()
    edge[:, 50:] = 200
    here = np.array([[50.0, 50.0]])
    for photo in (flat, edge):
        got = found(photo, photo, here, here + 0.4, warps_of(np.eye(2), count=1))
        assert not got.deviation_px[0] < 0.1


@pytest.mark.parametrize(
    "affine", [np.full((2, 2), np.nan), np.zeros((2, 2)), 9 * np.eye(2)]
)
def test_warps_that_show_nothing_do_not_correlate(photo, affine):
    here = np.array([[200.0, 200.0]])
    grey = np.round(photo).astype(np.uint8)
    got = found(grey, grey, here, here, warps_of(affine, count=1))
    assert not got.correlation[0] > 0.85
    assert np.isfinite(got.places).all()


def test_a_patch_at_the_border_goes_on_with_the_last_pixels(photo):
    grey = np.round(photo).astype(np.uint8)
    places = np.array([[0.0, 0.0], [399.9, 399.9], [-50.0, 900.0]])
    cut = patches.cut(grey, places)
    middle = cut.pixels[:, patches.REACH, patches.REACH]
    assert middle.tolist() == [grey[0, 0], grey[399, 399], grey[399, 0]]
