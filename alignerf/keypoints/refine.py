"""Poses finer than SIFT's keypoints allow: aligned by patches, and adjusted again.

As Lindenberger et al. (Pixel-Perfect Structure-from-Motion, ICCV 2021) with photos in
the place of learnt features. A tenth of the tracks is aligned and has no say in the
adjustment: they judge it.
"""

import logging
import time
from typing import NamedTuple

import numpy as np
import pycolmap

from alignerf.io import faults, machine, progress
from alignerf.keypoints import adjustment, alignment
from alignerf.keypoints.tracks import tracks_of, views_of, warps_of

log = logging.getLogger("alignerf.poses")

# Of the tracks, those that judge; fewer judge nothing, nor do fewer of a view.
HELD_OUT, MIN_HELD_OUT, MIN_OF_VIEW = 0.1, 50, 5
# Of the error, by which one more parameter of the lens has to lessen it.
MIN_FRACTION = 0.05
# Of the views, those that may gain nothing.
MAX_KEPT = 0.5
# By so many px the error of a view may grow, and by so many standard errors.
TOLERATED_PX, SURE = 0.05, 2.0
# Of the cells of a view with keypoints, those that have an aligned one: where fewer
# have, held-out tracks do not tell of the rest.
MIN_COVERED = 0.5
# Pixels of photos that are decoded at a time, in a few copies each.
MAX_DECODED = 50_000_000
# By so much of it a focal length may change, by so much of the width a centre.
MAX_LENS = 0.05
# Of a normal distribution: standard deviations in a median absolute deviation, and the
# standard error of a median in one of a mean.
MAD, OF_MEDIAN = 1.4826, 1.2533


class Judged(NamedTuple):
    """Reprojection error of held-out tracks by view, px: median, and how sure it is."""

    px: dict
    error: dict

    def gain_over(self, before):
        """(median gain over views in px, its standard error) against another.

        A few views that lose do not decide over all: they stay as they were.
        """
        gains = np.array([before.px[v] - self.px[v] for v in self.px if v in before.px])
        if len(gains) < 2:
            return 0.0, np.inf
        gain = np.median(gains)
        spread = MAD * np.median(np.abs(gains - gain))
        return float(gain), float(OF_MEDIAN * spread / np.sqrt(len(gains)))

    def median(self):
        return float(np.median(list(self.px.values()))) if self.px else np.nan


def refine(model, photos, **options):
    """`refined`; where its arithmetic fails, cameras stay as they were."""
    started = time.monotonic()
    try:
        return refined(model, photos, **options)
    except (ValueError, np.linalg.LinAlgError) as error:
        return model, refused({"time_s": seconds(started)}, str(error))


def refused(told, why):
    """What is told where nothing changes, which is logged."""
    said = f"keypoints: cameras stay as they were: {why}"
    log.info("%s", said)
    return told | {"accepted": False, "why": why, "said": said}


