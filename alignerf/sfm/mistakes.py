"""The usual mistakes of a file of cameras, found by the matches before any training.

Each mistake of convention is undone, and the cameras that come out are held to the same
matches. The one that explains most of them is named, and undone where cameras are
adjusted. Views and lenses that stand out are named too.
"""

import functools

import numpy as np
from scipy.spatial.transform import Rotation

from alignerf.io import faults
from alignerf.readers import shots
from alignerf.scenes import cameras, photo_names
from alignerf.sfm import calibration

FLIP = cameras.OPENGL_FROM_OPENCV
# A convention explains the matches where the error falls to a fifth, and so many times
# more rays meet in front of both cameras, within so many px. (Three times more would
# miss an axis along which the cameras hardly move.)
TIMES_LESS, TIMES_MORE, MEET_PX = 5.0, 1.5, 4.0
# Cameras whose matches fit by so many px are not suspected.
SANE_PX = 2.0
# Of many that are tried one meets by chance: of its rays so many have to.
MEETING = 0.2
# Matches that are enough to tell, and those without which nothing is told.
MAX_MATCHES, MIN_MATCHES = 20_000, 50


def turned(poses):
    """OpenCV's axes (y down, z forwards) where OpenGL's are expected."""
    return np.concatenate([poses[:, :, :3] @ FLIP, poses[:, :, 3:]], axis=-1)


def inverted(poses):
    """World-to-camera where camera-to-world is expected."""
    back = poses[:, :, :3].swapaxes(1, 2)
    return np.concatenate([back, -back @ poses[:, :, 3:]], axis=-1)


def mirrored(axis, *, cameras_too):
    """A function: poses with one axis of the positions mirrored.

    cameras_too: the same axis of the world and of its cameras, as a left-handed
    engine has them. Which axis of a whole world is mirrored is only a turn of it.
    """
    sign = np.ones(3)
    sign[axis] = -1

    def undo(poses):
        turns = (
            sign[:, None] * poses[:, :, :3] * sign if cameras_too else poses[:, :, :3]
        )
        return np.concatenate([turns, sign[:, None] * poses[:, :, 3:]], axis=-1)

    return undo


def reordered(order, *, of):
    """A function: poses whose quaternions had their numbers in another order.

    order: places of w, x, y, z in what was read as (w, x, y, z). of: "camera_to_world"
    or "world_to_camera", whose rotation the quaternions are; the translation is right.
    """

    def undo(poses):
        # Files of quaternions have OpenCV's axes.
        own = turned(poses)
        own = inverted(own) if of == "world_to_camera" else own
        quaternions = Rotation.from_matrix(own[:, :, :3]).as_quat(scalar_first=True)
        turns = Rotation.from_quat(quaternions[:, order], scalar_first=True)
        own = np.concatenate([turns.as_matrix(), own[:, :, 3:]], axis=-1)
        return turned(inverted(own) if of == "world_to_camera" else own)

    return undo


def with_axes(columns):
    """A function: poses whose cameras' axes are others than OpenGL's (right, up, back).

    columns: OpenGL's axes, in those that the file has.
    """
    turn = np.array(columns, float).T
    return lambda poses: np.concatenate(
        [poses[:, :, :3] @ turn, poses[:, :, 3:]], axis=-1
    )


def chained(*functions):
    """A function: each of them after the other."""
    return lambda poses: functools.reduce(lambda now, one: one(now), functions, poses)


WXYZ, XYZW = (1, 2, 3, 0), (3, 0, 1, 2)
# {name, as the config has it: (what it is in words, function from poses to poses)}.
MEANINGS = {
    "world_to_camera": ("world-to-camera for camera-to-world", inverted),
    "xyzw": (
        "quaternions in the order x y z w for w x y z",
        reordered(XYZW, of="world_to_camera"),
    ),
    "xyzw_camera_to_world": (
        "quaternions in the order x y z w for w x y z, of camera-to-world poses",
        chained(turned, inverted, turned, reordered(XYZW, of="camera_to_world")),
    ),
    "wxyz": (
        "quaternions in the order w x y z for x y z w",
        reordered(WXYZ, of="camera_to_world"),
    ),
}
FORWARDS = {
    "": ("", np.eye(3)),
    "opencv": ("OpenCV's axes for OpenGL's", FLIP),
    "ros": (
        "the axes of ROS (x forward, y left, z up)",
        np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0]]),
    ),
    "enu": (
        "axes with y forward and z up",
        np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
    ),
}


def axes():
    """{name: (words, function)} of cameras' axes, rolled by quarter turns or not."""
    found = {}
    for forward, (words, columns) in FORWARDS.items():
        for degrees in (0, 90, 180, 270):
            name, said = [forward] * bool(forward), [words] * bool(words)
            if degrees:
                name.append(f"roll_{degrees}")
                said.append(f"photos turned by {degrees} degrees against their poses")
            roll = Rotation.from_euler("z", degrees, degrees=True).as_matrix().round()
            found["_".join(name)] = ", ".join(said), with_axes(roll.T @ columns)
    del found[""]
    return found


AXES = axes()
POSES = AXES | MEANINGS
POSES |= {
    f"{meaning}_{name}": (f"{words}, with {more}", chained(undo, turn))
    for meaning, (words, undo) in MEANINGS.items()
    for name, (more, turn) in AXES.items()
}
POSES |= {
    f"left_handed_{name}": (
        f"a left-handed world, its {name} axis mirrored",
        mirrored(i, cameras_too=True),
    )
    for i, name in enumerate("xyz")
}
POSES |= {
    f"mirrored_{name}": (
        f"positions with their {name} axis mirrored",
        mirrored(i, cameras_too=False),
    )
    for i, name in enumerate("xyz")
}
ORDERS = {
    "natural_order": "poses in the order 1, 2, 10 for photos in the order 1, 10, 2",
    "name_order": "poses in the order 1, 10, 2 for photos in the order 1, 2, 10",
    "reversed_order": "poses in the reverse order of the photos",
}
# The input is what it says it is.
NONE = "as_stated"
EVERY = (NONE, *POSES, *ORDERS)


