"""Images and cameras of a scene: `python -m alignerf.poses --config JSON --out DIR`.

Writes images/<view>.png (undistorted, at the resolution of training), cameras.npz,
poses.json and, for the embedded courtyard, truth/. No output appears before all have
succeeded; poses.json is moved last, so its presence says that the rest is complete.
"""

import json
import logging
import time
from pathlib import Path

import numpy as np

from alignerf.captures import base
from alignerf.colmap import crops, loading
from alignerf.courtyard import truth
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import atomic, faults, json_files, owned
from alignerf.judged import originals
from alignerf.scenes import cameras, held_out, prepare, prepared
from alignerf.sfm import calibration, checking, matches, mistakes

log = logging.getLogger("alignerf.poses")

# As in `causes.shared.misalignment`; a test holds both equal. Were they taken from
# there, every change of a threshold would make all poses anew.
FEW_TRAIN_VIEWS, FEW_TEST_VIEWS = 12, 5
# With `downscale: auto`: a training that sees each half a time takes minutes on a core.
# Many photos may have more together, rather than sides under this.
MAX_PIXELS, MIN_SIDE_PX = 10_000_000, 200
PRODUCTS = ("images", "colmap", "cameras.npz", "poses.json")


OPTIONS = {
    "config": ("JSON, or a file of it", str),
    "out": ("results/SCENE", Path),
    "[whole]": ("of crops: the other scene's folder", Path),
    "[cameras]": "of crops: their cameras.npz",
    "[places]": ("of crops: others, at the same places", Path),
    "[adjust]": ("write adjusted cameras beside the scene's", faults.FLAG),
}


def main(config, out, whole=None, cameras=None, places=None, adjust=False):
    """Run one scene's slice of the config; `out` is the scene's folder of results.

    adjust: a method trains with adjusted cameras, whatever those of the scene are.

    Of crops of another scene: whole, its folder; cameras, the cameras.npz that
    they have; places, the folder of crops that they lie at the same places as.
    """
    config, out = of_scenes.checked(config), Path(out)
    capture = base.of(config)
    if capture.parent(config):
        return of_crops(config, out, Path(whole), cameras, places)
    started, where = time.monotonic(), config.path or out
    with atomic.scratch_folder(out) as scratch:
        full, told, scene = capture.read(config, scratch)
        told["downscale_decided"] = config.downscale == "auto"
        told["perturb_by"] = config.perturb_by
        full = mistakes.stated(prepare.sort_by_name(full), config)
        config = with_size(config, full)
        given = for_training(full, config)
        prepared.check_views(where, given)
        if capture.trains:
            prepared.check_places(where, given)
        full = full._replace(camtoworlds=perturbed(given, config))
        checked = None
        if capture.wants_matches(config) or adjust:
            checked = check_cameras(full, scratch, config, adjust)
            full, told = with_checked(full, told, checked, scratch, config)
        views = for_training(full, config)
        split = split_of(views, config)
        named = dict(zip(views.names, split.tolist(), strict=True))
        held_out.check(where, given, named)
        if capture.trains:
            check_enough(split, config.min_train_views, where)
            warn_of_few(out, split)
        fresh = scratch / "new"
        prepare.write_views(fresh, views, split=split)
        if checked:
            write_checked(fresh, views, checked, split, adjust or not capture.trains)
        if scene is not None:
            log.info("rendering the truth of %d views", len(views.names))
            told["true_misalignment_px"] = truth.write_truth(
                fresh / "images" / "truth",
                truth.select(scene, views.names),
                views,
                split=split,
                perturb_px=config.perturb_px,
            )
        files = [*originals.of_views(config, full), *told.pop("files", ())]
        outer = [path for path in files if scratch not in Path(path).parents]
        originals.write(fresh, outer)
        told["photos_alone"] = originals.alone(outer)
        for path in (scratch / prepared.BESIDE).glob("*"):
            atomic.move(path, fresh / "images" / path.name)
        if (scratch / "colmap").is_dir():
            atomic.move(scratch / "colmap", fresh / "colmap")
        photo_size = told.get("photo_size", (full.width, full.height))
        told |= describe_views(views, photo_size, split, config)
        told["time_s"] = round(time.monotonic() - started, 1)
        (fresh / "poses.json").write_text(json.dumps(told, indent=1) + "\n")
        publish(fresh, out)
    log.info("%s: %d of %d views", out, told["registered"], told["total"])