def refined(model, photos, *, free, more=(), seed=0, photo_px=1.0):
    """(COLMAP's model with finer cameras and points, what is told of it).

    The model is the given one where nothing is gained. photos: {image id: function that
    reads it, grey [h, w] uint8}, of any size. free: what of the lens is refined, and
    more: what else, one after another, where held-out tracks ask for it; keys of
    `adjustment.FREE`. photo_px: px of the photo in one of the model's, for the report.
    """
    started = time.monotonic()
    numbers = np.array(sorted(model.points3D), int)
    drawn = np.random.default_rng([seed, 3]).random(len(numbers))
    held = numbers[drawn < HELD_OUT]
    told = {"keypoints": model.compute_num_observations()}

    def left(why):
        return model, refused(told | {"time_s": seconds(started)}, why)

    if len(held) < MIN_HELD_OUT:
        return left(f"{len(held)} held-out tracks are too few to judge by")
    views = views_of(model)
    tracks = tracks_of(model, views)
    each = [photos[number] for number in views.ids]
    warps = warps_of(tracks, views)
    found = alignment.align(
        tracks, views, warps, each, threads=threads_of(model, photo_px)
    )
    finer = with_keypoints(model, tracks, views, found)
    if finer.num_points3D() < MIN_HELD_OUT / HELD_OUT:
        return left(f"{finer.num_points3D()} tracks could be aligned")
    with progress.heartbeat("keypoints: bundle adjustment"):
        placed = adjustment.adjust(finer, free, without=held, seed=seed)
        judge = only(finer, held)
        before, after = judged(judge, model), judged(judge, finer)
        if len(after.px) < MAX_KEPT * model.num_reg_images():
            return left(f"{len(after.px)} views have held-out tracks to judge by")
        for one in more:
            further = pycolmap.Reconstruction(finer)
            again = adjustment.adjust(further, one, without=held, seed=seed)
            better = judged(judge, further)
            if asks_for(one, after, better) and is_sane(further, model):
                finer, after, free = further, better, one
                placed += again
    gain, error = after.gain_over(before)
    chosen = found.aligned & ~tracks.is_reference
    told |= {
        "aligned": round(float(found.aligned.mean()), 4),
        "moved_px": moved_px(found.xy - tracks.xy, chosen, photo_px),
        "held_out_px": [photo_px * one.median() for one in (before, after)],
        "views": len(after.px),
        "refined": free,
    }
    told["held_out_px"] = [round(px, 4) for px in told["held_out_px"]]
    if not is_sane(finer, model):
        return left("the lens would change by too much")
    if not gain > SURE * error:
        return left(f"held-out tracks {before.median():.2f} -> {after.median():.2f} px")
    kept = [
        number
        for number in model.reg_image_ids()
        if loses(before, after, number) or is_uncovered(finer, model, number)
    ]
    if len(kept) > MAX_KEPT * model.num_reg_images():
        return left(f"{len(kept)} views gain nothing")
    now = put_together(model, finer, tracks, views, found.xy, kept)
    errors = [m.compute_mean_reprojection_error() for m in (model, now)]
    told |= {
        "accepted": True,
        "reprojection_px": [round(photo_px * px, 4) for px in errors],
        "placed": names_of(model, set(placed) - set(kept)),
        "kept": names_of(model, kept),
        "time_s": seconds(started),
    }
    told["said"] = (
        "keypoints moved by {:.2f} px of the photo, reprojection {:.2f} -> {:.2f} px, "
        "held-out tracks {:.2f} -> {:.2f} px, {:.0f} s"
    ).format(
        *(told["moved_px"], *told["reprojection_px"], *told["held_out_px"]),
        told["time_s"],
    )
    log.info("%s", told["said"])
    for key, what in (("placed", "placed anew"), ("kept", "that stay as they were")):
        if told[key]:
            log.info("keypoints: views %s: %s", what, faults.some_names(told[key]))
    return now, told


def put_together(model, finer, tracks, views, xy, kept):
    """A copy of the model, all of its tracks in it, by the finer cameras.

    xy: of the tracks' keypoints. kept: ids of views that stay as they were.
    """
    now = pycolmap.Reconstruction(model)
    with_xy(now, tracks, views, xy)
    adjustment.take_cameras(now, finer)
    keep(now, model, kept)
    adjustment.settle(now)
    observations = pycolmap.ObservationManager(now)
    observations.filter_all_points3D(adjustment.MAX_ERROR_PX, adjustment.MIN_ANGLE_DEG)
    now.update_point_3d_errors()
    return now


def asks_for(free, before, after):
    """Whether held-out tracks gain enough by one more parameter of the lens.

    A focal length hides in depth where all photos are from one side. A principal point
    is hardly ever in the middle, and bends all else where it is held there: it is left
    there only where held-out tracks lose without.
    """
    gain, error = after.gain_over(before)
    if free == "centre":
        return gain > -error
    return gain > max(MIN_FRACTION * before.median(), SURE * error)


