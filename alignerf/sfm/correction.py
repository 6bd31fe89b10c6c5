"""Input cameras put right: the lens first, then the poses, judged by held-out matches.

A lens of few numbers is asked before six numbers a photo are, since poses hide a wrong
lens. Where neither fits, the poses have nothing to do with the photos, and COLMAP finds
new ones. One rule accepts them all: held-out matches. How far cameras have moved is
reported, and refuses nothing. Lengths in reports are px of the photo.
"""

import functools
import logging
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.io import faults
from alignerf.keypoints import readjustment
from alignerf.scenes import distortion
from alignerf.sfm import acceptance, bundle, calibration, matches, mistakes, pose_error
from alignerf.sfm import lens as lens_fit

log = logging.getLogger("alignerf.poses")

# Fewer held-out matches accept nothing.
MIN_MATCHES = 100
# Of the matches: input cameras that are further off, and cannot be put right, are of
# other photos.
MAX_INPUT_PX = 20.0
# Adjusted cameras that are further off, in px of the matches, are not right either.
MAX_LEFT_PX = 3.0
# From poses so far off an adjustment may end beside the right ones: COLMAP's new ones
# are tried, too.
DOUBTFUL_PX = 10.0
# Of the photo: a view whose matches are further off, and several times as far as the
# others', is not right.
OFF_PX = 1.0
# Of what any correction gains, from which on the lens alone explains it.
MOSTLY = 0.5
# Cameras whose scale changes more often were at places that meant nothing.
MAX_SCALE = 3.0
# Of the photo's width: poses that are further off in the median are of other photos.
MAX_OFF = 0.15
# Of a fault that is named: px of the photo by which poses are off; the share of it by
# which a focal length is, of the half diagonal by which the corner is, of the width by
# which the centre is.
POSES_PX, FOCAL, CORNER, CENTRE = 0.2, 2e-3, 1e-3, 2e-3
# A focal length that changes by a smaller share is the same.
SAME = 1e-5
# Faults of a lens, in the order in which they are named.
LENS = ["zoom", "focal_length", "principal_point", "distortion"]


class Attempt(NamedTuple):
    """Cameras that an adjustment began with, and what came of it.

    found: None where held-out matches do not gain, and why they do not. gain_px: what
    they gain, 0 without it.
    """

    start: calibration.Cameras
    found: bundle.Adjusted | None
    why: str = ""
    gain_px: float = 0.0

    @property
    def cameras(self):
        return self.found.cameras if self.found else self.start


