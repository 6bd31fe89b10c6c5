"""The numbers of a verdict, after the first round of a scene's reference.

Reads the outputs of the stages: photos, renders, flow and its parts, trainings, poses.
"""

import math
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.cameras import exposure, lens
from alignerf.causes import base as causes
from alignerf.causes import blur, motion
from alignerf.files import archives, csv_files, json_files, machine
from alignerf.metrics import pairs
from alignerf.scenes import prepared
from alignerf.tables import intervals
from alignerf.verdict import views

# What it takes from a poses.json, and from a training's timing.json; from what
# poses.json says of windows, and of another program's renders.
POSES = prepared.POSES | {"poses": str, "perturb_px": json_files.NUMBER}
TIMING = {"rays_seen": json_files.NUMBER_OR_NONE}
ZOOM = {"of": str, "px": int, "points": list}
JUDGED = dict.fromkeys(("depth", "cameras", "layout", "way"), str)
# And from the evidence of a judgement before.
BEFORE = dict.fromkeys(("flow_train_px", "flow_test_px"), json_files.NUMBER_OR_NONE)
BEFORE |= {"photo_px": json_files.NUMBER}
# Poses that came with the photos, as poses.json has them.
INPUT = ("given", "adjusted")
# Flows of so many training views tell what all have in common.
MOST_PATTERN_VIEWS = 32
DRAWS = 2000


class Seen(NamedTuple):
    """What the photos of a scene and their renders say.

    rows: a `views.View` of each view whose render and flow are there. pairs: {view:
    `pairs.Seen`}, of another program's renders. shared_ev: standard deviation
    over photos of how bright they show the same points, in stops; NaN where unknown.
    """

    rows: list
    pairs: dict
    shared_ev: float


def read_views(loaded: prepared.Scene, base, splits, look=None) -> Seen:
    """`Seen` of the splits that have renders; base: the reference's round 0.

    look: `pairs.look` with its options, where pairs are to be checked.
    """
    rows, seen, sampled = [], {}, []
    for split in splits:
        if not (base / "renders" / split).is_dir():
            continue
        parts = table(base / f"decomposition_photos_{split}.csv")
        lengths = table(base / "displacement" / f"{split}.csv")
        tables = parts.join(lengths["blur_sigma_px"])
        read = partial(read_view, loaded, base, split, tables, look)
        for row, pair, photo in machine.map_in_threads(read, loaded.views(split)):
            rows.append(row)
            seen[row.view] = pair
            sampled.append(photo)
    stops = exposure.stops(sampled)
    known = stops[np.isfinite(stops)]
    shared_ev = float(np.std(known)) if len(known) > 1 else math.nan
    return Seen(views.named(rows), seen if look else {}, shared_ev)


def read_view(loaded: prepared.Scene, base, split, tables, look, view):
    """(`views.View` of one view, its `pairs.Seen`, its `exposure.Sampled`).

    tables: of its split, by names. look: as of `read_views`.
    """
    name = loaded.names[view]
    (photo,) = prepared.read_images(loaded, [view], loaded.folder / "images")
    (render,) = prepared.read_images(loaded, [view], base / "renders" / split)
    _, valid = read_flow(base, split, name)
    (counts,) = prepared.read_masks(loaded, [view])
    row = tables.loc[name]
    measured = views.View(
        view=name,
        split=split,
        flow_px=row["flow_median_px"],
        camera_px=row["camera_median_px"],
        remainder_px=row["remainder_median_px"],
        moved_share=moved_share(base, split, name, row["camera_median_px"]),
        blur_sigma_px=row["blur_sigma_px"],
        **views.measured(photo, render, valid, counts),
    )
    depth = archives.read(base / "depth" / split / f"{name}.npz", ["depth"])["depth"]
    camera = loaded.pixtocams[view], loaded.camtoworlds[view]
    sampled = exposure.sampled(exposure.View(photo, depth, *camera, counts))
    return measured, look and look(photo, render, counts), sampled


def table(path):
    """A CSV of views, by their names."""
    return csv_files.read(path, columns=["view"]).set_index("view")


def read_flow(base, split, name):
    """(flow_px [h, w, 2], valid [h, w]) of a view."""
    data = archives.read(base / "flow" / split / f"{name}.npz", ("flow_px", "valid"))
    return data["flow_px"], data["valid"]


