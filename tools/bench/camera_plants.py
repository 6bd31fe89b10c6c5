"""Mistakes as users make them, planted in the cameras or photos of a capture.

A plant takes a `raw_captures.Capture` and returns another one: `given` is what its file
says, and `true` are the cameras of its photos as they are then.
"""

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras
from alignerf.sfm import calibration, mistakes

FOCAL_TIMES, OFF_CENTRE, K1, ZOOM, SCALED = 1.05, 0.03, -0.08, 1.6, 1.02


def placed(capture, camtoworlds):
    """The capture with poses [n, 3, 4] in its file."""
    return capture._replace(given=capture.given._replace(camtoworlds=camtoworlds))


def seen_by(capture, camtopix):
    """The capture with intrinsics [n, 3, 3] in its file."""
    return capture._replace(given=capture.given._replace(camtopix=camtopix))


def off(px):
    """A plant: cameras off by px, by turns and by centres."""

    def plant(capture):
        one, rng = capture.given, np.random.default_rng(0)
        poses = one.camtoworlds, one.pixtocams
        return placed(capture, cameras.perturb_poses(*poses, px, rng, by="both"))

    return plant


def with_axes(*columns):
    """A plant: the axes of each camera are these combinations of OpenGL's."""
    axes = np.array(columns, float).T

    def plant(capture):
        poses = capture.given.camtoworlds
        turned = np.concatenate([poses[:, :, :3] @ axes, poses[:, :, 3:]], axis=-1)
        return placed(capture, turned)

    return plant


def focal_long(capture):
    camtopix = capture.given.camtopix.copy()
    camtopix[:, [0, 1], [0, 1]] *= FOCAL_TIMES
    return seen_by(capture, camtopix)


def off_centre(capture):
    camtopix = capture.given.camtopix.copy()
    camtopix[:, 0, 2] += OFF_CENTRE * capture.size[0]
    return seen_by(capture, camtopix)


def half_as_large(capture):
    return seen_by(capture, capture.given.camtopix * [[0.5], [0.5], [1]])


def inverted(capture):
    return placed(capture, mistakes.inverted(capture.given.camtoworlds))


def exchanged(capture):
    poses, i = capture.given.camtoworlds.copy(), len(capture.names) // 2
    poses[[i, i + 1]] = poses[[i + 1, i]]
    return placed(capture, poses)


def of_nothing(capture):
    """Poses that look at the origin from anywhere on a sphere's upper half."""
    backs = np.random.default_rng(0).normal(size=(len(capture.names), 3))
    backs[:, 2] = np.abs(backs[:, 2])
    backs /= np.linalg.norm(backs, axis=1, keepdims=True)
    rights = np.cross([0.0, 0.0, 1.0], backs)
    rights /= np.linalg.norm(rights, axis=1, keepdims=True)
    axes = rights, np.cross(backs, rights), backs, 4 * backs
    return placed(capture, np.stack(axes, axis=-1))


def xyzw(capture):
    """World-to-camera quaternions x y z w, read as w x y z."""
    poses = mistakes.inverted(mistakes.turned(capture.given.camtoworlds))
    quaternions = Rotation.from_matrix(poses[:, :, :3]).as_quat()
    read = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
    wrong = np.concatenate([read, poses[:, :, 3:]], axis=-1)
    return placed(capture, mistakes.turned(mistakes.inverted(wrong)))


def bent(capture):
    """Photos of a lens with k1, so far magnified that all of it was photographed."""
    true, (width, height) = capture.true, capture.size
    pinhole, coefficients = true.camtopix[0], np.array([K1, 0.0, 0, 0, 0])
    corners = np.array([[0.0, 0], [width, 0], [0, height], [width, height]])
    lens = pinhole.copy()
    while True:
        reached = straight(corners, lens, coefficients, pinhole)
        if (reached >= 0).all() and (reached <= capture.size).all():
            break
        lens[[0, 1], [0, 1]] *= 1.005
    photos = resampled(
        capture.photos, lambda xy: straight(xy, lens, coefficients, pinhole)
    )
    each = np.tile(lens, (len(photos), 1, 1))
    now = true._replace(camtopix=each, distortion=true.distortion + coefficients)
    return seen_by(capture._replace(photos=photos, true=now), each)


