"""The numbers of a verdict, after the first round of a scene's reference.

Reads the outputs of the stages: photos, renders, flow and its parts, trainings, poses.
"""

import math
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.cameras import exposure, lens
from alignerf.files import archives, csv_files, json_files, machine
from alignerf.metrics import pairs
from alignerf.scenes import prepared
from alignerf.verdict import causes, views
from alignerf.verdict import windows as of_windows

# Poses that came with the photos, as poses.json has them.
INPUT = ("given", "adjusted")
# Flows of so many training views tell what all have in common.
MOST_PATTERN_VIEWS = 32


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
        if not (Path(base) / "renders" / split).is_dir():
            continue
        parts = table(Path(base) / f"decomposition_photos_{split}.csv")
        lengths = table(Path(base) / "displacement" / f"{split}.csv")
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
    (render,) = prepared.read_images(loaded, [view], Path(base) / "renders" / split)
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
    path = Path(base) / "depth" / split / f"{name}.npz"
    depth = archives.read(path, ["depth"])["depth"]
    camera = loaded.pixtocams[view], loaded.camtoworlds[view]
    sampled = exposure.sampled(exposure.View(photo, depth, *camera, counts))
    return measured, look and look(photo, render, counts), sampled


# What it takes from a poses.json, and from the reference's timing.json.
POSES = prepared.POSES | {"poses": str, "perturb_px": json_files.NUMBER}
TIMING = {"rays_seen": json_files.NUMBER_OR_NONE}


def table(path):
    """A CSV of views, by their names."""
    return csv_files.read(path, columns=["view"]).set_index("view")


def read_flow(base, split, name):
    """(flow_px [h, w, 2], valid [h, w]) of a view."""
    path = Path(base) / "flow" / split / f"{name}.npz"
    data = archives.read(path, ("flow_px", "valid"))
    return data["flow_px"], data["valid"]


def moved_share(base, split, name, camera_px):
    """Share of a view's valid pixels that moved on their own, by a visible length."""
    least_px = max(causes.MOVED_PX, causes.MOVED_OF_CAMERA * camera_px)
    path = Path(base) / "parts_photos" / split / f"{name}.npz"
    data = archives.read(path, ("remainder_px", "moved", "valid"))
    far = np.linalg.norm(data["remainder_px"], axis=-1) > least_px
    valid = data["valid"]
    return float((data["moved"] & far & valid).sum() / max(valid.sum(), 1))


def read_pattern(loaded: prepared.Scene, base) -> lens.Pattern:
    """The pattern of the training views' flows; of the test views' without these."""
    split = "train" if (Path(base) / "flow" / "train").is_dir() else "test"
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
    overfit,
    windows=(None, None),
    of_judged=None,
):
    """`causes.Evidence` of a scene's views.

    poses, timing: contents of poses.json and of the reference's timing.json. overfit:
    CSV of the flow invented between images that belong to one another, or None.
    windows: the two folders of `windows.read`. of_judged: a `judged.Judged`, of a scene
    of another program's renders; such a scene may lack the views of a split.
    """
    checked, rows = held(seen)
    of_split = {
        split: [v for v in rows if v.split == split] for split in ("train", "test")
    }
    counts = {split: int((loaded.split == split).sum()) for split in prepared.SPLITS}
    pixels = max(counts["train"], 1) * loaded.width * loaded.height
    photo_px = poses["photo_width"] / poses["width"]
    # Where training views were not rendered, test views have to tell.
    main = of_split["train"] or of_split["test"]
    ratios = np.array([view.detail_ratio for view in main])
    shift, error = np.array(shared.shift_px), np.array(shared.shift_error_px)
    return causes.Evidence(
        train_views=counts["train"],
        test_views=counts["test"],
        registered=poses["registered"],
        # Given poses leave no photo out.
        total=poses["total"] if poses["poses"] == "colmap" else poses["registered"],
        photo_px=photo_px,
        reprojection_px=number(poses["mean_reprojection_error_px"]) / photo_px,
        flow_train_px=median(of_split["train"], "flow_px"),
        flow_test_px=median(of_split["test"], "flow_px"),
        camera_px=median(main, "camera_px"),
        remainder_px=median(main, "remainder_px"),
        moved_share=median(main, "moved_share"),
        psnr_train_db=mean(of_split["train"], "even_psnr_db"),
        psnr_test_db=mean(of_split["test"], "even_psnr_db"),
        overfit_px=float(table(overfit)["median_px"].median()) if overfit else math.nan,
        passes=number(timing["rays_seen"]) / pixels,
        detail_median=float(np.median(ratios)),
        blurred_share=float(
            np.mean(ratios < causes.BLURRED_DETAIL * np.median(ratios))
        ),
        # Renders of training views have learnt some of their photos' brightness.
        exposure_ev=max(spread(own, "exposure_ev") for own in of_split.values() if own),
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
        windows=of_windows.read(*windows),
        judged=of_judged,
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
    """`causes.Matches` by the contents of poses.json; None where none were sought.

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


def number(value):
    """A number, or NaN for null."""
    return math.nan if value is None else float(value)


def median(rows, key):
    """Over views; NaN without views."""
    values = np.array([getattr(v, key) for v in rows], float)
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def spread(rows, key):
    """Standard deviation over views."""
    return float(np.std([getattr(v, key) for v in rows]))


def mean(rows, key):
    """Over views; NaN without views."""
    return float(np.mean([getattr(v, key) for v in rows])) if rows else math.nan
