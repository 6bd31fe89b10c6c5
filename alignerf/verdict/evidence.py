"""The numbers of a verdict, after the first round of a scene's reference.

Reads the outputs of the stages: photos, renders, flow and its parts, trainings, poses.
"""

import math
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.cameras import exposure, lens
from alignerf.causes import base as causes
from alignerf.causes import blur, motion, shift
from alignerf.io import archives, csv_files, json_files, machine, provenance
from alignerf.metrics import pairs
from alignerf.scenes import prepared
from alignerf.tables import intervals
from alignerf.verdict import views

# What it takes from a poses.json, and from a timing.json.
POSES = prepared.POSES | {"poses": str, "perturb_px": json_files.NUMBER}
TIMING = {"rays_seen": json_files.NUMBER_OR_NONE}
# Poses that came with the photos, as poses.json has them.
INPUT = ("input", "adjusted")
# Flows of so many training views tell what all have in common.
MAX_PATTERN_VIEWS = 32
DRAWS = 2000


def read_views(loaded: prepared.Scene, base, look=None):
    """(rows, pairs, shared_ev): what photos and their renders say.

    rows: a `views.View` of each view whose render and flow are there. pairs: {view:
    `pairs.Seen`}, of another program's renders. shared_ev: standard deviation over
    photos of how bright they show the same points, in stops; NaN where unknown. base:
    the reference's round 0. look: `pairs.look` with its options, where pairs are to be
    checked.
    """
    found = []
    for split in prepared.SPLITS:
        if (base / "renders" / split).is_dir():
            parts = table(base / f"decomposition_photos_{split}.csv")
            lengths = table(base / "displacement" / f"{split}.csv")
            tables = parts.join(lengths["blur_sigma_px"])
            read = partial(read_view, loaded, base, split, tables, look)
            found += machine.map_in_threads(read, loaded.views(split))
    rows, looked, sampled = zip(*found, strict=True) if found else ((), (), ())
    stops = exposure.stops(sampled)
    known = stops[np.isfinite(stops)]
    shared_ev = float(np.std(known)) if len(known) > 1 else math.nan
    seen = {row.view: one for row, one in zip(rows, looked, strict=True) if one}
    return views.named(rows), seen, shared_ev


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
        moved_fraction=moved_fraction(
            base, split, name, row["camera_median_px"], photo
        ),
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


def moved_fraction(base, split, name, camera_px, photo):
    """Share of a view's valid pixels that moved on their own, by a visible length.

    Where the photo is flat, as in a sky, a flow says nothing.
    """
    min_px = max(motion.MOVED_PX, motion.MOVED_OF_CAMERA * camera_px)
    path = base / "parts_photos" / split / f"{name}.npz"
    data = archives.read(path, ("remainder_px", "moved", "valid"))
    far = np.linalg.norm(data["remainder_px"], axis=-1) > min_px
    valid = data["valid"]
    moved = data["moved"] & far & valid & views.textured(photo)
    return float(moved.sum() / max(valid.sum(), 1))


def lens_of(loaded: prepared.Scene, base):
    """What the flows of training views have in common; of test views without these."""
    split = "train" if (base / "flow" / "train").is_dir() else "test"
    chosen = loaded.views(split)
    places = np.linspace(0, len(chosen) - 1, min(MAX_PATTERN_VIEWS, len(chosen)))
    flows = []
    for view in chosen[places.round().astype(int)]:
        flow_px, valid = read_flow(base, split, loaded.names[view])
        flows.append(np.where(valid[..., None], flow_px, np.nan))
    shared = lens.of_flows(flows)
    shift, error = np.array(shared.shift_px), np.array(shared.shift_error_px)
    bend = abs(shared.distortion_px)
    return {
        "shift_px": float(np.hypot(*shift)),
        "shift_errors": float(np.max(np.abs(shift) / np.maximum(error, 1e-3))),
        "distortion_px": bend,
        "distortion_errors": bend / max(shared.distortion_error_px, 1e-3),
    }


def sums_of(rows):
    """What the views of a scene come to; renders may lack the views of a split."""
    frame = pd.DataFrame(rows, columns=views.COLUMNS)
    train, test = (frame[frame["split"] == split] for split in prepared.SPLITS)
    # Where training views were not rendered, test views have to tell.
    main = train if len(train) else test
    detail = main["sharpness_ratio"].median()
    # Of few views one that is rendered badly is most of the spread.
    several = [own for own in (train, test) if len(own) >= shift.FEW_TEST_VIEWS]
    exposures = [own["exposure_ev"].to_numpy() for own in several or [main]]
    return {
        "flow_train_px": median(train["flow_px"]),
        "flow_test_px": median(test["flow_px"]),
        "camera_px": median(main["camera_px"]),
        "remainder_px": median(main["remainder_px"]),
        "moved_fraction": median(main["moved_fraction"]),
        "psnr_train_db": mean(train["cc_psnr_db"]),
        "psnr_test_db": mean(test["cc_psnr_db"]),
        "detail_median": float(detail),
        "blurred_fraction": mean(
            main["sharpness_ratio"] < blur.BLURRED_DETAIL * detail
        ),
        # Renders of training views have learnt some of their photos' brightness.
        "exposure_ev": max(float(own.std()) for own in exposures),
        "darker_ev": median(main["exposure_ev"]),
    }


