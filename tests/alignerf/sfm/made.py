"""Matches of points that are known, seen by cameras that are known."""

import itertools

import numpy as np

from alignerf.courtyard import scene
from alignerf.scenes import cameras as posed
from alignerf.scenes import distortion as lens
from alignerf.sfm import calibration, matches, pose_error

WIDTH, HEIGHT, FOCAL_PX = 640, 480, 520.0


def orbit(count=12, *, radius=4.0, arc=2.0):
    """Poses [n, 3, 4] on an arc of so many radians, which look at the middle."""
    poses = []
    for k in range(count):
        angle = arc * k / count
        centre = radius * np.array(
            [np.cos(angle), np.sin(angle), 0.3 + 0.1 * np.sin(3 * angle)]
        )
        poses.append(scene.look_at(centre, np.zeros(3)))
    return np.array(poses)


def cameras(count=12, distortion=(0.0,) * 5, **options):
    """`calibration.Cameras` on an orbit."""
    camtopix = np.array(
        [[FOCAL_PX, 0, WIDTH / 2], [0, FOCAL_PX, HEIGHT / 2], [0, 0, 1.0]]
    )
    return calibration.Cameras(
        np.tile(camtopix, (count, 1, 1)),
        orbit(count, **options),
        np.tile(np.array(distortion, float), (count, 1)),
    )


def perturbed(true, px, rng):
    """Cameras whose poses are off by so many px."""
    poses = posed.perturb_poses(true.camtoworlds, true.pixtocams, px, rng)
    return true._replace(camtoworlds=poses)


def error_px(true, now, adjusted):
    """Pose errors of cameras at the points of a `bundle.Adjusted`, of each view."""
    points = {
        view: adjusted.points.of_view(view)
        for view, seen in enumerate(adjusted.points.seen)
        if len(seen)
    }
    return np.array(list(pose_error.distance_px(true, now, points).values()))


def matched(true, rng, *, points=500, noise_px=0.2, near=4, wrong=0.0, unseen=()):
    """The `Matches` of points in a ball, between views at most `near` apart.

    noise_px: of each coordinate. wrong: share of the keypoints that lie anywhere.
    unseen: views without a match.
    """
    xyz = rng.normal(size=(points, 3)) * 0.8
    count, keypoints = len(true.camtopix), []
    for camtopix, pose, coefficients in zip(*true, strict=True):
        camera = (xyz - pose[:, 3]) @ pose[:, :3] * [1, -1, -1]
        xy = lens.distort_points(camera[:, :2] / camera[:, 2:], camtopix, coefficients)
        xy = xy + noise_px * rng.normal(size=xy.shape)
        lost = rng.random(points) < wrong
        xy[lost] = rng.random((lost.sum(), 2)) * [WIDTH, HEIGHT]
        keypoints.append(xy)
    pairs = [
        pair
        for pair in itertools.combinations(range(count), 2)
        if pair[1] - pair[0] <= near and not {*pair} & {*unseen}
    ]
    index = np.stack([np.arange(points)] * 2, axis=1)
    names = [f"v{k:02d}" for k in range(count)]
    return matches.hold_out(
        *(names, (WIDTH, HEIGHT), keypoints),
        np.array(pairs).reshape(-1, 2),
        [index] * len(pairs),
        0,
    )