class Search(NamedTuple):
    """What all attempts at a capture's cameras have in common; see `correct`."""

    matched: matches.Matches
    work: Path
    seed: int
    photo_px: float
    lens: bool

    def judge(self, one, other):
        return acceptance.judge(self.matched, one, other, self.photo_px)

    def attempt(self, start) -> Attempt:
        """Cameras adjusted from here, if held-out matches gain by it."""
        try:
            found = self.fewest(start)
        except bundle.TooFewError as error:
            return Attempt(start, None, str(error))
        judged = self.judge(start, found.cameras)
        if judged.accepted:
            return Attempt(start, found, gain_px=judged.gain_px)
        change = f"{judged.before_px:.2f} -> {judged.after_px:.2f} px"
        return Attempt(start, None, f"held-out matches {change}: no gain")

    def fewest(self, start) -> bundle.Adjusted:
        """Cameras adjusted by the fewest parameters that held-out matches ask for.

        A focal length, and a distortion, are refined where that is more than chance: in
        photos from one side they hide in each other, and in the poses.
        """
        adjust = functools.partial(bundle.adjust, self.matched, seed=self.seed)
        best = adjust(start, self.work / "adjust")
        for free in ("focal", *["lens"] * self.lens):
            try:
                more = adjust(best.cameras, self.work / f"adjust_{free}", free=free)
            except bundle.TooFewError:
                break
            if self.judge(best.cameras, more.cameras).finer:
                now, points, moved = bundle.in_frame_of(
                    start, more.cameras, more.points, more.carried
                )
                bundle.move(more.model, moved)
                placed = sorted({*best.placed, *more.placed})
                best = more._replace(cameras=now, points=points, placed=placed)
        return best

    def by_lens_first(self, start, changed, by_lens) -> Attempt:
        """Poses adjusted after the lens, where the lens explains most by itself.

        by_lens: the cameras with the parts of the lens changed that `lens.fit` names.
        """
        plain, alone = self.attempt(start), self.judge(start, by_lens)
        if not (alone.accepted and (self.lens or "distortion" not in changed)):
            return plain
        if alone.gain_px < MOSTLY * plain.gain_px:
            return plain
        other = self.attempt(by_lens)
        # What a lens seems to explain may be a turn of all cameras.
        is_turn = plain.found and self.judge(other.cameras, plain.cameras).finer
        return plain if is_turn else other

    def or_anew(self, best, right, where):
        """(`Attempt`, whether the poses have nothing to do with the photos).

        right: cameras whose middle, extent and lens new ones have. Raises ValueError
        where these fit no better than the best cameras that came, which do not.
        """
        came_px, left_px, *_ = self.judge(best.start, best.cameras)
        is_left = left_px > self.photo_px * MAX_LEFT_PX
        is_doubtful = is_left or came_px > self.photo_px * DOUBTFUL_PX
        if not (is_doubtful or still_off(self.matched, best.cameras, self.photo_px)):
            return best, False
        why = "no others are better"
        try:
            new = bundle.anew(self.matched, right, self.work, seed=self.seed)
            if self.judge(best.cameras, new).accepted:
                return self.attempt(new), True
        except bundle.TooFewError as error:
            why = str(error)
        if not is_left:
            return best, False
        why = f"held-out matches stay {left_px:.0f} px off, and {why}"
        if not self.lens or came_px <= self.photo_px * MAX_INPUT_PX:
            return Attempt(right, None, why), False
        raise ValueError(
            f"{where}: its cameras do not fit these photos: {why}. Are they of other "
            "photos? `poses: input` trains with them anyway"
        )

    def again(self, best):
        """(`Attempt` adjusted a second time where that is no loss, what is told)."""
        found, told = bundle.again(
            best.found,
            self.matched,
            best.start,
            lens=self.lens,
            seed=self.seed,
            photo_px=self.photo_px,
        )
        # Matches as they were found have the last word.
        if self.judge(best.cameras, found.cameras).worse:
            return best, readjustment.refused(told, "held-out matches lose by it")
        return best._replace(found=found), told

    def lens_of(self, cameras):
        """(`lens.Lens` that matches ask for, the cameras with it)."""
        return lens_fit.fit(self.matched, cameras, self.photo_px, seed=self.seed)


def correct(
    matched,
    given,
    work,
    seed,
    photo_px,
    *,
    lens,
    where="",
    second=True,
    convention=mistakes.NONE,
    focal_px=None,
):
    """(`bundle.Adjusted` or None, what the report says of it).

    given: `calibration.Cameras` in px of the matches; photo_px: px of the photo in one
    of these. lens: whether a distortion may be found. second: whether they are adjusted
    a second time, by keypoints evenly over each view. convention: the mistake of the
    file that is undone first. focal_px [n]: focal lengths by EXIF, NaN where there is
    none. Raises ValueError for cameras of other photos.
    """
    search = Search(matched, Path(work), seed, photo_px, lens)
    poses = mistakes.undone(convention, matched.names, given.camtoworlds)
    right = given._replace(camtoworlds=poses)
    if len(matched.places(held_out=True)[0]) < MIN_MATCHES:
        why = f"under {MIN_MATCHES} held-out matches are too few to judge cameras by"
        return None, left(search.judge(given, given), why)
    start = lens_fit.zooms(matched, right, photo_px, focal_px)
    if not search.judge(right, start).accepted:
        start = right
    asked, by_lens = search.lens_of(start)
    lenses, again = {"given": asked.told()}, {}
    best = search.by_lens_first(start, asked.changed, by_lens)
    best, unrelated = search.or_anew(best, right, where)
    if best.found and second:
        best, again = search.again(best)
    if not best.found and best.start is right and convention == mistakes.NONE:
        return None, left(search.judge(given, given), best.why) | {"lens": lenses}
    found = best.found
    if not found:
        folder = search.work / "kept"
        found = bundle.as_they_are(matched, best.start, folder, seed=seed)
    lenses["adjusted"] = search.lens_of(found.cameras)[0].told()
    told = search.judge(given, found.cameras).told() | {"accepted": True}
    told |= {"lens": lenses, "again": again or None}
    moved, off_px = difference(matched.names, right, found, photo_px)
    # Parts of the lens that were free, and stay as they came.
    kept = ["focal"] * (abs(moved["focal_ratio"] - 1) < SAME)
    told["kept"] = kept + ["distortion"] * (lens and not moved["distortion"])
    told |= moved | {"still_off": still_off(matched, found.cameras, photo_px)}
    size = matched.width, matched.height
    unrelated |= not 1 / MAX_SCALE < told["scale"] < MAX_SCALE
    unrelated |= told["pose_error_px"] > photo_px * size[0] * MAX_OFF
    told["faults"] = [
        *of_lens(matched.names, right, found.cameras, size, photo_px),
        *of_poses(off_px, unrelated, convention),
    ]
    say(told)
    return found, told


