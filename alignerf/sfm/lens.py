"""What one change of all lenses alone explains of matches, the poses held as they are.

A wrong focal length, principal point or distortion, or a rolling shutter, is one error
of all photos, with a number or two. A bundle adjustment hides it in the poses, six
numbers a photo. Where the lens alone takes the matches' error away, poses are right.
"""

from typing import NamedTuple

import numpy as np
from scipy import optimize

from alignerf.scenes import cameras as scene_cameras
from alignerf.sfm import acceptance, calibration
from alignerf.sfm.calibration import Cameras
from alignerf.sfm.matches import HELD_OUT, Matches

# The fit's numbers, in px, and which of them a part of the lens has.
PARTS = {"focal": [0], "distortion": [3], "centre": [1, 2], "shutter": [4]}
NUMBERS = 5
# Matches that a fit of so few numbers needs, and its robust loss in px.
MAX_MATCHES, LOSS_PX = 4000, 0.5
# Views of another zoom are so many times as far off as others, and by its focal length
# so many times less, which differs by more than this in its logarithm, and by less than
# that; matches of each that tell. Not all is gone where a crop has moved the centre.
TIMES_FARTHER, TIMES_LESS, ZOOM, MAX_ZOOM, OF_A_VIEW = 3.0, 5.0, 0.04, 1.5, 300
# A change of a larger fraction of the corner's distance is none of a lens.
MAX_FRACTION = 0.2
# A camera whose picture moves by a larger fraction of its width until the next photo by
# name has no known motion: photos are not in the order of a film.
MAX_MOTION = 0.25
# One whose picture moves by less has none.
MIN_MOTION_PX = 0.1


class Lens(NamedTuple):
    """What was changed, by how much in px of the photo, and what that brought.

    focal_ratio: of right focal lengths over those given. centre_px: how far the
    principal point moves; distortion_px: how far the corner does. shutter_px: how far
    the scene moves while the median photo is read from its first row to the last.
    before_px, after_px: median epipolar error of held-out matches.
    """

    changed: list
    focal_ratio: float
    centre_px: float
    distortion_px: float
    shutter_px: float
    before_px: float
    after_px: float

    def told(self):
        """For a report in JSON."""
        numbers = self._asdict()
        return {"changed": numbers.pop("changed")} | acceptance.rounded(numbers, 5)


def fit(matches: Matches, cameras: Cameras, photo_px=1.0, *, seed=0):
    """(`Lens`, the cameras with it) by the fewest parts that held-out matches ask for.

    One by one. cameras: in px of the matches; photo_px: px of the photo in one of
    these.
    """
    half = np.hypot(matches.width, matches.height) / 2
    some, motions = sample_of(matches, seed), motions_of(matches, cameras)
    chosen, found, best = [], np.zeros(NUMBERS), (matches, cameras)
    while len(chosen) < len(PARTS):
        fits = {}
        for part in [one for one in PARTS if one not in chosen]:
            free = [i for one in (*chosen, part) for i in PARTS[one]]
            fits[part] = solved(some, cameras, motions, free)
        part = min(fits, key=lambda one: fits[one][1])
        numbers = fits[part][0]
        if np.abs(numbers).max() > 0.99 * MAX_FRACTION * half:
            break
        now = changed(matches, cameras, motions, numbers)
        judged = acceptance.judge(best[0], best[1], now[1], photo_px, moved=now[0])
        if not judged.finer:
            break
        chosen, found, best = [*chosen, part], numbers, now
    errors_px = [
        calibration.errors_of_views(*one, held_out=True)
        for one in ((matches, cameras), best)
    ]
    in_px = np.hypot(*found[1:3]), abs(found[3]), abs(found[4])
    in_px += tuple(map(median, errors_px))
    px = [float(photo_px * one) for one in in_px]
    return Lens(chosen, float(np.exp(found[0] / half)), *px), best[1]