def moved_share(base, split, name, camera_px):
    """Share of a view's valid pixels that moved on their own, by a visible length."""
    least_px = max(motion.MOVED_PX, motion.MOVED_OF_CAMERA * camera_px)
    path = base / "parts_photos" / split / f"{name}.npz"
    data = archives.read(path, ("remainder_px", "moved", "valid"))
    far = np.linalg.norm(data["remainder_px"], axis=-1) > least_px
    valid = data["valid"]
    return float((data["moved"] & far & valid).sum() / max(valid.sum(), 1))


def read_pattern(loaded: prepared.Scene, base) -> lens.Pattern:
    """The pattern of the training views' flows; of the test views' without these."""
    split = "train" if (base / "flow" / "train").is_dir() else "test"
    chosen = loaded.views(split)
    places = np.linspace(0, len(chosen) - 1, min(MOST_PATTERN_VIEWS, len(chosen)))
    flows = []
    for view in chosen[places.round().astype(int)]:
        flow_px, valid = read_flow(base, split, loaded.names[view])
        flows.append(np.where(valid[..., None], flow_px, np.nan))
    return lens.of_flows(flows)


def gather(
    loaded,
    seen: Seen,
    shared: lens.Pattern,
    *,
    poses,
    timing,
    overfit=None,
    windows=(None, None),
    before=None,
) -> causes.Evidence:
    """The evidence of a scene's views.

    poses, timing: contents of poses.json and of the reference's timing.json. overfit:
    CSV of the flow invented between images that belong to one another, or None.
    windows: the two folders of `read_windows`. before: verdict.json of a judgement
    before this one, or None. Renders of another program may lack the views of a split.
    """
    checked, rows = held(seen)
    of_split = {
        split: [v for v in rows if v.split == split] for split in prepared.SPLITS
    }
    train, test = of_split["train"], of_split["test"]
    counts = {split: int((loaded.split == split).sum()) for split in prepared.SPLITS}
    pixels = max(counts["train"], 1) * loaded.width * loaded.height
    photo_px = poses["photo_width"] / poses["width"]
    # Where training views were not rendered, test views have to tell.
    main = train or test
    ratios = np.array([view.detail_ratio for view in main])
    blurred = ratios < blur.BLURRED_DETAIL * np.median(ratios)
    shift, error = np.array(shared.shift_px), np.array(shared.shift_error_px)
    return causes.Evidence(
        train_views=counts["train"],
        test_views=counts["test"],
        registered=poses["registered"],
        # Given poses leave no photo out.
        total=poses["total"] if poses["poses"] == "colmap" else poses["registered"],
        photo_px=photo_px,
        reprojection_px=number(poses["mean_reprojection_error_px"]) / photo_px,
        flow_train_px=median(v.flow_px for v in train),
        flow_test_px=median(v.flow_px for v in test),
        camera_px=median(v.camera_px for v in main),
        remainder_px=median(v.remainder_px for v in main),
        moved_share=median(v.moved_share for v in main),
        psnr_train_db=mean(v.even_psnr_db for v in train),
        psnr_test_db=mean(v.even_psnr_db for v in test),
        overfit_px=float(table(overfit)["median_px"].median()) if overfit else math.nan,
        passes=number(timing["rays_seen"]) / pixels,
        detail_median=float(np.median(ratios)),
        blurred_share=float(np.mean(blurred)),
        # Renders of training views have learnt some of their photos' brightness.
        exposure_ev=max(
            float(np.std([v.exposure_ev for v in own])) for own in (train, test) if own
        ),
        shared_ev=seen.shared_ev,
        shift_px=float(np.hypot(*shift)),
        shift_errors=float(np.max(np.abs(shift) / np.maximum(error, 1e-3))),
        distortion_px=abs(shared.distortion_px),
        distortion_errors=abs(shared.distortion_px)
        / max(shared.distortion_error_px, 1e-3),
        # Of windows, that of the photos which they are cut from.
        photo_width_px=float(poses.get("photo_size", [poses["photo_width"]])[0]),
        poses_given=poses["poses"] in INPUT,
        perturb_px=float(poses["perturb_px"]),
        windows=read_windows(*windows),
        judged=read_judged(poses, before),
        matches=of_matches(poses),
        pairs=checked,
    )


