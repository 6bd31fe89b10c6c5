"""Input cameras put right: the lens first, then the poses, judged by held-out matches.

A lens of few numbers is asked before six numbers a photo are, since poses hide a wrong
lens. Where neither fits, the poses have nothing to do with the photos, and COLMAP finds
new ones. One rule accepts them all: held-out matches. How far cameras have moved is
reported, and refuses nothing. Lengths in reports are px of the photo.
"""

import logging
from pathlib import Path

import numpy as np

from alignerf.io import faults
from alignerf.keypoints import refine
from alignerf.scenes import distortion
from alignerf.sfm import acceptance, bundle, calibration, mistakes, pose_error
from alignerf.sfm import lens as lens_fit

log = logging.getLogger("alignerf.poses")

# Fewer held-out matches accept nothing.
MIN_MATCHES = 100
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
# A scale of the cameras that changes more often has had no meaning.
MAX_SCALE = 3.0
# Of a fault that is named: px of the photo by which poses are off; the share of it by
# which a focal length is, of the half diagonal by which the corner is, of the width by
# which the centre is.
POSES_PX, FOCAL, CORNER, CENTRE = 0.2, 2e-3, 1e-3, 2e-3


def correct(
    matched, given, work, seed, photo_px, *, lens, where="", second=True, **more
):
    """(`bundle.Adjusted` or None, what the report says of it).

    given: `calibration.Cameras` in px of the matches; photo_px: px of the photo in one
    of these. lens: whether a distortion may be found. second: whether they are adjusted
    a second time, by keypoints evenly over each view. more: convention, the mistake of
    the file that is undone first; focal_px [n], focal lengths by EXIF, NaN where there
    is none. Raises ValueError for cameras of other photos.
    """
    convention, focal_px = more.get("convention"), more.get("focal_px")

    def judge(one, other):
        return acceptance.judge(matched, one, other, photo_px)

    def adjusted(start):
        """(the best adjustment, None), or (None, why there is none)."""
        try:
            found = fewest(matched, start, work, seed, photo_px, lens=lens)
        except bundle.TooFewError as error:
            return None, str(error)
        judged = judge(start, found.cameras)
        change = f"{judged.before_px:.2f} -> {judged.after_px:.2f} px"
        why = f"held-out matches {change}: no gain"
        return (found, None) if judged.accepted else (None, why)

    def left(why, lenses=None):
        log.info("cameras stay as they came: %s", why)
        told = judge(given, given).told()
        told |= {"accepted": False, "why": why, "faults": [], "lens": lenses or {}}
        return None, told

    if len(matched.places(held_out=True)[0]) < MIN_MATCHES:
        return left(f"{matched.count()} matches are too few to judge cameras by")
    poses = mistakes.undone(
        convention or mistakes.NONE, matched.names, given.camtoworlds
    )
    start = right = given._replace(camtoworlds=poses) if convention else given
    zoomed = lens_fit.zooms(matched, start, photo_px, focal_px)
    if judge(start, zoomed).accepted:
        start = zoomed
    told_lens, by_lens = lens_fit.fit(matched, start, photo_px, seed=seed)
    lenses = {"given": told_lens.told()}
    found, why = adjusted(start)
    alone, by_poses = judge(start, by_lens), found
    if (lens or "distortion" not in told_lens.changed) and alone.accepted:
        most = judge(start, found.cameras).gain_px if found else 0.0
        if alone.gain_px >= MOSTLY * most:
            found, left_by_lens = adjusted(by_lens)
            now = found.cameras if found else by_lens
            # What a lens seems to explain may be a turn of all cameras.
            if by_poses and judge(now, by_poses.cameras).finer:
                found = by_poses
            else:
                start, why = by_lens, left_by_lens
    now, unrelated = found.cameras if found else start, False
    came_px, off_px = judge(start, now)[:2]
    is_doubtful = came_px > photo_px * DOUBTFUL_PX or off_px > photo_px * MAX_LEFT_PX
    if is_doubtful or still_off(matched, now, photo_px):
        try:
            new = bundle.anew(matched, right, work, seed=seed)
            if judge(now, new).accepted:
                start, unrelated = new, True
                found, why = adjusted(start)
            elif off_px > photo_px * MAX_LEFT_PX:
                raise bundle.TooFewError("no others are better")
        except bundle.TooFewError as error:
            if off_px > photo_px * MAX_LEFT_PX:
                why = f"held-out matches stay {off_px:.0f} px off, and {error}"
                if lens:
                    raise ValueError(
                        f"{where}: its cameras do not fit these photos: {why}. Are "
                        "they of other photos? `poses: input` trains with them anyway"
                    ) from None
                return left(why, lenses)
    again = {}
    if found and second:
        options = {"lens": lens, "seed": seed, "photo_px": photo_px}
        finer, again = bundle.again(found, matched, start, **options)
        # Matches as they were found have the last word.
        if judge(found.cameras, finer.cameras).worse:
            again = refine.refused(again, "held-out matches lose by it")
        else:
            found = finer
    if not found:
        if start is given:
            return left(why, lenses)
        found = bundle.as_they_are(matched, start, Path(work) / "kept", seed=seed)
    lenses["adjusted"] = lens_fit.fit(matched, found.cameras, photo_px, seed=seed)[
        0
    ].told()
    told = judge(given, found.cameras).told() | {"accepted": True, "lens": lenses}
    told["again"] = again or None
    more, off_px = difference(matched.names, right, found, photo_px)
    told |= more
    told["still_off"] = still_off(matched, found.cameras, photo_px)
    size = matched.width, matched.height
    told["faults"] = [
        *of_lens(matched.names, right, found.cameras, size, photo_px),
        *of_poses(off_px, unrelated, convention),
    ]
    say(told)
    return found, told


