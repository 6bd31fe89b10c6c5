"""From a folder of photos to its page: `make photos FOLDER=my_photos`.

FOLDER holds photos (also HEIC), films, or photos with cameras by another program
(transforms.json, sparse/0, poses_bounds.npy) or an app (Polycam's raw data, 3d Scanner
App's All Data, Record3D's EXR + JPG), or several such folders. A config is written
beside the results; it is yours to edit, and is kept the next time.
"""

import argparse
import hashlib
import logging
import sys
from pathlib import Path

import yaml

from alignerf.experiment import targets
from alignerf.files import atomic, faults, machine, yaml_files
from alignerf.scenes import photos
from alignerf.start import folders, workflow

log = logging.getLogger("alignerf")

HEAD = """\
# Written by `make photos`, of {folder}
# Yours to edit: then it is kept. Every key: alignerf/experiment/keys/.
# To run it: the same command again.
# as written: {digest}
"""


def main(argv=None):
    args = parse(argv)
    if not args.folder:
        raise ValueError("FOLDER is missing: make photos FOLDER=my_photos")
    folder = Path(args.folder).expanduser()
    scenes = folders.scenes_of(folder)
    name = args.name or folders.name_of(folder)
    if args.name and len(scenes) == 1:
        scenes = {args.name: next(iter(scenes.values()))}
    scenes = folders.with_colmap(scenes)
    path = Path("results") / f"{name}.yaml"
    say_where(path, config_of(scenes, args), folder)
    scenes = still_in(path, scenes)
    for scene, content in scenes.items():
        by = " by COLMAP" if content.get("poses") == folders.BY_COLMAP else ""
        place = faults.one_line(content["path"])
        print(f"{scene}: {content['source']} in {place}{by}")
    say_twice(path, scenes)
    print(f"page, in the end: {', '.join(map(targets.page_of, scenes))}", flush=True)
    # Its files for other programs, too: cameras put right, or as given.
    if not args.only_config and (
        code := workflow.run(path, args.cores, "all", "export")
    ):
        sys.exit(code)


def still_in(path, scenes):
    """The scenes that a config has: a user may have deleted others."""
    there = yaml_files.read(path).get("scenes")
    return {name: one for name, one in scenes.items() if name in (there or {})}


def say_twice(path, scenes):
    """Print that a phone's photos are trained with two kinds of poses, and the cost."""
    if again := [s for s, one in scenes.items() if one.get("poses")]:
        print(
            f"poses of the phone: expect pixels of error. {', '.join(again)} has "
            "COLMAP's beside them, at twice the time: to leave it out, delete it under "
            f"scenes in {path} (--only-config writes that and stops)"
        )


def config_of(scenes, args):
    """The config of scenes; the keys that it leaves out follow from the photos."""
    if args.background:
        scenes = {n: s | {"background": args.background} for n, s in scenes.items()}
    methods = {"plain": {}, "aligned": {"align": {}}}
    config = {"decide": True, "scenes": scenes, "methods": methods, "windows": {}}
    if args.budget_min:
        config["training"] = {"budget_min": args.budget_min}
    return config


def say_where(path, config, folder):
    """Write the config, and log its path; a config that a user has changed is kept.

    Raises ValueError where the kept config is of other folders or other arguments.
    """
    if path.exists():
        there = yaml_files.read(path)
        check_same(path, there, config)
        if not is_untouched(path):
            asked = {key: value for key, value in config.items() if key != "scenes"}
            if differing := [k for k, v in asked.items() if there.get(k) != v]:
                log.warning("%s is yours: its %s is kept", path, ", ".join(differing))
            print(f"config: {path}, as it is there")
            return
    text = yaml.safe_dump(config, sort_keys=False, allow_unicode=True)
    head = HEAD.format(folder=ascii(str(folder)), digest=digest_of(text))
    with atomic.replace_file(path) as temporary:
        temporary.write_text(head + text, encoding="utf-8")
    print(f"config: {path}")


def check_same(path, there, config):
    """ValueError where a config's scenes are of other folders: results would mix."""
    scenes = there.get("scenes")
    for name, scene in config["scenes"].items():
        before = scenes.get(name) if isinstance(scenes, dict) else None
        own = before.get("path") if isinstance(before, dict) else None
        if own is not None and Path(own).resolve() != Path(scene["path"]).resolve():
            raise ValueError(
                f"{path}: scene {name} is of {own}, not of {scene['path']}. Give "
                'another name: make photos FOLDER=... PHOTOS="--name other"'
            )


def digest_of(text):
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def is_untouched(path):
    """Whether a config is as it was written here."""
    text = path.read_text(encoding="utf-8")
    _, mark, rest = text.partition("# as written: ")
    digest, _, body = rest.partition("\n")
    return bool(mark) and digest == digest_of(body)


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.start", description=__doc__)
    parser.add_argument("folder", help="photos or films, or folders of such")
    parser.add_argument(
        "--name", type=name, help="of the scene, instead of its folder's"
    )
    parser.add_argument("--cores", type=int, default=machine.cores())
    parser.add_argument(
        "--background", choices=sorted(photos.BACKGROUNDS), help="behind alpha"
    )
    parser.add_argument("--budget-min", type=float, help="minutes of each training")
    parser.add_argument("--only-config", action="store_true", help="do not run it")
    return parser.parse_args(argv)


def name(text):
    """A name that files and rules can have."""
    if folders.name_of(text) != text:
        raise argparse.ArgumentTypeError(f"{text!r}: letters, digits and _, and free")
    return text


if __name__ == "__main__":
    faults.run(main)
