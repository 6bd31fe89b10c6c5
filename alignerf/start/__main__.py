"""From a folder of photos to its page: `make photos FOLDER=my_photos`.

FOLDER holds photos (also HEIC), films, or photos with cameras by another program
(transforms.json, sparse/0, poses_bounds.npy), or several such folders. A config is
written beside the results; it is yours to edit, and is kept the next time.
"""

import argparse
import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import yaml

from alignerf.command import faults, machine, whole
from alignerf.experiment import sources, targets
from alignerf.scenes import photos
from alignerf.start import folders

HEAD = """\
# Written by `make photos FOLDER={folder}`. Yours to edit: it is kept. Every key:
# alignerf/experiment/settings.py. To run it again: the same command.
"""


def main(argv=None):
    args = parse(argv)
    if not args.folder:
        raise ValueError("FOLDER is missing: make photos FOLDER=my_photos")
    found = folders.scenes_of(args.folder)
    path = Path("results") / f"{folders.name_of(args.folder)}.yaml"
    for name, scene in found.items():
        print(f"{name}: {scene['source']} in {scene['path']}")
    if path.exists():
        print(f"config: {path}, as it is there")
    else:
        write(path, config_of(found, args), args.folder)
        print(f"config: {path}")
    print(f"page, in the end: {', '.join(map(targets.page_of, found))}", flush=True)
    if not args.only_config and (code := run(path, args.cores)):
        sys.exit(code)


def config_of(scenes, args):
    """The config of scenes; what it leaves out follows from the photos."""
    if args.background:
        scenes = {n: s | {"background": args.background} for n, s in scenes.items()}
    config = {"decide": True, "scenes": scenes}
    if args.budget_min:
        config["training"] = {"budget_min": args.budget_min}
    return config


def write(path, config, folder):
    """Write a config that says where it comes from."""
    text = yaml.safe_dump(config, sort_keys=False, allow_unicode=True)
    # A name may hold a line's end.
    head = HEAD.format(folder=" ".join(str(folder).split()))
    with whole.replace_file(path) as temporary:
        temporary.write_text(head + text, encoding="utf-8")


def run(path, cores):
    """Run a config as `make run` does the default one; returns the exit code."""
    profile = sources.ROOT / "workflow" / "profiles" / "default"
    command = [sys.executable, "-m", "snakemake", "--cores", str(cores)]
    command += ["--snakefile", str(sources.ROOT / "Snakefile")]
    command += ["--workflow-profile", str(profile), "--configfile", str(path)]
    child = subprocess.Popen(command, env=os.environ)
    while True:
        # Ctrl-C reaches it too: it ends its jobs, and is waited for.
        with contextlib.suppress(KeyboardInterrupt):
            code = child.wait()
            break
    if code == -signal.SIGINT or code == 128 + signal.SIGINT:
        print("stopped; the same command goes on", file=sys.stderr)
    return code if code >= 0 else 128 - code


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.start", description=__doc__)
    parser.add_argument("folder", help="photos or films, or folders of such")
    parser.add_argument("--cores", type=int, default=machine.cores())
    parser.add_argument(
        "--background", choices=sorted(photos.BACKGROUNDS), help="behind alpha"
    )
    parser.add_argument("--budget-min", type=float, help="minutes of each training")
    parser.add_argument("--only-config", action="store_true", help="do not run it")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