def order_of(convention, names):
    """Of each view, the index of the pose that is its own."""
    n = len(names)
    natural_rank = np.argsort(
        sorted(range(n), key=lambda i: photo_names.natural(names[i]))
    )
    if convention == "natural_order":
        return natural_rank
    if convention == "name_order":
        return np.argsort(natural_rank)
    return np.arange(n)[::-1]


def undone(convention, names, camtoworlds):
    """Poses [n, 3, 4] of views, sorted by name, without a mistake of the file."""
    if convention == NONE:
        return camtoworlds
    if convention in POSES:
        return POSES[convention][1](camtoworlds)
    return camtoworlds[order_of(convention, names)]


def stated(views, config):
    """The views without the mistake that a scene's `pose_convention` says they have."""
    poses = undone(config.pose_convention or NONE, views.names, views.camtoworlds)
    return views._replace(camtoworlds=poses)


def describe(convention):
    """The mistake in words."""
    return ORDERS.get(convention) or POSES[convention][0]


def measure(places, pixtocams, camtoworlds):
    """(median error in px, number of matches whose rays meet in front of both)."""
    errors = calibration.errors_px(*places, pixtocams, camtoworlds)
    meets = calibration.in_front(*places, pixtocams, camtoworlds) & (errors < MEET_PX)
    known = errors[np.isfinite(errors)]
    return float(np.median(known)) if len(known) else np.inf, int(meets.sum())


def find(matches, pixtocams, camtoworlds):
    """{convention: (median error in px, matches that meet)} that may explain matches.

    The first is NONE, the input; then those that explain the matches far better, the
    best first. Nothing is tried where the input explains them.
    """
    views, xy = matches.places()
    step = max(1, len(views) // MAX_MATCHES)
    places = views[::step], xy[::step]
    own = measure(places, pixtocams, camtoworlds)
    found = {NONE: own}
    if not len(views) or (own[0] < SANE_PX and own[1] > len(places[0]) / 2):
        return found
    others = {}
    for convention in EVERY[1:]:
        poses = undone(convention, matches.names, camtoworlds)
        if np.array_equal(poses, camtoworlds):
            continue
        error_px, count = measure(places, pixtocams, poses)
        fits = TIMES_LESS * error_px < own[0] and count > TIMES_MORE * own[1]
        if fits and count >= max(MIN_MATCHES, MEETING * len(places[0])):
            others[convention] = error_px, count
    return found | dict(sorted(others.items(), key=lambda one: (-one[1][1], one[1][0])))


# A view stands out by so many times the median error, and by so many px of the photo.
TIMES, MIN_PX = 5.0, 3.0
# A focal length this many times longer or shorter than the others' median.
FOCAL_TIMES = 1.5
# Of the photo's size, how far from its middle a principal point may be.
MAX_OFF_CENTRE = 0.45


def of_views(names, errors_px, camtoworlds, least_px=MIN_PX):
    """{view: why it stands out}; errors_px [n]: of each view, in px of the photo."""
    found = {}
    usual_px = np.nanmedian(errors_px) if np.isfinite(errors_px).any() else np.nan
    identity = np.eye(4)[:3]
    for i, name in enumerate(names):
        pose = camtoworlds[i]
        same = np.abs(camtoworlds - pose).reshape(len(names), -1).max(axis=1) == 0
        if np.array_equal(pose, identity) and not same.all() and same.sum() > 1:
            found[name] = f"the identity for a pose, as {same.sum() - 1} others"
        elif same.sum() > 1 and not same.all():
            others = [n for n, is_same in zip(names, same, strict=True) if is_same]
            others.remove(name)
            found[name] = f"the pose of {faults.some_names(others)}"
        elif errors_px[i] > max(TIMES * usual_px, least_px):
            found[name] = f"{errors_px[i]:.1f} px off, the others {usual_px:.1f} px"
    return found


def of_lenses(names, camtopix):
    """{view: why its lens stands out}; camtopix [n, 3, 3] in px of the photo."""
    found, focal = {}, camtopix[:, [0, 1], [0, 1]]
    usual = np.median(focal, axis=0)
    for i, name in enumerate(names):
        times = np.abs(np.log(focal[i] / usual))
        if times.max() > np.log(FOCAL_TIMES):
            axis = int(times.argmax())
            found[name] = (
                f"a focal length of {focal[i, axis]:.0f} px, the others "
                f"{usual[axis]:.0f} px"
            )
    return found


def check_principal_points(camtopix, size, where):
    """ValueError where all principal points are those of other photos, or of none."""
    centres = camtopix[:, :2, 2]
    times = {shots.times_of(centre, size) for centre in centres}
    far = np.abs(centres / np.array(size) - 0.5) > MAX_OFF_CENTRE
    if not far.any(axis=1).all() and (len(times) > 1 or times == {1}):
        return
    cx, cy = middle = np.median(centres, axis=0)
    times = shots.times_of(middle, size)
    scale = f": the numbers are of a photo {times:g} times as large" * (times != 1)
    width, height = map(round, size)
    raise ValueError(
        f"{where}: the principal point ({cx:.0f}, {cy:.0f}) is far from the middle of "
        f"photos of {width}x{height} px{scale}. Scale fl_x, fl_y, cx and cy, or state "
        "the size of their photo (w and h)"
    )