def say(told):
    """Log what is named, and what became of single views."""
    for fault in told["faults"]:
        log.warning("%s", fault["said"])
    held_out = told["before_px"], told["after_px"]
    log.info("cameras are corrected: held-out matches %.2f -> %.2f px", *held_out)
    if not 1 / MAX_SCALE < told["scale"] < MAX_SCALE:
        log.warning(
            "cameras stand %.3g times as far apart: lengths in the file meant nothing",
            told["scale"],
        )
    for key, what in (
        ("placed", "placed anew"),
        ("carried", "moved with neighbours"),
        ("still_off", "that are still far off"),
    ):
        if told[key]:
            log.warning("views %s: %s", what, faults.some_names(told[key]))


def fewest(matched, given, work, seed, photo_px, *, lens):
    """`bundle.Adjusted` by the fewest parameters that held-out matches ask for.

    A focal length, and a distortion, are refined where that is more than chance: in
    photos from one side they hide in each other, and in the poses.
    """
    options = {"seed": seed, "images": bundle.images_of(work)}
    best = bundle.adjust(matched, given, Path(work) / "adjust", **options)
    for free in ("focal", *["lens"] * lens):
        folder = Path(work) / f"adjust_{free}"
        try:
            more = bundle.adjust(matched, best.cameras, folder, free=free, **options)
        except bundle.TooFewError:
            break
        if acceptance.judge(matched, best.cameras, more.cameras, photo_px).finer:
            now, points, moved = bundle.in_frame_of(
                given, more.cameras, more.points, more.carried
            )
            bundle.move(more.model, moved)
            placed = sorted({*best.placed, *more.placed})
            best = more._replace(cameras=now, points=points, placed=placed)
    return best


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
    px = pose_error.distance_px(same_lens, now, points)
    off_px = {names[view]: photo_px * each for view, each in px.items()}
    all_px = np.array([*off_px.values()])
    lens = now.distortion[0]
    ratio = np.median(now.camtopix[:, 0, 0] / given.camtopix[:, 0, 0])
    apart = [np.ptp(one.camtoworlds[:, :, 3], axis=0).max() for one in (given, now)]
    return {
        "pose_error_px": round(float(np.median(all_px)), 3),
        "worst_px": round(float(all_px.max()), 3),
        "reprojection_px": round(
            photo_px * float(np.nanmean(found.points.reprojection_px)), 3
        ),
        "focal_ratio": round(float(ratio), 6),
        "distortion": lens.round(6).tolist() if lens.any() else None,
        "scale": round(float(apart[1] / max(apart[0], 1e-300)), 6),
        "placed": [names[i] for i in found.placed],
        "carried": [names[i] for i in found.carried],
    }, off_px


def of_lens(names, given, now, size, photo_px):
    """The faults of a lens [{kind, said}], by what it was and what it is."""
    found, half = [], np.hypot(*size) / 2
    before, after = (photo_px * one.camtopix[:, 0, 0] for one in (given, now))
    ratios = now.camtopix[:, 0, 0] / given.camtopix[:, 0, 0]
    usual = np.median(ratios)
    other = np.abs(np.log(ratios / usual)) > bundle.SAME_FOCAL
    for length in np.unique(after[other].round()):
        own = other & (after.round() == length)
        few = faults.some_names([names[i] for i in np.flatnonzero(own)])
        said = (
            f"another zoom: focal length {length:.0f} px of the photo, where the file "
            f"says {np.median(before[own]):.0f}: {few}"
        )
        found.append({"kind": "zoom", "said": said})
    if abs(usual - 1) > FOCAL:
        length = "long" if usual < 1 else "short"
        said = (
            f"the focal length is {100 * abs(1 / usual - 1):.1f} % too {length}: "
            f"{np.median(before):.1f} -> {np.median(after):.1f} px of the photo"
        )
        found.append({"kind": "focal_length", "said": said})
    centres = [
        photo_px * np.median(one.camtopix[:, :2, 2], axis=0) for one in (given, now)
    ]
    off_px = np.linalg.norm(centres[1] - centres[0])
    if off_px > photo_px * size[0] * CENTRE:
        was, should = (f"({x:.1f}, {y:.1f})" for x, y in centres)
        said = f"the principal point is off by {off_px:.1f} px: {was} -> {should}"
        found.append({"kind": "principal_point", "said": said})
    if now.distortion.any() and (corner := corner_px(now, half)) > CORNER * half:
        corner = f"{photo_px * corner:.1f} px at the corner"
        said = f"a lens distortion is not in the file: {corner}"
        found.append({"kind": "distortion", "said": said})
    return found


def corner_px(now, half):
    """By how much the first camera's distortion moves a point so far from its axis."""
    focal = now.camtopix[0, 0, 0]
    lens = np.diag([focal, focal, 1.0])
    there = np.array([[half / focal, 0.0]])
    return abs(distortion.distort_points(there, lens, now.distortion[0])[0, 0] - half)


def of_poses(off_px, unrelated, convention):
    """The faults of poses; off_px {view: px that its pose is off, after the lens}."""
    found = []
    if convention:
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
        said = f"wrong poses of {len(odd)} photos, the others {usual_px:.1f} px: {each}"
        found.append({"kind": "views", "said": said})
    if usual_px > POSES_PX:
        worst_px = max(px for name, px in off_px.items() if name not in odd)
        said = f"poses are off by {usual_px:.2f} px of the photo (worst {worst_px:.1f})"
        found.append({"kind": "poses", "said": said})
    return found