def left(judged, why):
    """What is told of cameras that stay, which is logged."""
    log.info("cameras stay as they came: %s", why)
    told = {"accepted": False, "why": why, "lens": {}, "faults": []}
    return judged.told() | told


def say(told):
    """Log what is named, and what became of single views."""
    for fault in told["faults"]:
        log.warning("%s", fault["said"])
    held_out = told["before_px"], told["after_px"]
    log.info("cameras are corrected: held-out matches %.2f -> %.2f px", *held_out)
    for key, what in (
        ("placed", "placed anew"),
        ("carried", "moved with neighbors"),
        ("still_off", "that are still far off"),
    ):
        if told[key]:
            log.warning("views %s: %s", what, faults.some_names(told[key]))


def still_off(matched, now, photo_px):
    """Names of the views whose matches are far off by adjusted cameras too."""
    px = photo_px * calibration.errors_of_views(matched, now)
    return list(mistakes.of_views(matched.names, px, now.camtoworlds, OFF_PX))


def difference(names, given, found, photo_px):
    """(the report's part on how far cameras are from the input's, {view: px}).

    Poses are compared by the lens that was found: what is left after the lens.
    """
    points = {
        view: found.points.of_view(view)
        for view in range(len(names))
        if len(found.points.seen[view]) >= bundle.MIN_TRACKS
    }
    now = found.cameras
    same_lens = given._replace(camtopix=now.camtopix, distortion=now.distortion)
    if np.array_equal(given.camtoworlds, now.camtoworlds):
        px = dict.fromkeys(range(len(names)), 0.0)
    else:
        px = pose_error.distance_px(same_lens, now, points)
    off_px = {names[view]: photo_px * each for view, each in px.items()}
    all_px = np.array([*off_px.values()])
    lens, errors_px = now.distortion[0], found.points.reprojection_px
    known_px = photo_px * errors_px[np.isfinite(errors_px)]
    ratio = np.median(now.camtopix[:, 0, 0] / given.camtopix[:, 0, 0])
    apart = [spread(one.camtoworlds[:, :, 3]) for one in (given, now)]
    return {
        "pose_error_px": round(float(np.median(all_px)), 3),
        "worst_px": round(float(all_px.max()), 3),
        "reprojection_px": round(float(known_px.mean()), 3) if len(known_px) else None,
        "focal_ratio": round(float(ratio), 6),
        "distortion": lens.round(6).tolist() if lens.any() else None,
        "scale": round(float(apart[1] / max(apart[0], 1e-300)), 6),
        "placed": [names[i] for i in found.placed],
        "carried": [names[i] for i in found.carried],
    }, off_px


def spread(centres):
    """Median distance of places [n, 3] from their middle, whatever single ones do."""
    return np.median(np.linalg.norm(centres - np.median(centres, axis=0), axis=-1))


def of_lens(names, given, now, size, photo_px):
    """The faults of lenses [{kind, said}], by what they were and what they are.

    Of each group of photos that had one lens and have one.
    """
    pairs = [bundle.groups_of(one, size[0]) for one in (given, now)]
    _, groups = np.unique(np.stack(pairs), axis=1, return_inverse=True)
    found = []
    for group in np.unique(groups):
        own = np.flatnonzero(groups.ravel() == group)
        who = ""
        if len(own) < len(names):
            who = f": {faults.some_names([names[i] for i in own])}"
        was, new = (
            calibration.Cameras(*(array[own] for array in one)) for one in (given, now)
        )
        each = of_one_lens(was, new, size, photo_px, shared=bool(who))
        found += [{"kind": kind, "said": said + who} for kind, said in each]
    return sorted(found, key=lambda one: LENS.index(one["kind"]))


