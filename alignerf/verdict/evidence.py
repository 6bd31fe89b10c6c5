"""The numbers of a verdict, after the first round of a scene's reference.

Reads the outputs of the stages: photos, renders, flow and its parts, trainings, poses.
"""

import math
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.cameras import common_flow, exposure, spacing, transients
from alignerf.causes import base as causes
from alignerf.causes import blur, motion
from alignerf.io import csv_files, json_files, machine, provenance
from alignerf.metrics import copies, image, pairs, spectrum, tone
from alignerf.scenes import prepared
from alignerf.sfm.lens import Lens
from alignerf.tables import intervals
from alignerf.verdict import seen, views

# What it takes from a poses.json, and from a timing.json.
NUMBER, OrNone = json_files.NUMBER, json_files.OrNone
JUDGED = dict.fromkeys(("depth", "cameras", "layout"), OrNone(str))
JUDGED |= {"trained_px": OrNone(json_files.positive)}
LENS = dict.fromkeys(Lens._fields, json_files.NUMBER_OR_NONE) | {"changed": [str]}
LENSES = {"lens": OrNone(dict.fromkeys(("given", "adjusted"), OrNone(LENS)))}
LENSES |= {"faults": OrNone([{"kind": str, "said": str}])}
POSES = prepared.POSES | {
    "poses": str,
    "perturb_px": NUMBER,
    "camera_check": OrNone(prepared.CHECKED | LENSES),
    "external_renders": OrNone(JUDGED),
}
LENGTHS = ("flow_train_px", "flow_test_px")
BEFORE = dict.fromkeys(LENGTHS, OrNone(NUMBER)) | {"photo_px": NUMBER}
BEFORE |= {"photo_width_px": OrNone(json_files.positive)}
# Of held-out views: how many of which width, and means over them; LPIPS with weights.
SCORED = ("views", "width_px", "psnr_db", "sharpness", "ssim")
SCORES = dict.fromkeys((str, *SCORED), json_files.NUMBER_OR_NONE)
BEFORE |= {"judged": OrNone({"scores": OrNone(SCORES)})}
TIMING = {"rays_seen": json_files.NUMBER_OR_NONE}
# Poses that came with the photos, as poses.json has them.
INPUT = ("input", "adjusted")
# Flows of so many training views tell what all have in common.
MAX_PATTERN_VIEWS = 32
DRAWS = 2000
# Of fewer views one that is rendered badly is most of a spread.
MIN_SPREAD_VIEWS = 4
# Of a view's pixels: so many are hidden by what hangs before its camera.
HIDDEN = 0.01


def read_views(loaded: prepared.Scene, base, look, metrics):
    """A `seen.Seen` of each view whose render and flow are there.

    base: the reference's round 0. look: `pairs.look` with its options. metrics: of
    held-out views, as of `seen.of_view`.
    """
    found = []
    for split in prepared.SPLITS:
        if (base / "renders" / split).is_dir():
            asked = metrics if split == "test" else {}
            options = base, split, seen.table(base, split), look, asked
            read = partial(seen.of_view, loaded, *options)
            found += machine.map_in_threads(read, loaded.views(split))
    return found


def transients_of(found, checked, judged):
    """A `transients.Found` of each `seen.Seen`; of pairs that are none, unknown.

    judged: `ExternalRenders`, or None. Sparse points are no depth to move photos by.
    """
    coarse = judged and judged.depth != "given"
    used = [
        i
        for i, one in enumerate(found)
        if not (checked.stops or coarse or one.row.view in checked.faults)
    ]
    masks = [transients.unknown(one.place.depth.shape) for one in found]
    own = transients.found([found[i].place for i in used])
    for i, mask in zip(used, own, strict=True):
        masks[i] = mask
    return masks


def photos_of(found, detail, bad):
    """{cause: names of the photos that it is about}, of what is about some photos.

    detail: of the usual photo over its render. bad: names of those that are left out.
    """
    about = {
        "transients": lambda one: one.row.transient_fraction > 0,
        "blurred": lambda one: one.row.sharpness_ratio < blur.BLURRED_DETAIL * detail,
        "motion": lambda one: one.row.moved_fraction > motion.MOVED_FRACTION,
        "floaters": lambda one: one.hidden > HIDDEN,
    }
    kept = [one for one in found if one.row.view not in bad]
    return {
        cause: tuple(one.row.view for one in kept if is_so(one))
        for cause, is_so in about.items()
    }


