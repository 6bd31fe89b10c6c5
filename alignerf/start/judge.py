"""Judge another program's renders: `make judge PHOTOS=... RENDERS=... CAMERAS=...`.

PHOTOS: folder of the photos. RENDERS: of the program's renders of these views, those
that it has learnt and those that it has not. CAMERAS: transforms.json, COLMAP's
sparse/0 or cameras.json, or their folder. DEPTH: folder of the renders' depth. Nothing
is trained. A config is written beside the results; it is yours to edit.
"""

import argparse
import logging
import sys
from pathlib import Path

from alignerf.experiment import targets
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.files import faults, machine, provenance
from alignerf.scenes import photos, prepared
from alignerf.scenes.judged import views
from alignerf.start import configs, folders, workflow

log = logging.getLogger("alignerf")

# The name of the method that the renders are of.
THEIRS = "theirs"
# Above so many pixels in all pairs the usual estimator takes too long: of 100 pairs of
# 1600x1200 px it takes half an hour, and `dis_fine` a quarter of that.
MOST_PIXELS, LARGE = 25_000_000, "dis_fine"


def main(argv=None):
    args = parse(argv)
    for name in ("photos", "renders"):
        if not getattr(args, name):
            command = provenance.typed(
                "make judge PHOTOS=photos RENDERS=renders CAMERAS=sparse/0",
                "why-blurry judge --photos photos --renders renders --cameras sparse/0",
            )
            raise ValueError(f"{name.upper()} is missing: {command}")
    scene = scene_of(args)
    judged = views.find(of_scenes.checked(scene))
    splits = views.splits_of(judged)
    scene["judged"]["splits"] = [s for s in prepared.SPLITS if s in splits.values()]
    print(f"{len(judged.pairs)} pairs of photo and render, {judged.told['layout']}")
    name = args.name or folders.name_of(folders.at_home(args.renders))
    path = Path("results") / f"{name}.yaml"
    configs.say_where(path, config_of(name, scene, judged), args.renders)
    print(f"page, in the end: {targets.page_of(name)}", flush=True)
    if args.only_config:
        return
    if code := workflow.run(path, args.cores, "all", forced=forced(name, judged)):
        sys.exit(code)


def scene_of(args):
    """The scene's keys; splits are those that there may be."""
    paths = {key: getattr(args, key) for key in ("renders", "cameras", "depth")}
    judged = {key: str(folders.at_home(path)) for key, path in paths.items() if path}
    scene = {"source": "judged", "path": str(folders.at_home(args.photos))}
    if args.background:
        scene["background"] = args.background
    return scene | {"judged": judged}


def config_of(name, scene, judged):
    """The config of renders that are judged."""
    width, height = judged.size
    config = {
        "preflight": False,
        "scenes": {name: scene},
        "methods": {THEIRS: {"external": {"renders": scene["judged"]["renders"]}}},
        "reference": {"method": THEIRS, "round": 0},
    }
    if len(judged.pairs) * width * height > MOST_PIXELS:
        config["flow"] = {"estimator": LARGE, "blur_by": "dis_fast"}
    return config


def forced(name, judged):
    """The rules to run anew: that of the pairs, where a file of theirs is newer."""
    made = Path("results", name, "poses.json")
    if not made.is_file():
        return ()
    files = [path for pair in judged.pairs for path in (pair.photo, pair.render.path)]
    newest = max(path.stat().st_mtime for path in files)
    return ("poses",) if newest > made.stat().st_mtime else ()


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog=configs.program("judge"),
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--photos", default="", help="folder of photos")
    parser.add_argument("--renders", default="", help="folder of renders")
    parser.add_argument("--cameras", default="", help="file or folder of cameras")
    parser.add_argument("--depth", default="", help="folder of depths")
    parser.add_argument("--name", type=configs.name, help="of the results")
    parser.add_argument("--cores", type=configs.count, default=machine.cores())
    parser.add_argument(
        "--background", choices=sorted(photos.BACKGROUNDS), help="behind alpha"
    )
    parser.add_argument("--only-config", action="store_true", help="do not run it")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
