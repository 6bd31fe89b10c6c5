"""Views and lenses of input cameras that stand out, named before any training."""

import numpy as np

from alignerf.files import faults

# A view stands out by so many times the median error, and by so many px of the photo.
TIMES, MIN_PX = 5.0, 3.0
# A focal length this many times longer or shorter than the others' median.
FOCAL_TIMES = 1.5
# Of the photo's size, how far from its middle a principal point may be.
MAX_OFF_CENTRE = 0.45
# Numbers of a photo this many times as large are recognised.
MULTIPLES = (2, 4, 8)
# So near to half of such a photo lies its principal point.
NEAR = 0.15


def of_views(names, errors_px, camtoworlds):
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
        elif errors_px[i] > max(TIMES * usual_px, MIN_PX):
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
    """ValueError where no view's principal point lies within the photo."""
    centres = camtopix[:, :2, 2] / np.array(size)
    if not (np.abs(centres - 0.5) > MAX_OFF_CENTRE).any(axis=1).all():
        return
    middle = np.median(centres, axis=0)
    times = [k for k in MULTIPLES if np.abs(middle / k - 0.5).max() < NEAR]
    scale = f": the numbers are of a photo {times[0]} times as large" if times else ""
    cx, cy = np.median(camtopix[:, :2, 2], axis=0)
    width, height = map(round, size)
    raise ValueError(
        f"{where}: the principal point ({cx:.0f}, {cy:.0f}) is far from the middle of "
        f"photos of {width}x{height} px{scale}. Scale fl_x, fl_y, cx and cy, or state "
        "the size of their photo (w and h)"
    )