def lens_of(loaded: prepared.Scene, base):
    """What the flows of training views have in common; of test views without these."""
    split = "train" if (base / "flow" / "train").is_dir() else "test"
    chosen = loaded.views(split)
    places = np.linspace(0, len(chosen) - 1, min(MAX_PATTERN_VIEWS, len(chosen)))
    flows = []
    for view in chosen[places.round().astype(int)]:
        flow_px, valid = seen.read_flow(base, split, loaded.names[view])
        flows.append(np.where(valid[..., None], flow_px, np.nan))
    shared = common_flow.of_flows(flows)
    shift, error = np.array(shared.shift_px), np.array(shared.shift_error_px)
    bend = abs(shared.distortion_px)
    return {
        "shift_px": float(np.hypot(*shift)),
        "shift_errors": float(np.max(np.abs(shift) / np.maximum(error, 1e-3))),
        "distortion_px": bend,
        "distortion_errors": bend / max(shared.distortion_error_px, 1e-3),
    }


def sums_of(found):
    """What the views of a scene come to; renders may lack the views of a split.

    found: a `seen.Seen` of each.
    """
    frame = pd.DataFrame([one.row for one in found], columns=views.COLUMNS)
    train, test = (frame[frame["split"] == split] for split in prepared.SPLITS)
    # Where training views were not rendered, test views have to tell.
    main = train if len(train) else test
    detail = main["sharpness_ratio"].median()
    tones = [
        tone.of_views([found[i].levels for i in own.index]) for own in (train, test)
    ]
    common = tones[0] if len(train) else tones[1]
    # Renders of training views have learnt some of their photos' brightness.
    exposures = [
        spread(one.even_ev) for one in tones if len(one.even_ev) >= MIN_SPREAD_VIEWS
    ] or [spread(common.even_ev)]
    octaves = np.array([found[i].octaves for i in main.index])
    octaves = octaves.reshape(-1, spectrum.OCTAVES)
    hidden = np.array([one.hidden for one in found])
    return {
        "octaves": tuple(median(octave) for octave in octaves.T),
        "tone_gain_ev": common.gain_ev,
        "tone_gamma": common.gamma,
        "tone_white_ev": common.white_ev,
        "exchanged": common.exchanged,
        "exposure_ev": max(filter(math.isfinite, exposures), default=math.nan),
        "hidden_views": hidden_views(hidden),
        "flow_train_px": median(train["flow_px"]),
        "flow_test_px": median(test["flow_px"]),
        "camera_px": median(main["camera_px"]),
        "remainder_px": median(main["remainder_px"]),
        "moved_fraction": median(main["moved_fraction"]),
        "psnr_train_db": mean(train["cc_psnr_db"]),
        "psnr_test_db": mean(test["cc_psnr_db"]),
        "detail_median": float(detail),
        "blurred_fraction": mean(
            frame["sharpness_ratio"] < blur.BLURRED_DETAIL * detail
        ),
    }


def read(*scene, **more):
    """(`base.Evidence`, a `views.View` of each view), as of `read_all`."""
    return read_all(*scene, **more)[:2]


