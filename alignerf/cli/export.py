"""Write photos, cameras and points for other programs: `make export SCENE=my_photos`.

SCENE is the name of results, as in results/my_photos.yaml, or the folder of the photos;
courtyard after the demo. What is missing for the export is computed first. WIDTH makes
the photos smaller.
"""

import contextlib
import difflib
import shlex
import sys
from pathlib import Path

from alignerf.captures import typed
from alignerf.cli import configs, folders, workflow
from alignerf.experiment import targets
from alignerf.experiment.checks import results
from alignerf.experiment.tables import shipped
from alignerf.io import faults, machine, provenance


def main(argv=None):
    args = parse(argv)
    example = ("make export SCENE=my_photos", "why-blurry export my_photos")
    configs.needed(args.name, "SCENE", *example)
    path = config_of(args.name)
    scenes = configs.read(path)["scenes"]
    check_judged(path, scenes.values())
    print(f"config: {faults.one_line(str(path))}", flush=True)
    overrides = [f"export_width_px={args.width}"] if args.width else []
    named = None if path == shipped.DEMO else path
    with results.held(path.stem, *map(str, scenes)):
        code = workflow.run(named, args.cores, "export", overrides=overrides)
    if code:
        sys.exit(code)
    for name in scenes:
        for made in sorted(Path("results", name).glob("*/export/*/README.txt")):
            print(f"export: {made}")
            place = shlex.quote(str(made.parent.resolve()))
            print(f"  next: ns-train splatfacto --data {place}, or as README.txt says")


def config_of(name):
    """The config of a name, or of a folder's. ValueError where there is none."""
    place = typed.at_home(name)
    with contextlib.suppress(ValueError):
        place = typed.meant(place)
    names = [place.name, folders.name_of(place)]
    for one in names:
        path = Path("results") / f"{one}.yaml"
        if path.is_file():
            return path
    if is_demos(name):
        return shipped.DEMO
    photos = provenance.typed(*configs.PHOTOS)
    known = sorted(one.stem for one in Path("results").glob("*.yaml"))
    known += filter(is_demos, targets.demo_scenes())
    near = difflib.get_close_matches(names[-1], known, 1)
    there = f"; there is {', '.join(near or known)}" if known else ""
    raise ValueError(
        f"results/{names[-1]}.yaml does not exist{there}: run `{photos.format(name)}` "
        "first, or, for a config of your own, `snakemake --cores "
        f"{machine.cores()} export --configfile FILE`"
    )


def is_demos(name):
    """Whether results/NAME was made by the demo's config."""
    made, demo = Path("results", name, "config.yaml"), configs.read(shipped.DEMO)
    if name not in demo["scenes"] or not made.is_file():
        return False
    methods = configs.read(made).get("methods")
    return isinstance(methods, dict) and methods.keys() == demo["methods"].keys()


def check_judged(path, scenes):
    """ValueError where scenes are nothing but renders that cannot be corrected."""
    if not any(map(configs.can_export, scenes)):
        raise ValueError(
            f"{path}: nothing to export: CAMERAS was not given, or no render is of a "
            "training photo. Judge again with both"
        )


def parse(argv=None):
    """Arguments of the command line."""
    parser = configs.parser("export", __doc__, "--cores")
    parser.add_argument(
        "name", help="name of results, or folder of photos; courtyard after the demo"
    )
    parser.add_argument(
        "--width", type=configs.count, help="width of the photos, in pixels"
    )
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
