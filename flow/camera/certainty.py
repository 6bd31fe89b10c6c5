"""How far off a camera may be that was fitted to a photo: a standard error in px.

An estimator of flow fills in what a flat photo does not show, so that the flow's own
residual says nothing of it. The error is that of the photo: of its grey levels between
two blurs, against those of the render. Notation as in `fit`.
"""

import cv2
import numpy as np

from flow.camera import fit as camera_fit
from flow.camera import motion as camera_motion

# Standard deviations of the blurs: noise is finer, and wrong brightness coarser.
FINE_PX, COARSE_PX = 1.0, 4.0
# Errors of patches, so many along the smaller side, do not depend on each other; those
# of pixels next to each other do.
PATCHES = 4
# What differs by more than so many standard deviations, and by more than levels are
# rounded by, hardly counts: something that the render lacks.
OUTLIER_SIGMAS, ROUNDED = 2.0, 0.3
# Of the mean curvature: keeps motions apart that look alike.
RIDGE = 1e-4


def error_px(render, photo, motion, points, fitted, scored):
    """Standard error of a motion in px, root mean square over the pixels `scored`.

    render, photo [h, w, 3] uint8; points: of all pixels; fitted, scored [h, w]: pixels
    whose flow the motion was fitted to, and others. The lens is known. NaN where
    the fitted pixels show nothing.

    It adds up two things. The first is a jackknife over patches of the step by which
    the photo would move the camera further (Gauss-Newton). The Hessian is J^T J with
    one slope of the render and one of the photo: noise, which they do not share, is no
    texture. The second is that step: where there is little texture, an estimator
    shortens a motion.
    """
    own, other = (_band(image) for image in (render, photo))
    y, x = np.indices(own.shape)
    place = np.stack([x, y], axis=-1) + camera_motion.flow(motion, points)
    place = place.astype(np.float32)
    border = {"borderMode": cv2.BORDER_REPLICATE}
    other = cv2.remap(other, place, None, cv2.INTER_CUBIC, **border)
    left = (other - own)[fitted]
    if len(left) < camera_fit.MIN_PIXELS:
        return np.nan
    width = OUTLIER_SIGMAS * 1.4826 * np.median(np.abs(left)) + ROUNDED
    weight = 1 / (1 + (left / width) ** 2) ** 2
    unit = camera_fit.units(_of(points, fitted))[:6]
    by = camera_motion.jacobian(motion, _of(points, fitted))[..., :6] * unit
    slopes = (np.stack(np.gradient(one)[::-1], axis=-1) for one in (own, other))
    own, other = (np.einsum("ni,nij->nj", one[fitted], by) for one in slopes)
    own *= weight[:, None]
    side = max(1, min(fitted.shape) // PATCHES)
    patch = (y // side * fitted.shape[1] + x // side)[fitted]
    patches = [patch == number for number in np.unique(patch)]
    hessians = np.stack([own[one].T @ other[one] for one in patches])
    asked = np.stack([-own[one].T @ left[one] for one in patches])
    mean = abs(np.trace(hessians.sum(axis=0))) / 6
    if len(patches) < 2 or mean == 0:
        return np.nan
    # A step has no effect where all is infinitely far. Without any patch, too.
    hessians += np.diag(np.where(unit > 0, RIDGE * mean, mean)) / len(patches)
    whole, step = hessians.sum(axis=0), asked.sum(axis=0)
    further = np.linalg.solve(whole, step)
    without = np.linalg.solve(whole - hessians, (step - asked)[..., None])[..., 0]
    spread = (without - further) * np.sqrt(1 - 1 / len(patches))
    some = camera_fit.sample_of(scored, camera_fit.MAX_PIXELS)
    by = camera_motion.jacobian(motion, _of(points, some))[..., :6] * unit
    steps = np.concatenate([spread, further[None]])
    return float(np.sqrt(((by @ steps.T) ** 2).sum(axis=(1, 2)).mean()))


def _band(image):
    """[h, w] grey levels between the two blurs."""
    grey = image.mean(axis=-1, dtype=np.float32)
    fine, coarse = (cv2.GaussianBlur(grey, (0, 0), s) for s in (FINE_PX, COARSE_PX))
    return fine - coarse


def _of(points, chosen):
    return points._replace(rays=points.rays[chosen], rho=points.rho[chosen])