def of_one_lens(given, now, size, photo_px, *, shared):
    """(kind, words) of the faults of one lens; shared: others have other lenses."""
    (fx, fy), (own_x, own_y) = (
        photo_px * np.median(one.camtopix[:, [0, 1], [0, 1]], axis=0)
        for one in (given, now)
    )
    times = given.camtopix[:, 0, 0] / now.camtopix[:, 0, 0]
    x, y = fx / own_x - 1, fy / own_y - 1
    if shared and abs(np.log1p(x)) > bundle.SAME_FOCAL:
        yield (
            "zoom",
            f"another zoom: focal length {own_x:.0f} px of the photo, where the file "
            f"says {fx:.0f}",
        )
    elif abs(x - y) > FOCAL:
        lengths = f"({fx:.1f}, {fy:.1f}) -> ({own_x:.1f}, {own_y:.1f})"
        said = f"the focal lengths of the two axes are wrong: {lengths} px of the photo"
        yield "focal_length", said
    elif abs(x) > FOCAL:
        much = f"{100 * abs(x):.1f} % too {'long' if x > 0 else 'short'}"
        change = f"{fx:.1f} -> {own_x:.1f} px of the photo"
        yield "focal_length", f"the focal length is {much}: {change}"
    elif (most := np.abs(times / np.median(times) - 1).max()) > FOCAL:
        said = f"focal lengths of one lens differ by up to {100 * most:.1f} %"
        yield "focal_length", f"{said}: {own_x:.1f} px of the photo"
    centres = [
        photo_px * np.median(one.camtopix[:, :2, 2], axis=0) for one in (given, now)
    ]
    off_px = np.linalg.norm(centres[1] - centres[0])
    if off_px > photo_px * size[0] * CENTRE:
        was, should = (f"({u:.1f}, {v:.1f})" for u, v in centres)
        said = f"the principal point is off by {off_px:.1f} px: {was} -> {should}"
        yield "principal_point", said
    half = np.hypot(*size) / 2
    if now.distortion.any() and (corner := corner_px(now, half)) > CORNER * half:
        corner = f"{photo_px * corner:.1f} px at the corner"
        yield "distortion", f"the photos have a lens distortion that is left: {corner}"


def corner_px(now, half):
    """By how much the first camera's distortion moves a point so far from its axis."""
    focal = now.camtopix[0, 0, 0]
    lens = np.diag([focal, focal, 1.0])
    there = np.array([[half / focal, 0.0]])
    return abs(distortion.distort_points(there, lens, now.distortion[0])[0, 0] - half)


def of_poses(off_px, unrelated, convention):
    """The faults of poses; off_px {view: px that its pose is off, after the lens}."""
    found = []
    if convention != mistakes.NONE:
        said = f"the file has {mistakes.describe(convention)}: undone ({convention})"
        found.append({"kind": "convention", "said": said})
    if unrelated:
        said = "the poses have nothing to do with the photos: new ones are computed"
        return [*found, {"kind": "unrelated", "said": said}]
    usual_px = float(np.median([*off_px.values()]))
    least_px = max(mistakes.TIMES * usual_px, mistakes.MIN_PX)
    if odd := {name: px for name, px in off_px.items() if px > least_px}:
        worst = sorted(odd, key=odd.get, reverse=True)
        each = faults.some_names([f"{name} ({odd[name]:.0f} px)" for name in worst])
        count = f"{len(odd)} photo{'s' * (len(odd) > 1)}"
        said = f"wrong poses of {count}, the others {usual_px:.1f} px: {each}"
        found.append({"kind": "views", "said": said})
    if usual_px > POSES_PX:
        worst_px = max(px for name, px in off_px.items() if name not in odd)
        said = f"poses are off by {usual_px:.2f} px of the photo (worst {worst_px:.1f})"
        found.append({"kind": "poses", "said": said})
    return found