def read_all(scene, base, *, overfit=None, crops=(None, None), before=None, learned=()):
    """(`base.Evidence`, a `views.View` of each view, {view: mask}) of a scene.

    The masks [h, w] say where a photo shows what others do not, at a smaller size.
    base: the reference's round 0. overfit: CSV of the flow invented between images that
    belong to one another, or None. crops: the two folders of `read_crops`. before:
    verdict.json of a judgement before this one, or None. learned: {name: metric} of
    those that need weights, of another program's held-out renders.
    """
    loaded = prepared.load(scene)
    poses = prepared.read_poses(scene, POSES)
    rays_seen = json_files.read(base / "timing.json", TIMING)["rays_seen"]
    told = poses.get("external_renders")
    # Of crops, that of the photos which they are cut from.
    width_px = float((poses.get("photo_size") or [poses["photo_width"]])[0])
    # Another program's black borders may be all of what a photo shows.
    whole = bool(told and not told.get("transparent"))
    look = partial(pairs.look, whole=whole, own=bool(told and told.get("of_splat")))
    metrics = {"ssim": image.ssim, **dict(learned)} if told else {}
    found = read_views(loaded, base, look, metrics)
    scores = scores_of(found, loaded.width)
    judged = read_judged(poses, before, width_px, scores)
    looked = {one.row.view: one.pair for one in found}
    shared = spread(exposure.stops([one.sampled for one in found]))
    apart = [
        [one.sampled for one in found if one.row.split == split]
        for split in ("test", "train")
    ]
    poses_of_views = [one.sampled.camtoworld for one in found]
    main = [one.row.view for one in found if one.row.split == "train"] or list(looked)
    checked = pairs.check(looked, main)
    if rays_seen is not None:
        # Ours are renders of their photos; of photos that are mirrored they may not be.
        checked = checked.only("turned")
    # Pairs that are none are left out, unless there are too many of them.
    bad = () if checked.stops else checked.faults
    masks = transients_of(found, checked, judged)
    found = [
        one._replace(row=one.row._replace(transient_fraction=mask.share))
        for one, mask in zip(found, masks, strict=True)
    ]
    # What else stands out about a pair that is none, or among such, follows from that.
    rows = [
        row._replace(stands_out=checked.faults.get(row.view, ("", ""))[1])
        if checked.stops or row.view in bad
        else row
        for row in views.named(one.row for one in found)
    ]
    train_views, test_views = (int((loaded.split == s).sum()) for s in prepared.SPLITS)
    photo_px = poses["photo_width"] / poses["width"]
    repeated = copies.of([one.small for one in found], np.array(poses_of_views))
    numbers = sums_of([one for one in found if one.row.view not in bad])
    about = photos_of(found, numbers["detail_median"], bad)
    about["copies"] = tuple(found[i].row.view for i in repeated)
    known = causes.Evidence(
        train_views=train_views,
        test_views=test_views,
        registered=poses["registered"],
        # Given poses leave no photo out.
        total=poses["total"] if poses["poses"] == "colmap" else poses["registered"],
        photo_px=photo_px,
        reprojection_px=number(poses["mean_reprojection_error_px"]) / photo_px,
        overfit_px=float(csv_files.by_view(overfit)["median_px"].median())
        if overfit
        else math.nan,
        epochs=number(rays_seen) / (max(train_views, 1) * loaded.width * loaded.height),
        shared_ev=shared,
        # Where no depth is known, no point is.
        apart_deg=math.nan
        if told and told.get("depth") == "far"
        else spacing.degrees(*apart),
        photo_width_px=width_px,
        poses_given=poses["poses"] in INPUT,
        perturb_px=float(poses["perturb_px"]),
        # Folders of earlier versions do not say it.
        perturb_by=poses.get("perturb_by") or "rotation",
        crops=read_crops(*crops),
        judged=judged,
        matches=of_matches(poses),
        pairs=checked,
        by_colmap=by_colmap(poses, scene),
        copies=len(repeated),
        transient_fraction=transients.fraction(masks),
        photos=about,
        **numbers,
        **lens_of(loaded, base),
    )
    shown = {
        row.view: mask.shown
        for row, mask in zip(rows, masks, strict=True)
        if mask.shown.any()
    }
    return known, rows, shown


def hidden_views(hidden):
    """How many views a floater hides a part of; NaN where no depth is known."""
    known = np.isfinite(hidden)
    return float((hidden[known] > HIDDEN).sum()) if known.any() else math.nan


def by_colmap(poses, scene):
    """The command that lets COLMAP find the poses of a scene's photos, or None.

    poses: the contents of poses.json.
    """
    if (folder := poses.get("photos_alone")) is None:
        return None
    name = f"--name {Path(scene).resolve().name}_colmap"
    return provenance.as_command("photos", {"FOLDER": folder}, name)


def of_matches(poses):
    """`Matches` by the contents of poses.json; None where none were sought.

    Crops have the report of the photos that they are cut from.
    """
    told = prepared.adjustment_of(poses)
    if told.get("before_px") is None:
        return None
    accepted = bool(told.get("accepted"))
    off = (told["pose_error_px"], told["worst_px"]) if accepted else (math.nan,) * 2
    lenses = prepared.part_of(poses["camera_check"], "lens")
    faults = poses["camera_check"].get("faults") or []
    return causes.Matches(
        accepted,
        accepted and poses["poses"] == "adjusted",
        *map(number, (told["before_px"], told.get("after_px"), *off)),
        *(lens_told(lenses.get(name)) for name in ("given", "adjusted")),
        tuple(fault["said"] for fault in faults),
        tuple(told.get("kept") or ()),
    )