def straight(xy, lens, coefficients, pinhole):
    """Px [k, 2] of a pinhole's photo that a lens with a distortion shows at xy."""
    found = calibration.pinhole_points(xy, lens, coefficients)
    turn = pinhole @ np.linalg.inv(lens)
    return found @ turn[:2, :2].T + turn[:2, 2]


def zoomed(capture):
    """Every third photo shows its middle alone, as large as the whole; poses stay."""
    photos, lenses = list(capture.photos), capture.true.camtopix.copy()
    middle, some = np.array(capture.size) / 2, slice(1, None, 3)
    photos[some] = resampled(photos[some], lambda xy: (xy - middle) / ZOOM + middle)
    lenses[some, :2, :2] *= ZOOM
    lenses[some, :2, 2] = (lenses[some, :2, 2] - middle) * ZOOM + middle
    return capture._replace(photos=photos, true=capture.true._replace(camtopix=lenses))


def resampled(photos, source):
    """Photos as large, whose pixels [k, 2] show what lies at source(pixels)."""
    height, width = photos[0].shape[:2]
    at = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1) + 0.5
    maps = source(at.reshape(-1, 2)).reshape(height, width, 2) - 0.5
    maps = np.moveaxis(maps, -1, 0).astype(np.float32)
    border = cv2.BORDER_REPLICATE
    return [cv2.remap(one, *maps, cv2.INTER_CUBIC, borderMode=border) for one in photos]


def rolled(capture):
    """Photos turned clockwise, with a lens that fits; poses are those of the sensor."""
    height = capture.size[1]
    to_turned = np.array([[0.0, -1, height], [1, 0, 0], [0, 0, 1]])
    true, back = capture.true, np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    camtopix = to_turned @ true.camtopix @ back
    # In the turned photo the sensor's up is right, and its left is up.
    poses = with_axes([0, 1, 0], [-1, 0, 0], [0, 0, 1])(capture).given.camtoworlds
    photos = [np.ascontiguousarray(np.rot90(photo, -1)) for photo in capture.photos]
    now = true._replace(camtopix=camtopix, camtoworlds=poses)
    return seen_by(capture._replace(photos=photos, true=now), camtopix)


def scaled(capture):
    poses = capture.given.camtoworlds.copy()
    poses[:, :, :3] *= SCALED
    return placed(capture, poses)


# {case: (what plants it, kinds of fault of which one is to come first)}; "" for none.
CASES = {
    "right": (lambda capture: capture, {""}),
    "off_1.5_px": (off(1.5), {"poses"}),
    "off_6_px": (off(6.0), {"poses"}),
    "focal_5_percent_long": (focal_long, {"focal_length"}),
    "centre_3_percent_off": (off_centre, {"principal_point"}),
    "k1_left_out": (bent, {"distortion"}),
    "every_third_zoomed": (zoomed, {"zoom"}),
    "quaternions_xyzw": (xyzw, {"convention"}),
    "axes_of_ros": (with_axes([0, 0, -1], [-1, 0, 0], [0, 1, 0]), {"convention"}),
    "axes_of_opencv": (with_axes([1, 0, 0], [0, -1, 0], [0, 0, -1]), {"convention"}),
    "world_to_camera": (inverted, {"convention"}),
    "rolled_90_degrees": (rolled, {"convention"}),
    # Undone where the file is read, or named.
    "lens_of_half_the_size": (half_as_large, {"", "focal_length", "principal_point"}),
    "rotations_times_1.02": (scaled, {"", "convention"}),
    "neighbours_exchanged": (exchanged, {"views"}),
    "of_other_photos": (of_nothing, {"unrelated"}),
}
