"""A capture's input cameras: checked by its matches, adjusted, judged by held-out ones.

Lengths in reports are px of the photo.
"""

import logging
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pycolmap

from alignerf.colmap import loading
from alignerf.io import archives, faults
from alignerf.scenes import photos, prepare, prepared
from alignerf.sfm import (
    bundle,
    calibration,
    correction,
    matches,
    mistakes,
)

log = logging.getLogger("alignerf.poses")

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
    started, where = time.monotonic(), config.path or config.source
    seed, work = config.seed, Path(work)
    size = views.width, views.height
    mistakes.check_principal_points(np.linalg.inv(views.pixtocams), size, where)
    if matched is None:
        log.info("%s: matching %d photos", where, len(views.names))
        size_px = config.colmap.max_size_px
        matched = matches.find(views, work, max_size_px=size_px, seed=seed)
    given = calibration.of_views(views, matched)
    photo_px = views.width / matched.width
    report = {"matches": matched.count(), "pairs": len(matched.pairs)}
    epipolar_px, convention = convention_of(matched, given, photo_px, config)
    if convention != mistakes.NONE and not (adjusts and lens):
        raise ValueError(
            f"{where}: its cameras have {mistakes.describe(convention)}. To read them "
            f"that way: `pose_convention: {convention}` in the config, or "
            f"--pose-convention {convention}; to leave them as they are, "
            f"{mistakes.NONE}"
        )
    report["epipolar_px"] = epipolar_px
    report |= stand_out(matched, given, photo_px, where)
    found, told = None, {"accepted": False, "why": "not asked for"}
    if adjusts:
        options = {"lens": lens, "where": where, "second": config.adjust_again}
        options |= {"convention": convention, "focal_px": focal_px(views)}
        found, told = correction.correct(
            matched, given, work, seed, photo_px, **options
        )
        report["lens"] = told.pop("lens")
        report["faults"] = told.pop("faults")
    report["adjustment"] = told
    report["time_s"] = round(time.monotonic() - started, 1)
    return Checked(matched, given, found, report)


def convention_of(matched, given, photo_px, config):
    """(median epipolar error in px of the photo or None, the mistake of the file).

    It is NONE where the config says how poses are meant.
    """
    found = mistakes.find(matched, given.pixtocams, given.camtoworlds)
    own_px, names = found[mistakes.NONE][0], list(found)[1:]
    px = None if np.isinf(own_px) else round(photo_px * own_px, 4)
    stated = config.pose_convention is not None
    return px, mistakes.NONE if stated or not names else names[0]


def focal_px(views):
    """[n] focal lengths of the views' photos by EXIF; NaN where it says none."""
    paths = [photo.path for photo in views.photos]
    return np.array([photos.head(p).focal_px if p else np.nan for p in paths])


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


def triangulated(checked: Checked, work, seed):
    """(`bundle.Points`, COLMAP's model) that the input's cameras triangulate."""
    folder = Path(work) / "given"
    return bundle.triangulate(checked.matches, checked.given, folder, seed=seed)


def points_told(points: bundle.Points, views, matched):
    """The part of poses.json on points, as COLMAP's own poses have it."""
    errors = points.reprojection_px * views.width / matched.width
    known = errors[np.isfinite(errors)]
    mean_px = float(known.mean()) if len(known) else None
    return loading.told_of_points(views.names, len(points.positions), mean_px, errors)


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
