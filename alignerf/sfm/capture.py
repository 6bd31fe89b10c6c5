"""A capture's input cameras: checked by its matches, adjusted, judged by held-out ones.

Lengths in reports are px of the photo.
"""

import logging
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pycolmap

from alignerf.io import archives, faults
from alignerf.keypoints import refine
from alignerf.scenes import prepare, prepared
from alignerf.sfm import (
    acceptance,
    bundle,
    calibration,
    matches,
    mistakes,
    pose_error,
)
from alignerf.sfm import lens as lens_fit

log = logging.getLogger("alignerf.poses")

# Fewer held-out matches accept nothing.
MIN_MATCHES = 100
# Adjusted cameras that are further off, in px of the matches, are not right either.
MAX_LEFT_PX = 3.0
# Input cameras that are so far off, and cannot be adjusted, are of other photos.
MAX_INPUT_PX = 20.0
# Times that adjusting may change how far apart cameras stand: more has lost its scale.
MAX_SCALE = 3.0
# Of COLMAP's own run: whose lens it has found.
LENSES = ("names", "camtopix", "distortion", "sizes")


class Checked(NamedTuple):
    """What matches say of a capture's cameras.

    given: the input's, in px of the matches. found: the adjusted ones, where they are
    accepted, else None. report: for poses.json.
    """

    matches: matches.Matches
    given: calibration.Cameras
    found: bundle.Adjusted | None
    report: dict

    def cameras_of(self, views) -> calibration.Cameras:
        """The better cameras in px of views, which may be smaller."""
        now = self.found.cameras if self.found else self.given
        ratios = views.width / self.matches.width, views.height / self.matches.height
        return now.scaled(ratios)


def check(views, work, config, *, adjusts, lens, matched=None) -> Checked:
    """`Checked` cameras of the views, which are sorted by name, as large as photos are.

    adjusts: whether to adjust at all; lens: whether the adjusted cameras become the
    scene's, so that they may have a distortion. matched: what is known already of the
    photos' matches. Writes into `work`. Raises ValueError where another convention
    explains the matches than the config's.
    """
    started, where = time.monotonic(), config["path"] or config["source"]
    seed, work = config["seed"], Path(work)
    size = views.width, views.height
    mistakes.check_principal_points(np.linalg.inv(views.pixtocams), size, where)
    if matched is None:
        log.info("%s: matching %d photos", where, len(views.names))
        size_px = config["colmap"]["max_size_px"]
        matched = matches.find(views, work, max_size_px=size_px, seed=seed)
    given = calibration.of_views(views, matched)
    photo_px = views.width / matched.width
    report = {"matches": matched.count(), "pairs": len(matched.pairs)}
    stated = config["pose_convention"]
    report |= check_convention(matched, given, photo_px, where, stated)
    report |= stand_out(matched, given, photo_px, where)
    found, told = None, {"accepted": False, "why": "not asked for"}
    if adjusts:
        options = {"lens": lens, "where": where, "second": config["adjust_again"]}
        found, told = adjust(matched, given, work, seed, photo_px, **options)
        report["lens"] = {
            name: lens_fit.fit(matched, one, photo_px, seed=seed).told()
            for name, one in (("given", given), ("adjusted", found and found.cameras))
            if one
        }
    report["adjustment"] = told
    report["time_s"] = round(time.monotonic() - started, 1)
    return Checked(matched, given, found, report)


def check_convention(matched, given, photo_px, where, stated):
    """The report's part on conventions; ValueError where the input's is a mistake."""
    found = mistakes.find(matched, given.pixtocams, given.camtoworlds)
    own_px, own = found[mistakes.NONE]
    if len(found) > 1 and stated is None:
        name = list(found)[1]
        error_px, count = found[name]
        raise ValueError(
            f"{where}: its cameras have {mistakes.describe(name)}: read that way, "
            f"{count} matches agree to {photo_px * error_px:.2f} px of the photo; read "
            f"as they are, {own} to {photo_px * own_px:.1f} px. To read them that way: "
            f"`pose_convention: {name}` in the config, or --pose-convention {name}; to "
            f"leave them as they are, {mistakes.NONE}"
        )
    return {"epipolar_px": None if np.isinf(own_px) else round(photo_px * own_px, 4)}