def read(scene, base, *, overfit=None, crops=(None, None), before=None):
    """(`base.Evidence`, a `views.View` of each view) of a scene.

    base: the reference's round 0. overfit: CSV of the flow invented between images that
    belong to one another, or None. crops: the two folders of `read_crops`. before:
    verdict.json of a judgement before this one, or None.
    """
    loaded = prepared.load(scene)
    poses = json_files.read(scene / "poses.json", POSES)
    rays_seen = json_files.read(base / "timing.json", TIMING)["rays_seen"]
    look = None
    if rays_seen is None:
        # Another program's: its black borders may be all of what a photo shows.
        told = poses.get("external_renders")
        look = partial(pairs.look, whole=bool(told and not told.get("transparent")))
    rows, looked, shared_ev = read_views(loaded, base, look)
    main = [row.view for row in rows if row.split == "train"] or list(looked)
    checked = pairs.check(looked, main)
    # Pairs that are none are left out, unless there are too many of them.
    bad = () if checked.stops else checked.faults
    # What else stands out about a pair that is none, or among such, follows from that.
    rows = [
        row._replace(stands_out=checked.faults.get(row.view, ("", ""))[1])
        if checked.stops or row.view in bad
        else row
        for row in rows
    ]
    train_views, test_views = (int((loaded.split == s).sum()) for s in prepared.SPLITS)
    photo_px = poses["photo_width"] / poses["width"]
    # Of crops, that of the photos which they are cut from.
    width_px = float(poses.get("photo_size", [poses["photo_width"]])[0])
    known = causes.Evidence(
        train_views=train_views,
        test_views=test_views,
        registered=poses["registered"],
        # Given poses leave no photo out.
        total=poses["total"] if poses["poses"] == "colmap" else poses["registered"],
        photo_px=photo_px,
        reprojection_px=number(poses["mean_reprojection_error_px"]) / photo_px,
        overfit_px=float(table(overfit)["median_px"].median()) if overfit else math.nan,
        epochs=number(rays_seen) / (max(train_views, 1) * loaded.width * loaded.height),
        shared_ev=shared_ev,
        photo_width_px=width_px,
        poses_given=poses["poses"] in INPUT,
        perturb_px=float(poses["perturb_px"]),
        crops=read_crops(*crops),
        judged=read_judged(poses, before, width_px),
        matches=of_matches(poses),
        pairs=checked,
        by_colmap=by_colmap(poses, scene),
        **sums_of([row for row in rows if row.view not in bad]),
        **lens_of(loaded, base),
    )
    return known, rows


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
    return causes.Matches(
        accepted,
        accepted and poses["poses"] == "adjusted",
        *map(float, (told["before_px"], told["after_px"], *off)),
    )


def read_judged(poses, before=None, width_px=None):
    """`ExternalRenders` by the contents of poses.json, or None of another scene.

    before: path of the verdict.json of a judgement before this one, or None. width_px:
    of the photos.
    """
    if not isinstance(told := poses.get("external_renders"), dict):
        return None
    known = {key: told.get(key) for key in causes.ExternalRenders._fields}
    return causes.ExternalRenders(
        **known | {"before": before and read_before(Path(before), width_px)}
    )


def read_before(path, width_px):
    """(name, px on photos that were trained on, px on held-out ones; None unknown).

    The px are of photos `width_px` wide: those of an export may be smaller.
    """
    found = json_files.read(path, {"evidence": dict})["evidence"]
    numbers = ("flow_train_px", "flow_test_px", "photo_px", "photo_width_px")
    for key in numbers:
        if not isinstance(found.get(key), (*json_files.NUMBER, type(None))):
            raise ValueError(f"{path}: {key} is no number")
    if found.get("photo_px") is None:
        raise ValueError(f"{path}: photo_px is missing")
    wide = found.get("photo_width_px")
    scale = found["photo_px"] * (width_px / wide if wide and width_px else 1)
    shifts = (found.get("flow_train_px"), found.get("flow_test_px"))
    return path.parent.name, *(px and px * scale for px in shifts)


def read_crops(given, corrected=None):
    """`Crops` of folders results/SCENE/METHOD/roundK; None where there are none.

    given: of the cameras as given; corrected: of cameras that were corrected, or None.
    Their scenes are cut from another: `crops` of the config, `crop.of` of a scene.
    """
    if not given:
        return None
    base = Path(given)
    loaded = prepared.load(base.parents[1])
    crop = json_files.read(loaded.folder / "poses.json", {"crop": dict})["crop"]
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
    lengths = table(base / f"decomposition_photos_{split}.csv")[column]
    photo = lengths.index.str.rpartition("_w").get_level_values(0)
    return lengths.groupby(photo).median().dropna().to_numpy(np.float64)


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
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def mean(values):
    """NaN of none."""
    return float(values.to_numpy().mean()) if len(values) else math.nan
