"""The pair of photos whose matches fit worst, before and after."""

import numpy as np
import pytest

from alignerf.page import matched
from alignerf.scenes import prepared
from alignerf.sfm import matches
from alignerf.verdict import gains

SIZE = (72, 48)
SHOWN = {f"train/{name}" for name in ("04", "05")} | {"test/01", "test/03"}


@pytest.fixture
def found(results, rng):
    """Matches of points in space, by the moved cameras; two pairs, one of few."""
    right = prepared.read_cameras(results / "moved.npz")
    names = right["names"].tolist()
    empty = matches.Matches(names, *SIZE, [], np.zeros((0, 2), int), [], [])
    cameras = gains.cameras_of(right, empty)
    middle = right["camtoworlds"][:, :, 3].mean(axis=0)
    places = middle + rng.normal(0, 0.2, (40, 3))
    keypoints = []
    for camtopix, pose in zip(cameras.camtopix, cameras.camtoworlds, strict=True):
        own = (places - pose[:, 3]) @ pose[:, :3] * [1, -1, -1] @ camtopix.T
        keypoints.append(own[:, :2] / own[:, 2:])
    pairs = np.array([[0, 3], [3, 4], [0, 1]])
    indices = [np.stack([np.arange(n)] * 2, axis=1) for n in (30, 40, 5)]
    draws = [rng.random(40) for _ in names]
    made = matches.Matches(names, *SIZE, keypoints, pairs, indices, draws)
    matches.write(results / matches.FILE, made)
    return made


def test_the_pair_is_the_worst_and_right_cameras_fit_it(results, found):
    told = matched.told(results, {}, results / "moved.npz", SHOWN)
    before, after = told["drawn"]
    assert (before["name"], after["name"]) == ("input cameras", "corrected cameras")
    assert after["px"] < 1e-4 < before["px"]
    assert {line[0] for line in after["lines"]} == {"low"}
    assert len(before["lines"]) == len(after["lines"]) <= matched.MOST
    (only,) = matched.told(results, {}, None, SHOWN)["drawn"]
    assert only == before
    # Neither a pair of few matches nor one that the page has no photo of.
    assert matched.told(results, {}, None, {"test/01", "test/03"}) is None


@pytest.mark.parametrize("turn", range(4))
def test_lines_end_in_photos_that_stand_upright(results, found, turn):
    """After quarter turns a point is at the place where the turned photo has it."""
    told = matched.told(results, dict.fromkeys(found.names, turn), None, SHOWN)
    at = [found.names.index(name) for name in told["names"]]
    image_of = [np.zeros(SIZE[::-1]) for _ in at]
    _, *ends = told["drawn"][0]["lines"][0]
    for side, (view, image) in enumerate(zip(at, image_of, strict=True)):
        x, y = found.keypoints[view][0]
        if not (0 <= x < SIZE[0] and 0 <= y < SIZE[1]):
            continue
        image[int(y), int(x)] = 1
        upright = np.rot90(image, -turn)
        wanted = np.argwhere(upright)[0][::-1] + 0.5
        u, v = ends[2 * side] - 102 * side, ends[2 * side + 1]
        scale = upright.shape[1] / 100
        np.testing.assert_allclose([u * scale, v * scale], wanted, atol=0.6)
        assert told["sizes"][side] == [
            100,
            round(100 / upright.shape[1] * len(upright), 2),
        ]


def test_the_page_has_them_where_there_are_matches(results, render, found):
    assert 'id="matches"' in render(moved=("aligned", results / "moved.npz"))
    (results / matches.FILE).unlink()
    assert 'id="matches"' not in render()
