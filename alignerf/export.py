"""Write cameras and photos for other programs: `python -m alignerf.export`.

One folder with images/, transforms.json (nerfstudio, instant-ngp), sparse/0 (COLMAP,
Gaussian splatting), masks/ where not all pixels count, and a README.txt with the
commands of these programs. Photos have the size that they came in, undistorted, or a
smaller --width; those of crops (`crop`), and of a folder without config.yaml where
--config is missing, the size of training. Where photos are warped, the training views
have the warped photos. Cameras that have moved bring points of their own.
"""

import logging
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.cameras import transients
from alignerf.captures import base
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.exports import formats, held_out, points, readme, warps, written
from alignerf.io import atomic, faults, json_files
from alignerf.judged import originals
from alignerf.scenes import prepare, prepared

log = logging.getLogger("alignerf")


class Chosen(NamedTuple):
    """What goes out: views with cameras, and how they came about.

    fitted: names of the held-out views whose cameras are. moved: whether cameras are
    others than the scene's; corrected: whether those of training views are; adjusted:
    whether all are those of bundle adjustment. warped: whether photos are. unknown:
    whether how they are warped is not on disk, so that they have the size of training.
    """

    views: prepare.PosedViews
    fitted: list[str]
    moved: bool
    corrected: bool
    adjusted: bool
    warped: bool
    unknown: bool


OPTIONS = {
    "scene": "prepared scene folder",
    "[config]": "its keys as JSON (default: its config.yaml)",
    "[width]": ("of photos; never more than theirs", int),
    "[cameras]": "cameras.npz (default: the scene's)",
    "[warped]": "folder of warped photos of training views",
    "[valid]": "folder of <view>.npz: valid pixels, and the flow that warped",
    "[fit-held-out]": (
        "folders of test views: their cameras are fitted to their photos",
        {"nargs": 2, "metavar": ("FLOW", "DEPTH")},
    ),
    "[transients]": "transients.npz: what comes and goes is masked",
    "[adjusted]": "adjusted cameras.npz, taken where held-out matches accept them",
    "[corrected-by]": "poses_corrected.json of --cameras, where FLOW is from before",
    "[if-pays]": (
        "verdict.json and a method: where that brought nothing, all is as given",
        {"nargs": 2, "metavar": ("VERDICT", "METHOD")},
    ),
    "out": "folder, written",
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    if (args.warped is None) != (args.valid is None):
        raise ValueError("--warped and --valid go together")
    if args.adjusted and is_accepted(args.scene):
        # They fit held-out photos as well as all others.
        args.cameras, args.fit_held_out = args.adjusted, None
    paid = not args.if_pays or pays(*args.if_pays)
    if not paid:
        args.cameras = args.warped = args.valid = args.fit_held_out = None
    config = written.config_of(args.config, args.scene)
    config = config and of_scenes.checked(config)
    out = Path(args.out)
    with (
        atomic.replace_folder(out) as folder,
        atomic.scratch_folder(out.parent, name="export") as work,
    ):
        chosen = choose(args, config, work)
        found = transients.read(args.transients) if args.transients else {}
        hidden = {name: partial(transients.of_photo, found[name]) for name in found}
        alpha = is_synthetic(args.scene)
        masked = written.write(folder, chosen.views, alpha=alpha, hidden=hidden)
        arrays = written.arrays_of(chosen.views)
        agreeing = np.arange(len(chosen.views.names))
        if chosen.moved and not chosen.adjusted:
            agreeing = points.agreeing(arrays, chosen.fitted)
        model, of_points = points.of(
            folder,
            work,
            arrays,
            chosen.views.points,
            seed=config.seed if config else 0,
            moved=chosen.moved,
            views=agreeing,
        )
        formats.write_colmap(folder, model, arrays)
        formats.write_transforms(
            folder / "transforms.json",
            arrays,
            masked=masked,
            points=(folder / formats.POINTS).is_file(),
            fitted=chosen.fitted,
        )
        told = readme.text(folder, args, arrays, chosen, of_points, paid=paid)
        (folder / "README.txt").write_text(told, encoding="utf-8")


def choose(args, config, work) -> Chosen:
    """The views that go out, at their size; nothing is read of their photos yet.

    work: a folder, written into.
    """
    loaded = prepared.load(args.scene, args.cameras)
    own = loaded.folder / "cameras.npz"
    path, fitted = Path(args.cameras or own), []
    if args.fit_held_out:
        to, path = path, work / "cameras.npz"
        flow, depth = args.fit_held_out
        frame = args.corrected_by and held_out.frame_of(args.corrected_by)
        fitted = held_out.fit(loaded, to, flow, depth, path, frame)
    names = [loaded.names[view] for view in loaded.views("train")]
    known = not args.warped or warps.are_known(names, args.valid)
    full = config is not None and not base.of(config).parent(config)
    if full and known:
        originals.check(loaded.folder)
        (work / "photos_work").mkdir()
        views = written.of_photos(config, loaded.folder, work / "photos_work", path)
    else:
        views = written.as_trained(loaded, path)
    if args.warped and full and not known:
        log.warning(
            "%s does not say how photos were warped: they go out at the size of "
            "training",
            args.valid,
        )
    if args.warped and full and known:
        views = warps.at_full_size(views, args.valid)
    elif args.warped:
        views = warps.as_trained(views, loaded, args.warped, args.valid)
    given, now = prepared.read_cameras(own), prepared.read_cameras(path)
    moved = written.has_moved(given, now)
    corrected = written.has_moved(given, now, loaded.views("train"))
    views = written.at_width(views, args.width)
    warped = bool(args.warped)
    adjusted = args.cameras is not None and args.cameras == args.adjusted
    flags = moved, corrected, adjusted, warped, full and not known
    return Chosen(views, fitted, *flags)


def pays(verdict, method):
    """Whether verdict.json says that a method's alignment paid; logged where not."""
    kinds = {"gains": [{"method": str, "pays": bool}]}
    gains = json_files.read(verdict, kinds)["gains"]
    if any(gain["method"] == method and gain["pays"] for gain in gains):
        return True
    log.warning("%s: all goes out as given", readme.DID_NOT_PAY.format(method=method))
    return False


def is_accepted(scene):
    """Whether held-out matches have accepted adjusted cameras, by its poses.json."""
    told = prepared.adjustment_of(prepared.read_poses(scene, prepared.MORE))
    return prepared.is_accepted(told)


def is_synthetic(scene):
    """Whether a scene is one of NeRF's synthetic ones, as its poses.json says."""
    report = Path(scene) / "poses.json"
    if not report.is_file():
        return False
    return prepared.read_poses(scene, prepared.MORE).get("source") == "blender"


if __name__ == "__main__":
    faults.run(main)
