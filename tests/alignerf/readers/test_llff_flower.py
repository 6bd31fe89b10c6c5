"""A real scene of LLFF: its cameras agree with what OpenCV matches in its photos."""

import itertools

import cv2
import numpy as np
import pytest

from alignerf.readers import llff
from alignerf.scenes import cameras, prepare


@pytest.fixture(scope="module")
def flower(shared_data):
    """The real scene's folder, its views at 504x378, and matches of far photos."""
    folder = shared_data / "scenes" / "flower"
    if not folder.is_dir():
        pytest.skip(f"no scene at {folder}")
    views = prepare.downscale(llff.read(folder), 4)
    assert (views.width, views.height, len(views.names)) == (504, 378, 34)
    return folder, views, matches_of(views)


def matches_of(views):
    """[(i, j, pixels at i, pixels at j)] of three pairs of far photos."""
    pairs = [(0, 20), (7, 30), (3, 33)]
    found = {i: features(views.photos[i].read()) for i in itertools.chain(*pairs)}
    return [(i, j, *match(found[i], found[j])) for i, j in pairs]


def features(image):
    return cv2.SIFT_create().detectAndCompute(
        cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None
    )


def match(first, second):
    """Pixels [m, 2] twice, +0.5 at centres, by Lowe's ratio; false ones stay in."""
    (points, descriptors), (others, other_descriptors) = first, second
    pairs = cv2.BFMatcher().knnMatch(descriptors, other_descriptors, k=2)
    kept = [
        best for best, next_best in pairs if best.distance < 0.75 * next_best.distance
    ]
    at_first = np.array([points[m.queryIdx].pt for m in kept]) + 0.5
    return at_first, np.array([others[m.trainIdx].pt for m in kept]) + 0.5


def median_sampson_px(views, camtoworlds, matches):
    """Median distance of each pair's matches from its cameras' epipolar geometry."""
    medians = []
    for i, j, at_i, at_j in matches:
        first, second = camtoworlds[i], camtoworlds[j]
        rotations = [
            pose[:, :3] @ cameras.OPENGL_FROM_OPENCV for pose in (first, second)
        ]
        x, y, z = rotations[1].T @ (first[:, 3] - second[:, 3])
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        essential = cross @ rotations[1].T @ rotations[0]
        fundamental = views.pixtocams[j].T @ essential @ views.pixtocams[i]
        at_i, at_j = (np.insert(at, 2, 1, axis=1) for at in (at_i, at_j))
        lines, back = at_i @ fundamental.T, at_j @ fundamental
        slope = np.hypot(*lines[:, :2].T) ** 2 + np.hypot(*back[:, :2].T) ** 2
        medians.append(np.median(np.abs((at_j * lines).sum(axis=1)) / np.sqrt(slope)))
    return np.array(medians)


@pytest.mark.whole
def test_flower_is_seen_consistently(flower):
    """0.18, 0.28, 0.36 px of 167 to 227 matches; with axes mistaken 6 px and more."""
    _, views, matches = flower
    assert min(len(at_i) for _, _, at_i, _ in matches) > 100
    assert median_sampson_px(views, views.camtoworlds, matches).max() < 0.6
    rotations, positions = np.split(views.camtoworlds, [3], axis=-1)
    mistakes = {
        "columns taken as they come": np.linalg.inv(llff.LLFF_FROM_OPENGL),
        "up is down": np.diag([1, -1, 1]),
        "forwards is backwards": np.diag([1, -1, -1]),
        "a half turn": np.diag([-1, -1, 1]),
    }
    for name, axes in mistakes.items():
        wrong = np.concatenate([rotations @ axes, positions], axis=-1)
        assert median_sampson_px(views, wrong, matches).min() > 4, name


@pytest.mark.whole
def test_flower_is_in_front_of_its_cameras(flower):
    """Which epipolar lines do not say: most matches meet before both cameras."""
    _, views, matches = flower
    for i, j, *pixels in matches:
        projections = []
        for k in (i, j):
            rotation = views.camtoworlds[k, :, :3] @ cameras.OPENGL_FROM_OPENCV
            moved = np.insert(
                rotation.T, 3, -rotation.T @ views.camtoworlds[k, :, 3], 1
            )
            projections.append(np.linalg.inv(views.pixtocams[k]) @ moved)
        points = cv2.triangulatePoints(*projections, *(at.T for at in pixels))
        points = (points[:3] / points[3]).T
        for k in (i, j):
            _, depth = cameras.project(points, views.pixtocams[k], views.camtoworlds[k])
            assert (depth > 0).mean() > 0.9


@pytest.mark.whole
def test_flower_needs_its_lens(flower, tmp_path):
    """As taken, matches are 0.20, 0.36 and 0.39 px off, and 4 px at the corners."""
    folder, views, matches = flower
    for name in ("poses_bounds.npy", "images_2"):
        (tmp_path / name).symlink_to(folder / name)
    taken = prepare.downscale(llff.read(tmp_path), 4)
    undone_px = median_sampson_px(views, views.camtoworlds, matches)
    taken_px = median_sampson_px(taken, taken.camtoworlds, matches_of(taken))
    assert (undone_px < 0.95 * taken_px).all()