def stand_out(matched, given, photo_px, where):
    """The report's part on views: their errors, and those that stand out.

    Views and lenses that do are logged.
    """
    px = photo_px * calibration.errors_of_views(matched, given)
    found = {
        "views": mistakes.of_views(matched.names, px, given.camtoworlds),
        "lenses": mistakes.of_lenses(matched.names, photo_px * given.camtopix),
    }
    for kind, odd in found.items():
        if odd:
            said = [f"{faults.shown(name)}: {why}" for name, why in odd.items()]
            log.warning("%s: %s that stand out: %s", where, kind, "; ".join(said[:5]))
    each = zip(matched.names, px, strict=True)
    known = {name: round(float(e), 3) if np.isfinite(e) else None for name, e in each}
    return {"epipolar_of_views_px": known, "stand_out": found}


def adjust(matched, given, work, seed, photo_px, *, lens, where="", second=True):
    """(`bundle.Adjusted` or None, what the report says of it).

    second: whether they are adjusted a second time, by keypoints evenly over each view.
    """

    def left(why, more=None):
        log.info("cameras stay as they came: %s", why)
        return None, (more or {}) | {"accepted": False, "why": why}

    if len(matched.places(held_out=True)[0]) < MIN_MATCHES:
        return left(f"{matched.count()} matches are too few to judge cameras by")
    try:
        found = fewest(matched, given, work, seed, photo_px, lens=lens)
    except bundle.TooFewError as error:
        return left(str(error))
    judged = acceptance.judge(matched, given, found.cameras, photo_px)
    if not judged.accepted:
        change = f"{judged.before_px:.2f} -> {judged.after_px:.2f} px"
        return left(f"held-out matches {change}: no gain", judged.told())
    if judged.after_px > photo_px * MAX_LEFT_PX:
        why = f"adjusting leaves held-out matches {judged.after_px:.0f} px off"
        if lens and judged.before_px > photo_px * MAX_INPUT_PX:
            raise ValueError(
                f"{where}: its cameras do not fit these photos: held-out matches are "
                f"{judged.before_px:.0f} px off, adjusted {judged.after_px:.0f} px. "
                "Are they of other photos? `poses: input` trains with them anyway"
            )
        return left(why, judged.told())
    extents = [
        np.ptp(one.camtoworlds[:, :, 3], axis=0).max() for one in (given, found.cameras)
    ]
    if not extents[0] / MAX_SCALE < extents[1] < extents[0] * MAX_SCALE:
        return left("the cameras stand too near to one place", judged.told())
    again = {}
    if second:
        options = {"lens": lens, "seed": seed, "photo_px": photo_px}
        now, again = bundle.again(found, matched, given, **options)
        # Matches as they were found have the last word.
        if acceptance.judge(matched, found.cameras, now.cameras, photo_px).worse:
            again = refine.refused(again, "held-out matches lose by it")
        else:
            found = now
            judged = acceptance.judge(matched, given, found.cameras, photo_px)
    told = judged.told() | difference(matched.names, given, found, photo_px)
    told["again"] = again or None
    log.info(
        "poses were off by %.2f px of the photo (worst view %.1f px): corrected. "
        "Held-out matches %.2f -> %.2f px",
        *(told["pose_error_px"], told["worst_px"]),
        *(judged.before_px, judged.after_px),
    )
    told["still_off"] = still_off(matched, found.cameras, photo_px)
    for key, what in (
        ("placed", "placed anew"),
        ("carried", "moved with neighbours"),
        ("still_off", "that are still far off"),
    ):
        if told[key]:
            log.warning("views %s: %s", what, faults.some_names(told[key]))
    return found, told