def lens_told(found):
    """`sfm.lens.Lens` by what it has told, or None."""
    if not found:
        return None
    numbers = {key: number(found[key]) for key in Lens._fields if key != "changed"}
    # What is no finite number changes nothing.
    is_known = all(map(math.isfinite, numbers.values()))
    return Lens(found["changed"] if is_known else [], **numbers)


def scores_of(found, width_px):
    """SCORES of the held-out among `seen.Seen`s, so wide; None where there are none.

    Sharpness is the amplitude of fine detail of renders over that of their photos.
    """
    own = [one for one in found if one.row.split == "test"]
    if not own:
        return None
    each = {
        "psnr_db": [one.row.psnr_db for one in own],
        "sharpness": [1 / max(one.row.sharpness_ratio, 1e-6) for one in own],
    }
    each |= {name: [one.scores[name] for one in own] for name in own[0].scores}
    means = {name: float(np.mean(values)) for name, values in each.items()}
    return {"views": len(own), "width_px": width_px} | means


def read_judged(poses, before=None, width_px=None, scores=None):
    """`ExternalRenders` by the contents of poses.json, or None of another scene.

    before: path of the verdict.json of a judgement before this one, or None. width_px:
    of the photos. scores: SCORES, or None.
    """
    if not isinstance(told := poses.get("external_renders"), dict):
        return None
    known = {key: told.get(key) for key in causes.ExternalRenders._fields}
    known["before"] = before and read_before(Path(before), width_px)
    return causes.ExternalRenders(**known | {"scores": scores})


def read_before(path, width_px):
    """(name, px on photos that were trained on, px on held-out ones, SCORES).

    What is unknown is None. The px are of photos `width_px` wide: those of an export
    may be smaller.
    """
    found = json_files.read(path, {"evidence": BEFORE})["evidence"]
    wide = found.get("photo_width_px")
    scale = found["photo_px"] * (width_px / wide if wide and width_px else 1)
    shifts = (px and px * scale for px in map(found.get, LENGTHS))
    return path.parent.name, *shifts, (found.get("judged") or {}).get("scores")


def read_crops(given, corrected=None):
    """`Crops` of folders results/SCENE/METHOD/roundK; None where there are none.

    given: of the cameras as given; corrected: of cameras that were corrected, or None.
    Their scenes are cut from another: `crops` of the config, `crop.of` of a scene.
    """
    if not given:
        return None
    base = Path(given)
    loaded = prepared.load(base.parents[1])
    crop = prepared.read_poses(loaded.folder, {"crop": prepared.CROP})["crop"]
    pixels = len(loaded.views("train")) * loaded.width * loaded.height
    flows, of_test = (of_photos(base, split, "flow") for split in prepared.SPLITS)
    low, high = interval_of_median(flows)
    after = of_photos(Path(corrected), "train", "flow") if corrected else flows[:0]
    return causes.Crops(
        places=len(crop["points"]),
        px=crop["px"],
        photos=len(flows),
        test_photos=len(of_test),
        flow_px=median(flows),
        low_px=low,
        high_px=high,
        flow_test_px=median(of_test),
        camera_px=median(of_photos(base, "train", "camera")),
        remainder_px=median(of_photos(base, "train", "remainder")),
        epochs=json_files.read(base / "timing.json", TIMING)["rays_seen"] / pixels,
        corrected_px=median(after),
    )


def of_photos(base, split, what):
    """A length [n] of each photo of a split: the median over its crops.

    Photos without a valid flow are left out.
    """
    column = f"{what}_median_px"
    lengths = csv_files.by_view(base / f"decomposition_photos_{split}.csv")[column]
    photo = lengths.index.str.rpartition("_w").get_level_values(0)
    return lengths.groupby(photo).median().dropna().to_numpy(np.float64)


def interval_of_median(values):
    """95 % interval (low, high) of the median of values [n] over photos drawn anew."""
    if len(values) < 2:
        return math.nan, math.nan
    drawn = values[intervals.resamples(len(values), draws=DRAWS)]
    return intervals.from_draws(np.median(drawn, axis=1), len(values))


def spread(values):
    """Standard deviation of those that are known; NaN of fewer than two."""
    known = values[np.isfinite(values)]
    return float(np.std(known)) if len(known) > 1 else math.nan


def number(value):
    """A number, or NaN for null."""
    return math.nan if value is None else float(value)


def median(values):
    """Of those that are known; NaN of none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def mean(values):
    """NaN of none."""
    return float(values.to_numpy().mean()) if len(values) else math.nan