def of_crops(config, out, whole, cameras, places):
    """Make a scene of crops of another one, whose photos and cameras it has."""
    started = time.monotonic()
    originals.check(whole)
    told = prepared.read_poses(whole)
    least = config.min_train_views + 1
    with atomic.scratch_folder(out) as scratch:
        views = loading.read(config, whole, scratch, cameras)
        try:
            views, found, px = crops.placed(views, config, places)
            found, each = crops.around_each(
                views, found, px, least=1 if places else least
            )
        except ValueError as error:
            why = f"{error}. Without crops: `crops: null` in the config"
            raise ValueError(f"{whole}: crops: {why}") from None
        cut = crops.cut_several(views, each)
        prepared.check_views(out, cut)
        log.info(
            "%s: %d crops of %d px of each photo at its own size",
            *(out, len(found), px),
        )
        told["crop"] = {"of": whole.name, "px": px, "points": found}
        if turns := told.get("quarter_turns"):
            photos = [name.rpartition("_w")[0] for name in cut.names]
            named = zip(cut.names, photos, strict=True)
            told["quarter_turns"] = {n: turns[p] for n, p in named if p in turns}
        perturb_px = (
            (told.get("perturb_px") or 0.0) * told["photo_width"] / told["width"]
        )
        prepare.write_views(scratch / "new", cut, split=cut.split)
        told |= {"photo_size": [views.width, views.height]}
        told |= describe_views(cut, (cut.width, cut.height), cut.split, config)
        # Their cameras are those of the scene, with the error that it was given.
        told["perturb_px"] = perturb_px
        told["time_s"] = round(time.monotonic() - started, 1)
        report_path = scratch / "new" / "poses.json"
        report_path.write_text(json.dumps(told, indent=1) + "\n")
        publish(scratch / "new", out)


def for_training(views, config):
    """The views by name, at the resolution of training."""
    return prepare.downscale(prepare.sort_by_name(views), config.downscale)


def with_size(config, views):
    """The config with the `downscale` that the views ask for, where that is open."""
    if config.downscale != "auto":
        return config
    factor = prepare.factor_for(views, MAX_PIXELS, MIN_SIDE_PX)
    log.info("downscale: %d", factor)
    return config.model_copy(update={"downscale": factor})


def perturbed(views, config):
    """Their poses [n, 3, 4] with the config's error: `perturb_px` by `perturb_by`."""
    poses, rng = views.camtoworlds, np.random.default_rng([config.seed, 1])
    px, by, points = config.perturb_px, config.perturb_by, views.points
    return cameras.perturb_poses(
        poses, views.pixtocams, px, rng, by, points and points[0]
    )


def check_cameras(full, scratch, config, adjust):
    """The `capture.Checked` cameras of the views, by photos as large as they are.

    Photos that are trained on as they are keep their lens.
    """
    capture = base.of(config)
    if not capture.trains:
        large = prepare.sort_by_name(capture.at_full_size(config, None, scratch))
        full = large._replace(camtoworlds=full.camtoworlds)
    own, matched = config.poses == "adjusted", None
    adjusts = own or adjust or not capture.trains
    if (scratch / "database.db").is_file():
        matched = checking.matches_of_colmap(scratch, full, seed=config.seed)
    return checking.check(
        full, scratch, config, adjusts=adjusts, lens=own, matched=matched
    )


def with_checked(full, told, checked, scratch, config):
    """The views and the report with what the check of their cameras has found."""
    told = told | {"camera_check": checked.report}
    # By points the unit of such depth is told.
    given = config.external_renders and config.external_renders.depth
    if config.poses == "adjusted" and checked.found:
        where = config.path or config.source
        full = calibration.applied(full, checked.cameras_of(full), where)
        points = checked.found.points
    elif full.points is not None or not (base.of(config).trains or given):
        return full, told
    else:
        points = checking.triangulated(checked, scratch, config.seed)[0]
    if not len(points.positions):
        log.warning("%s: its views share no points", config.path)
        return full._replace(points=None), told
    full = full._replace(points=(points.positions, points.colours))
    return full, told | checking.points_told(points, full, checked.matches)