def fewest(matched, given, work, seed, photo_px, *, lens):
    """`bundle.Adjusted` by the fewest parameters that held-out matches ask for.

    A focal length, and a distortion, are refined where that is more than chance: in
    photos from one side they hide in each other, and in the poses.
    """
    options = {"seed": seed, "images": images_of(work)}
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
    return list(mistakes.of_views(matched.names, px, now.camtoworlds))


def difference(names, given, found, photo_px):
    """The report's part on how far the adjusted cameras are from the input's."""
    points = {
        view: found.points.of_view(view)
        for view in range(len(names))
        if len(found.points.seen[view]) >= bundle.MIN_TRACKS
    }
    px = pose_error.distance_px(given, found.cameras, points)
    off_px = photo_px * np.array(list(px.values()))
    lens = found.cameras.distortion[0]
    ratio = np.median(found.cameras.camtopix[:, 0, 0] / given.camtopix[:, 0, 0])
    return {
        "pose_error_px": round(float(np.median(off_px)), 3),
        "worst_px": round(float(off_px.max()), 3),
        "reprojection_px": round(
            photo_px * float(np.nanmean(found.points.reprojection_px)), 3
        ),
        "focal_ratio": round(float(ratio), 6),
        "distortion": lens.round(6).tolist() if lens.any() else None,
        "placed": [names[i] for i in found.placed],
        "carried": [names[i] for i in found.carried],
    }


def images_of(work):
    """The photos at the size of their matches, for the colours of points, or None."""
    folder = Path(work) / "matched"
    return folder if folder.is_dir() else None


def triangulated(checked: Checked, work, seed):
    """(`bundle.Points`, COLMAP's model) that the input's cameras triangulate."""
    return bundle.triangulate(
        checked.matches,
        checked.given,
        Path(work) / "given",
        seed=seed,
        images=images_of(work),
    )


def points_told(points: bundle.Points, views, matched):
    """The part of poses.json on points, as COLMAP's own poses have it."""
    errors = points.reprojection_px * views.width / matched.width
    return {
        "mean_reprojection_error_px": float(np.nanmean(errors)),
        "points": len(points.positions),
        "points_in_3_views": points.in_3_views,
        "reprojection_errors_px": {
            name: None if np.isnan(px) else round(float(px), 4)
            for name, px in zip(views.names, errors, strict=True)
        },
    }


def matches_of_colmap(work, views: prepare.PosedViews, *, seed) -> matches.Matches:
    """The matches of views, in px of theirs, as COLMAP has left them in `work`.

    Its keypoints are of copies of the photos as taken: the lens that it found is undone
    by the same arithmetic as in the photos.
    """
    lenses = archives.read(Path(work) / prepared.BESIDE / "lenses.npz", LENSES)
    place = {name: i for i, name in enumerate(lenses["names"].tolist())}
    with pycolmap.Database.open(Path(work) / "database.db") as file:
        found = {
            image.name.removesuffix(".png"): image for image in file.read_all_images()
        }
        sizes = {camera.camera_id: camera for camera in file.read_all_cameras()}
    camtopix, to_pixels = np.linalg.inv(views.pixtocams), {}
    for i, name in enumerate(views.names):
        lens = lenses["camtopix"][place[name]]
        # The lens is of the whole photo; keypoints are of a copy.
        copy = sizes[found[name].camera_id]
        whole = lenses["sizes"][place[name]]
        scale = np.array([copy.width, copy.height]) / whole
        of_copy = np.diag([*scale, 1.0]) @ lens
        to_pixels[name] = to_view(
            of_copy, lenses["distortion"][place[name]], camtopix[i]
        )
    ids = {name: found[name].image_id for name in views.names}
    size = views.width, views.height
    return matches.read(
        Path(work) / "database.db", ids, size, seed=seed, to_pixels=to_pixels
    )


def to_view(of_copy, distortion, camtopix):
    """A function: keypoints of a copy -> px of the pinhole view."""
    from_copy = camtopix @ np.linalg.inv(of_copy)

    def move(xy):
        straight = calibration.pinhole_points(xy, of_copy, distortion)
        return straight @ from_copy[:2, :2].T + from_copy[:2, 2]

    return move