def threads_of(model, photo_px):
    """How many photos are read at a time: as many as memory is meant to hold."""
    largest = max(c.width * c.height for c in model.cameras.values()) * photo_px**2
    return int(np.clip(MAX_DECODED / largest, 1, machine.cores()))


def seconds(started):
    return round(time.monotonic() - started, 1)


def names_of(model, numbers):
    return sorted(model.images[n].name.rpartition(".")[0] for n in numbers)


def moved_px(moved, chosen, photo_px):
    """Median length in px of the photo of the chosen keypoints' moves [o, 2]."""
    lengths = np.linalg.norm(moved[chosen], axis=1)
    return round(photo_px * float(np.median(lengths)), 4) if len(lengths) else 0.0


def with_xy(model, tracks, views, xy):
    """Set the keypoints of a model's tracks, which changes."""
    for view, k, place in zip(tracks.view, tracks.keypoint, xy, strict=True):
        model.images[views.ids[view]].points2D[int(k)].xy = place


def with_keypoints(model, tracks, views, found: alignment.Keypoints):
    """A copy of the model by aligned keypoints alone."""
    model = pycolmap.Reconstruction(model)
    with_xy(model, tracks, views, found.xy)
    for k in np.flatnonzero(~found.aligned):
        number, keypoint = views.ids[tracks.view[k]], int(tracks.keypoint[k])
        if model.images[number].points2D[keypoint].has_point3D():
            model.delete_observation(number, keypoint)
    return model


def only(model, held):
    """A copy of the model with some points alone, evenly over each view."""
    model, held = pycolmap.Reconstruction(model), set(held.tolist())
    for number in list(model.points3D):
        if number not in held:
            model.delete_point3D(number)
    adjustment.thin_out(model, least=4 * MIN_OF_VIEW)
    return model


def judged(held, cameras) -> Judged:
    """The `Judged` error of cameras, by a model of held-out points, which are moved."""
    model = pycolmap.Reconstruction(held)
    adjustment.take_cameras(model, cameras)
    adjustment.settle(model)
    px, error = {}, {}
    for number in model.reg_image_ids():
        off = adjustment.errors_px(model, number)
        if len(off) >= MIN_OF_VIEW:
            px[number] = float(np.median(off))
            error[number] = OF_MEDIAN * float(np.std(off)) / np.sqrt(len(off))
    return Judged(px, error)


def loses(before, after, view):
    """Whether a view is better as it was, or has too little to tell."""
    px, error = after.px.get(view, np.inf), after.error.get(view, 0.0)
    return px - before.px.get(view, -np.inf) > max(TOLERATED_PX, SURE * error)


def is_uncovered(finer, model, view):
    """Whether aligned keypoints cover too little of what keypoints cover."""
    least = MIN_COVERED * adjustment.cells_of(model, view)
    return adjustment.cells_of(finer, view) < least


def is_sane(finer, model):
    """Whether all lenses are nearly what they were."""
    for number, camera in finer.cameras.items():
        own, before = (c.calibration_matrix() for c in (camera, model.cameras[number]))
        ratios = own[[0, 1], [0, 1]] / before[[0, 1], [0, 1]]
        moved = np.abs(own[:2, 2] - before[:2, 2]) / camera.width
        if not max(*np.abs(ratios - 1), *moved) < MAX_LENS:
            return False
    return True


def keep(model, before, views):
    """Put views of the model, which changes, to where they were beside their nearest.

    The frame of an adjusted model is not that of the one before.
    """
    others = [n for n in model.reg_image_ids() if n not in set(views)]
    for view in views:
        old = before.images[view].cam_from_world()
        near = min(
            others,
            key=lambda n: np.linalg.norm(
                before.images[n].projection_center()
                - before.images[view].projection_center()
            ),
        )
        moved = before.images[near].cam_from_world().inverse()
        pose = old * moved * model.images[near].cam_from_world()
        model.images[view].frame.set_cam_from_world(model.images[view].camera_id, pose)