def held(seen: Seen):
    """(`pairs.Checked`, the rows that are told by).

    Pairs that are none are left out, unless there are too many of them.
    """
    main = [v.view for v in seen.rows if v.split == "train"] or list(seen.pairs)
    checked = pairs.check(seen.pairs, main)
    bad = () if checked.stops else checked.faults
    return checked, [view for view in seen.rows if view.view not in bad]


def of_matches(poses):
    """`Matches` by the contents of poses.json; None where none were sought.

    Crops have the report of the photos that they are cut from.
    """
    told = prepared.adjustment_of(poses)
    if told.get("before_px") is None:
        return None
    accepted = bool(told.get("accepted"))
    return causes.Matches(
        accepted=accepted,
        applied=accepted and poses["poses"] == "adjusted",
        before_px=float(told["before_px"]),
        after_px=float(told["after_px"]),
        pose_error_px=float(told["pose_error_px"]) if accepted else math.nan,
        worst_px=float(told["worst_px"]) if accepted else math.nan,
    )


def read_judged(poses, before=None):
    """`Judged` by the contents of poses.json, or None of another scene.

    before: path of the verdict.json of a judgement before this one, or None.
    """
    if (told := poses.get("judged")) is None:
        return None
    json_files.check(told, JUDGED)
    kept = {key: told[key] for key in ("depth", "cameras", "layout")}
    return causes.Judged(
        **kept, before=before and read_before(before), depth_unit=told.get("depth_unit")
    )


def read_before(path):
    """(name, px on photos that were trained on, px on held-out ones; None unknown)."""
    found = json_files.read(path, {"evidence": dict})["evidence"]
    try:
        json_files.check(found, BEFORE)
    except ValueError as error:
        raise ValueError(f"{path}: evidence: {error}") from None
    shifts = (found["flow_train_px"], found["flow_test_px"])
    return Path(path).parent.name, *(px and px * found["photo_px"] for px in shifts)


def read_windows(given, corrected=None):
    """`Windows` of folders results/SCENE/METHOD/roundK; None where there are none.

    given: of the cameras as given; corrected: of cameras that were put right, or None.
    Their scenes are cut from another: `windows` of the config, `zoom.of` of a scene.
    """
    if not given:
        return None
    base = Path(given)
    scene = base.parents[1]
    zoom = json_files.read(scene / "poses.json", {"zoom": dict})["zoom"]
    json_files.check(zoom, ZOOM)
    loaded = prepared.load(scene)
    pixels = len(loaded.views("train")) * loaded.width * loaded.height
    flows, of_test = (of_photos(base, split, "flow") for split in ("train", "test"))
    low, high = interval_of_median(flows)
    return causes.Windows(
        places=len(zoom["points"]),
        px=zoom["px"],
        photos=len(flows),
        test_photos=len(of_test),
        flow_px=median(flows),
        low_px=low,
        high_px=high,
        flow_test_px=median(of_test),
        camera_px=median(of_photos(base, "train", "camera")),
        remainder_px=median(of_photos(base, "train", "remainder")),
        passes=json_files.read(base / "timing.json", TIMING)["rays_seen"] / pixels,
        corrected_px=median(of_photos(Path(corrected), "train", "flow"))
        if corrected
        else math.nan,
    )


def of_photos(base, split, what):
    """A length [n] of each photo of a split: the median over its windows.

    Photos without a valid flow are left out.
    """
    column = f"{what}_median_px"
    found = csv_files.read(
        base / f"decomposition_photos_{split}.csv", columns=["view", column]
    )
    photo = found["view"].str.rpartition("_w")[0]
    return found.groupby(photo)[column].median().dropna().to_numpy(np.float64)


def interval_of_median(values):
    """95 % interval (low, high) of the median of values [n] over photos drawn anew."""
    if len(values) < 2:
        return math.nan, math.nan
    drawn = values[intervals.resamples(len(values), draws=DRAWS)]
    return intervals.from_draws(np.median(drawn, axis=1), len(values))


def number(value):
    """A number, or NaN for null."""
    return math.nan if value is None else float(value)


def median(values):
    """Of those that are known; NaN of none."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.median(known)) if known else math.nan


def mean(values):
    """NaN of none."""
    values = list(values)
    return float(np.mean(values)) if values else math.nan