def zooms(matches: Matches, cameras: Cameras, photo_px, by_exif=None) -> Cameras:
    """The cameras, views that were taken with another zoom with its focal length.

    by_exif [n]: focal lengths in EXIF, NaN where there is none: where the file has one
    lens and EXIF several, these are tried. Then views whose matches are several times
    as far off as others' get the focal length that brings them near, poses held.
    """
    now, lengths = cameras, cameras.camtopix[:, 0, 0]
    if by_exif is not None and np.isfinite(by_exif).all():
        ratios = by_exif / np.median(by_exif) * np.median(lengths) / lengths
        by_exif = zoomed(cameras, np.where(np.abs(np.log(ratios)) > ZOOM, ratios, 1.0))
        if acceptance.judge(matches, cameras, by_exif, photo_px).accepted:
            now = by_exif
    px = calibration.errors_of_views(matches, now, held_out=False)
    some = px[np.isfinite(px)]
    near_px = max(np.quantile(some, 0.25), LOSS_PX) if len(some) else np.inf
    odd = px > TIMES_FARTHER * near_px
    views, xy = matches.places(held_out=False)
    ratios = np.ones(len(px))
    for view in np.flatnonzero(odd):
        # The other view of a match has to be a sane one.
        own = np.flatnonzero(
            (views == view).any(axis=1) & (odd[views].sum(axis=1) == 1)
        )
        own = own[:: max(1, len(own) // OF_A_VIEW)]
        if len(own) < acceptance.MIN_MATCHES:
            continue

        def error_px(log, view=view, own=own):
            one = zoomed(now, np.where(np.arange(len(px)) == view, np.exp(log), 1.0))
            off = calibration.errors_px(
                views[own], xy[own], one.pixtocams, one.camtoworlds
            )
            return float(np.median(off))

        logs = np.arange(-MAX_ZOOM, MAX_ZOOM, ZOOM)
        best = logs[np.argmin([error_px(log) for log in logs])]
        best = optimize.minimize_scalar(
            error_px, bounds=(best - ZOOM, best + ZOOM), method="bounded"
        )
        if best.fun < error_px(0.0) / TIMES_LESS and abs(best.x) > ZOOM:
            ratios[view] = np.exp(best.x)
    # Photos of one zoom have one focal length.
    order = np.argsort(ratios)
    for group in np.split(
        order, np.flatnonzero(np.diff(np.log(ratios[order])) > ZOOM) + 1
    ):
        if (ratios[group] != 1).all():
            ratios[group] = np.median(ratios[group])
    return zoomed(now, ratios)


def zoomed(cameras: Cameras, ratios) -> Cameras:
    """The cameras with focal lengths so many times [n] as long."""
    lenses = cameras.camtopix.copy()
    lenses[:, [0, 1], [0, 1]] *= ratios[:, None]
    return cameras._replace(camtopix=lenses)


def median(values):
    """Of those that are known; NaN of none."""
    known = values[np.isfinite(values)]
    return np.median(known) if len(known) else np.nan


def sample_of(matches: Matches, seed) -> Matches:
    """Some matches that are not held out, evenly over all pairs."""
    draws, rng = matches.draws, np.random.default_rng(seed)
    share = MAX_MATCHES / max(matches.count(), 1)
    indices = []
    for (i, _), index in zip(matches.pairs, matches.indices, strict=True):
        kept = draws[i][index[:, 0]] >= HELD_OUT
        kept &= rng.random(len(index)) < share
        indices.append(index[kept])
    return matches._replace(indices=indices)


def solved(some: Matches, cameras: Cameras, motions, free):
    """(numbers, cost) of the fit that changes those of indices `free`."""

    def errors(values):
        numbers = np.zeros(NUMBERS)
        numbers[free] = values
        moved_and_now = changed(some, cameras, motions, numbers)
        return calibration.errors_of_matches(*moved_and_now)[1]

    limit = MAX_FRACTION * np.hypot(some.width, some.height) / 2
    fit = optimize.least_squares(
        errors,
        np.zeros(len(free)),
        bounds=(-limit, limit),
        loss="soft_l1",
        f_scale=LOSS_PX,
        max_nfev=40,
    )
    numbers = np.zeros(NUMBERS)
    numbers[free] = fit.x
    return numbers, fit.cost


def changed(matches: Matches, cameras: Cameras, motions, numbers):
    """(matches, cameras) with another lens: numbers in px, see PARTS.

    Those of focal length and distortion are at the corner.
    """
    half = np.hypot(matches.width, matches.height) / 2
    lenses, bends = cameras.camtopix.copy(), cameras.distortion.copy()
    lenses[:, [0, 1], [0, 1]] *= np.exp(numbers[0] / half)
    lenses[:, :2, 2] += numbers[1:3]
    # The corner lies half / focal from the axis, and moves by k1 times its cube.
    bends[:, 0] += numbers[3] / half * (lenses[:, 0, 0] / half) ** 2
    if numbers[4]:
        pairs = zip(matches.keypoints, motions, strict=True)
        moved = [xy + numbers[4] * motion for xy, motion in pairs]
        matches = matches._replace(keypoints=moved)
    return matches, cameras._replace(camtopix=lenses, distortion=bends)


def motions_of(matches: Matches, cameras: Cameras):
    """[k, 2] of each view: where a shutter that skews by a px moves its keypoints.

    The scene moves from each photo to the next by name, rows in the middle excepted. A
    view whose camera has gone far by then tells nothing.
    """
    depths, count = depths_of(matches, cameras), len(matches.names)
    found, lengths = [], np.full(count, np.nan)
    for view, xy in enumerate(matches.keypoints):
        first = min(view, count - 2)
        rays = scene_cameras.pixels_to_rays(
            *(xy.T - 0.5), cameras.pixtocams[view], cameras.camtoworlds[view]
        )
        points = rays.origins + depths[view] * rays.directions
        (before, _), (after, far) = (
            scene_cameras.project(
                points, cameras.pixtocams[other], cameras.camtoworlds[other]
            )
            for other in (first, first + 1)
        )
        motion = np.where((far > 0)[:, None], after - before, 0.0)
        lengths[view] = np.median(np.linalg.norm(motion, axis=-1)) if len(xy) else 0
        known = np.isfinite(depths[view])
        known &= lengths[view] <= MAX_MOTION * matches.width
        row = xy[:, 1:] / matches.height - 0.5
        found.append(row * motion if known else np.zeros_like(xy))
    usual_px = median(lengths)
    usual_px = usual_px if usual_px > MIN_MOTION_PX else np.inf
    return [one / usual_px for one in found]


def depths_of(matches: Matches, cameras: Cameras):
    """[n] median depth of what each view's matches show; NaN of a view without any."""
    views, xy = calibration.undistorted(matches, cameras).places()
    depths, times = calibration.nearest(
        views, xy, cameras.pixtocams, cameras.camtoworlds
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        near = depths / times[:, None]
    found = np.full(len(matches.names), np.nan)
    for view in range(len(found)):
        own = near[views == view]
        own = own[np.isfinite(own) & (own > 0)]
        found[view] = np.median(own) if len(own) else np.nan
    return found
