"""A capture's files for other programs: `make export SCENE=my_photos`.

SCENE is the name of a config of `make photos`, results/my_photos.yaml, or the demo's
scene; the folder of the photos will do too (`FOLDER=my_photos`). What the export needs
and is not there yet is made. WIDTH makes photos smaller.
"""

import argparse
import sys
from pathlib import Path

from alignerf.experiment import targets
from alignerf.files import faults, machine, provenance
from alignerf.start import claims, configs, folders, workflow


def main(argv=None):
    args = parse(argv)
    if not args.name:
        command = provenance.typed(
            "make export SCENE=my_photos", "why-blurry export my_photos"
        )
        raise ValueError(f"SCENE is missing: {command}")
    path = config_of(args.name)
    scenes = scenes_of(path)
    check_judged(path)
    print(f"config: {faults.one_line(str(path))}", flush=True)
    overrides = [f"export_width_px={args.width}"] if args.width else []
    named = None if path == targets.DEMO else path
    with claims.held(path.stem, *scenes):
        code = workflow.run(named, args.cores, "export", overrides=overrides)
    if code:
        sys.exit(code)
    for made in sorted(folder for name in scenes for folder in exports(name)):
        print(f"export: {made}/README.txt")


def config_of(name):
    """The config of a name, or of a folder's. ValueError where there is none."""
    place = folders.at_home(name)
    names = [place.name, folders.name_of(place)]
    for one in names:
        path = Path("results") / f"{one}.yaml"
        if path.is_file():
            return path
    if is_demos(name):
        return targets.DEMO
    photos = provenance.typed(*configs.PHOTOS)
    raise ValueError(
        f"results/{names[-1]}.yaml does not exist: run `{photos.format(name)}` "
        "first, or, for a config of your own, `snakemake --cores "
        f"{machine.cores()} export --configfile FILE`"
    )


def is_demos(name):
    """Whether results/NAME was made by the demo's config."""
    made, demo = Path("results", name, "config.yaml"), configs.read(targets.DEMO)
    if name not in demo["scenes"] or not made.is_file():
        return False
    methods = configs.read(made).get("methods")
    return isinstance(methods, dict) and methods.keys() == demo["methods"].keys()


def scenes_of(path):
    """Names of a config's scenes. ValueError, naming it, where it has none."""
    return list(configs.read(path)["scenes"])


def check_judged(path):
    """ValueError where a config has nothing but renders that cannot be put right."""
    every = configs.read(path)["scenes"].values()
    judged = [one.get("judged") for one in every if isinstance(one, dict)]
    if judged and not any(
        not isinstance(one, dict) or targets.can_put_right(one) for one in judged
    ):
        raise ValueError(
            f"{path}: nothing to export: it wants CAMERAS, and renders of photos that "
            "were learnt from. Judge again with both"
        )


def exports(scene):
    """Folders of a scene's exports that are there."""
    found = Path("results", scene).glob("*/export/*/README.txt")
    return [path.parent for path in found]


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog=configs.program("export"), description=__doc__
    )
    parser.add_argument(
        "name", help="of a config in results/, or its folder; courtyard after the demo"
    )
    parser.add_argument("--width", type=configs.count, help="of photos, in pixels")
    parser.add_argument("--cores", type=configs.count, default=machine.cores())
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
