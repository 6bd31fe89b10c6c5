"""COLMAP's cameras adjusted again, by keypoints evenly over each view.

Its own adjustment has a wide loss and every keypoint: what moves, and is full of
features, bends cameras. On eight captures with true cameras the second one left 0.05 to
0.45 of the error, or 0.95 (docs/measured/finer_poses.csv).

A tenth of the tracks has no say, and judges by its loss, pair by pair. SIFT's noise
hides most of what is gained from it: a parameter of the lens has to show, but cameras
are refused only where they surely lose.
"""

import logging
import time

import numpy as np
import pycolmap

from alignerf.io import faults, progress
from alignerf.keypoints import adjustment

log = logging.getLogger("alignerf.poses")

# Of the tracks, those that judge, fewer judge nothing; and how many a view keeps.
HELD_OUT, MIN_HELD_OUT, MIN_OF_VIEW = 0.1, 50, 20
# Standard errors by which tracks have to gain by a parameter, and may not lose by all.
SURE, LOSING = 2.0, 3.0
# By so much of it a focal length may change, by so much of the width a centre.
MAX_LENS = 0.05
# Loss in px of COLMAP's adjustment, and the most that a keypoint counts as off.
COLMAP_PX, FAR_PX = 1.0, 10.0


def refine(model, **options):
    """`refined`; where its arithmetic fails, cameras stay as they were."""
    started = time.monotonic()
    try:
        return refined(model, **options)
    except (ValueError, np.linalg.LinAlgError) as error:
        return model, refused({"time_s": seconds(started)}, str(error))


def refused(told, why):
    """What is told where nothing changes, which is logged."""
    said = f"cameras stay as they were: {why}"
    log.info("second adjustment: %s", said)
    return told | {"accepted": False, "why": why, "said": said}


def refined(model, *, free, more=(), seed=0, photo_px=1.0):
    """(COLMAP's model with finer cameras and points, what is told of it).

    The model is the given one where held-out tracks lose. free: what of the lens is
    refined, and more: what else, one after another, where they gain by it; keys of
    `adjustment.FREE`. photo_px: px of the photo in one of the model's, for the report.
    """
    started = time.monotonic()
    numbers = np.array(sorted(model.points3D), int)
    drawn = np.random.default_rng([seed, 3]).random(len(numbers))
    held = numbers[drawn < HELD_OUT]
    told = {"tracks": len(numbers)}

    def left(why):
        return model, refused(told | {"time_s": seconds(started)}, why)

    if len(held) < MIN_HELD_OUT:
        return left(f"{len(held)} held-out tracks are too few to judge by")
    judge = without(model, set(numbers) - set(held))
    # What moves may have most of the tracks: over all, they count evenly.
    even = pycolmap.Reconstruction(judge)
    adjustment.thin_out(even, least=MIN_OF_VIEW)
    finer = pycolmap.Reconstruction(model)
    with progress.heartbeat("second bundle adjustment"):
        placed = adjustment.adjust(finer, free, without=held, seed=seed)
        known = losses(judge, finer)
        for one in more:
            further = pycolmap.Reconstruction(finer)
            again = adjustment.adjust(further, one, without=held, seed=seed)
            better = losses(judge, further)
            if asks_for(known, better) and is_sane(further, model):
                finer, known, free = further, better, one
                placed += again
        own = as_colmap(model, free, held)
        gain, error = gain_over(losses(even, own), losses(even, finer))
    if not np.isfinite(error):
        return left("held-out tracks cannot be compared")
    told |= {"refined": free, "gain": [round(gain, 5), round(error, 5)]}
    if not is_sane(finer, model):
        return left("the lens would change by too much")
    if gain < -LOSING * error:
        return left(f"held-out tracks lose, {LOSING:.0f} standard errors and more")
    now = put_together(model, finer)
    before_px, after_px = (photo_px * median_px(one) for one in (model, now))
    told |= {
        "accepted": True,
        "reprojection_px": [round(before_px, 4), round(after_px, 4)],
        "placed": sorted(model.images[n].name.rpartition(".")[0] for n in set(placed)),
        "time_s": seconds(started),
    }
    told["said"] = (
        f"median reprojection {before_px:.2f} -> {after_px:.2f} px of the photo, "
        f"{told['time_s']:.0f} s"
    )
    log.info("second adjustment: %s", told["said"])
    if told["placed"]:
        log.info("views placed anew: %s", faults.some_names(told["placed"]))
    return now, told


def median_px(model):
    """Of the points' mean errors: what moves has large ones by right cameras."""
    return float(np.median([point.error for point in model.points3D.values()]))


def as_colmap(model, free, held):
    """The cameras of COLMAP's adjustment had it not seen the held-out tracks.

    Its own have, and are nearer to these than any that have not.
    """
    found = without(model, held)
    adjustment.run(found, adjustment.options_of(free, COLMAP_PX, "TRIVIAL"))
    return found


def without(model, points):
    """A copy of the model without some points."""
    model = pycolmap.Reconstruction(model)
    for number in points:
        model.delete_point3D(int(number))
    return model


def losses(judge, cameras):
    """{id: mean Cauchy loss of its keypoints} of the points of a model, moved to the
    cameras of another.
    """
    model, found = pycolmap.Reconstruction(judge), {}
    adjustment.take_cameras(model, cameras)
    adjustment.settle(model)
    for number in model.reg_image_ids():
        seen = [one for one in model.images[number].points2D if one.has_point3D()]
        off = np.minimum(adjustment.errors_px(model, number), FAR_PX)
        for one, loss in zip(
            seen, np.log1p((off / adjustment.CAUCHY_PX) ** 2), strict=True
        ):
            found.setdefault(one.point3D_id, []).append(loss)
    return {number: float(np.mean(each)) for number, each in found.items()}


def gain_over(before, after):
    """(mean gain of the tracks, its standard error)."""
    gains = np.array([before[one] - after[one] for one in before if one in after])
    if len(gains) < 2:
        return 0.0, np.inf
    return float(gains.mean()), float(gains.std(ddof=1) / np.sqrt(len(gains)))


def asks_for(before, after):
    """Whether held-out tracks gain by one more parameter of the lens: by more than
    chance, and in both halves of them.
    """
    gain, error = gain_over(before, after)
    halves = [dict(sorted(before.items())[half::2]) for half in (0, 1)]
    return gain > SURE * error and all(gain_over(h, after)[0] > 0 for h in halves)


def put_together(model, finer):
    """A copy of the model, all of its tracks in it, by the finer cameras."""
    now = pycolmap.Reconstruction(model)
    adjustment.take_cameras(now, finer)
    adjustment.settle(now)
    observations = pycolmap.ObservationManager(now)
    observations.filter_all_points3D(adjustment.MAX_ERROR_PX, adjustment.MIN_ANGLE_DEG)
    now.update_point_3d_errors()
    return now


def seconds(started):
    return round(time.monotonic() - started, 1)


def is_sane(finer, model):
    """Whether all lenses are nearly what they were."""
    for number, camera in finer.cameras.items():
        own, before = (c.calibration_matrix() for c in (camera, model.cameras[number]))
        ratios = own[[0, 1], [0, 1]] / before[[0, 1], [0, 1]]
        moved = np.abs(own[:2, 2] - before[:2, 2]) / camera.width
        if not max(*np.abs(ratios - 1), *moved) < MAX_LENS:
            return False
    return True
