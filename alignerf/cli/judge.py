"""Judge another program's renders: `make judge PHOTOS=... RENDERS=... CAMERAS=...`.

PHOTOS: folder of the photos. RENDERS: of the program's renders of these views, those
that it has learnt and those that it has not. CAMERAS: transforms.json, COLMAP's
sparse/0 or cameras.json, or their folder. DEPTH: folder of the renders' depth. Nothing
is trained. A config is written beside the results; it is yours to edit.
"""

import sys
from pathlib import Path

from alignerf.captures import base
from alignerf.cli import configs, folders, workflow
from alignerf.experiment import targets
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import faults
from alignerf.scenes import originals, prepared
from alignerf.scenes.external import depths, views

# The name of the method that the renders are of.
THEIRS = "theirs"
# Above so many pixels in all pairs the usual estimator takes too long: of 100 pairs of
# 1600x1200 px it takes half an hour, and `dis_fine` a quarter of that.
MAX_PIXELS, LARGE = 25_000_000, "dis_fine"


def main(argv=None):
    args = parse(argv)
    for name in ("photos", "renders"):
        configs.needed(
            getattr(args, name),
            name.upper(),
            "make judge PHOTOS=photos RENDERS=renders CAMERAS=sparse/0",
            "why-blurry judge --photos photos --renders renders --cameras sparse/0",
        )
    name = args.name or folders.name_of(folders.at_home(args.renders))
    check_before(args.before, name)
    with configs.held(name):
        run(name, args)


def run(name, args):
    """Find the pairs, write the config, and run it."""
    path = Path("results") / f"{name}.yaml"
    scene = scene_of(args)
    judged = views.find(of_scenes.checked(scene))
    splits = views.splits_of(judged)
    there = [split for split in prepared.SPLITS if split in splits.values()]
    scene |= {
        "external_renders": base.section(scene, "external_renders") | {"splits": there}
    }
    print(f"{len(judged.pairs)} pairs of photo and render, {judged.told['layout']}")
    configs.say_where(path, config_of(name, scene, judged), args.renders, by="judge")
    print(f"page, in the end: {targets.page_of(name)}", flush=True)
    if args.only_config:
        return
    if code := workflow.run(
        path, args.cores, "all", forced=forced(name, scene, judged)
    ):
        sys.exit(code)


def scene_of(args):
    """The scene's keys; splits are those that there may be."""
    paths = {key: getattr(args, key) for key in ("renders", "cameras", "depth")}
    judged = {key: str(folders.at_home(path)) for key, path in paths.items() if path}
    if args.before:
        judged["before"] = str(Path("results", args.before, "verdict.json"))
    for key in ("depth_kind", "depth_scale"):
        if (value := getattr(args, key)) is not None:
            judged[key] = value
    scene = {"source": "external_renders", "path": str(folders.at_home(args.photos))}
    return scene | configs.of_photos(args) | {"external_renders": judged}


def check_before(before, name):
    """ValueError where there is no such judgement, or where it is to be written."""
    if before is None:
        return
    path = Path("results", before, "verdict.json")
    if before == name:
        raise ValueError(
            f"--before {before}: these results have that name, and replace what was "
            "there: give them another by --name"
        )
    if not path.is_file():
        raise ValueError(f"--before {before}: {path} does not exist")


def config_of(name, scene, judged):
    """The config of renders that are judged."""
    width, height = judged.size
    external = {"renders": base.section(scene, "external_renders")["renders"]}
    config = {
        "preflight": False,
        "scenes": {name: scene},
        "methods": {THEIRS: {"external": external}},
        "reference": {"method": THEIRS, "round": 0},
    }
    if len(judged.pairs) * width * height > MAX_PIXELS:
        config["flow"] = {"estimator": LARGE, "blur_by": "dis_fast"}
    return config


def forced(name, scene, judged):
    """What is to be made anew: the pairs, where one of their files has changed."""
    place = Path("results", name)
    files = map(
        originals.named, views.files_of(judged, base.section(scene, "external_renders"))
    )
    noted = originals.noted(place)
    same = set(files) == set(noted) and not originals.changed(place)
    return (str(place / "poses.json"),) if noted and not same else ()


def parse(argv=None):
    """Arguments of the command line."""
    shared = ("--name", "--cores", "--background", "--pose-convention", "--only-config")
    parser = configs.parser("judge", __doc__, *shared)
    parser.add_argument("--photos", default="", help="folder of photos")
    parser.add_argument("--renders", default="", help="folder of renders")
    parser.add_argument("--cameras", default="", help="file or folder of cameras")
    parser.add_argument("--depth", default="", help="folder of depths")
    parser.add_argument(
        "--depth-kind",
        choices=depths.KINDS,
        help="along the optical axis, or distance along the ray (nerfacto's)",
    )
    parser.add_argument(
        "--depth-scale", type=float, help="what brings it to the unit of the cameras"
    )
    parser.add_argument(
        "--before",
        type=configs.name,
        help="name of results that these are compared with",
    )
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