def write_checked(fresh, views, checked, split, apart):
    """Write matches, and beside the scene's cameras what else there is of them.

    apart: whether adjusted cameras are wanted besides the scene's own: of all views,
    and those of a training, which leave held-out views as they came.
    """
    found = checked.matches
    if views.lens is not None:
        # As the views are now: corrections after this one are judged in their px.
        found = calibration.in_views(found, checked.found.cameras, views)
    matches.write(fresh / matches.FILE, found)
    if views.lens is not None:
        np.savez(fresh / prepared.LENS, **views.lens)
    if not apart:
        return
    folder, now = fresh / prepared.ADJUSTED, checked.cameras_of(views)
    folder.mkdir()
    (folder / "report.json").write_text(json.dumps(checked.report, indent=1) + "\n")
    moved = views._replace(pixtocams=now.pixtocams, camtoworlds=now.camtoworlds)
    prepare.write_cameras(folder / "cameras.npz", moved, split=split)
    stay = (split == "test")[:, None, None]
    both = {
        key: np.where(stay, getattr(views, key), getattr(moved, key))
        for key in ("pixtocams", "camtoworlds")
    }
    prepare.write_cameras(folder / "train.npz", moved._replace(**both), split=split)


def split_of(views, config):
    """Split [n] of the views: by their files, else every `test_every`-th is test."""
    if views.split is None:
        every = base.of(config).every_of(config, len(views.names))
        return prepare.split_views(len(views.names), test_every=every)
    if config.test_every is not None and base.of(config).trains:
        log.warning("test_every: the given file itself says what is held out")
    return views.split


def check_enough(split, least, where):
    """ValueError where too few views are left to learn from."""
    count = int((split == "train").sum())
    if count < least:
        raise ValueError(
            f"{where}: {count} of {len(split)} views to learn from are too few. Take "
            "20 or more photos that overlap, or hold out fewer (test_every, or the "
            "file's own split), or lower min_train_views"
        )


def warn_of_few(out, split):
    """Log now that there are too few views, which the verdict would say at the end."""
    counts = {name: int((split == name).sum()) for name in prepared.SPLITS}
    if counts["train"] < FEW_TRAIN_VIEWS or counts["test"] < FEW_TEST_VIEWS:
        log.warning(
            "%s: %d views to learn from and %d to judge by: under %d and %d no "
            "difference can be told from chance",
            *(out, counts["train"], counts["test"], FEW_TRAIN_VIEWS, FEW_TEST_VIEWS),
        )


def describe_views(views, photo_size, split, config):
    """The part of the report about source, sizes, focal length and split."""
    camtopix = np.linalg.inv(views.pixtocams)
    return {
        "source": config.source,
        "poses": config.poses,
        "width": views.width,
        "height": views.height,
        "photo_width": photo_size[0],
        "photo_height": photo_size[1],
        "downscale": config.downscale,
        "focal_px": [float(camtopix[:, i, i].mean()) for i in (0, 1)],
        "perturb_px": config.perturb_px,
        **{f"{name}_views": int((split == name).sum()) for name in prepared.SPLITS},
    }


def publish(fresh, out):
    """Move what was made into the scene's folder, the report last."""
    for name in PRODUCTS:
        owned.check(out / name)
    for name in PRODUCTS:
        if (fresh / name).exists():
            atomic.move(fresh / name, out / name)
        elif (out / name).exists():
            # Left by another source of the same scene name, and no longer true.
            if (out / name).is_dir():
                owned.check_replaced(out / name)
                owned.remove(out / name)
            else:
                (out / name).unlink()


if __name__ == "__main__":
    values = vars(faults.arguments(None, __doc__, OPTIONS))
    faults.run(lambda: main(json_files.of_config(values.pop("config")), **values))
