"""The config beside the results of a folder, and the options that commands share.

A config is kept where it is a user's. Nothing is written where another run is at work,
where results are of other inputs, or into a user's folder.
"""

import argparse
import hashlib
import logging
import math
import os
import shlex
from pathlib import Path

import yaml

from alignerf.captures import base
from alignerf.cli import folders
from alignerf.experiment import check, sources
from alignerf.experiment.checks import results
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.experiment.keys import scene as scene_keys
from alignerf.io import (
    atomic,
    faults,
    json_files,
    machine,
    owned,
    provenance,
    yaml_files,
)
from alignerf.scenes import photos

log = logging.getLogger("alignerf")

HEAD = """\
# Written by `{command}` for {folder}
# Edit it as you like: changes are kept. All keys: docs/reference/keys.md
# To run it, repeat the command.
# as written: {digest}
"""
# What `make poses` has written, and of which folder.
ADJUSTED = "adjusted/report.json"
# How a folder of photos is given: by make, and to the installed command.
PHOTOS = ("make photos FOLDER={}", "why-blurry photos {}")
# What make has as variables.
PATHS = ("folder", "photos", "renders", "splat", "cameras", "depth")
# What is typed of make, besides options.
USAGE = {
    "demo": "make run [CORES=2] [VERBOSE=1]",
    "photos": 'make photos FOLDER=my_photos [OPTIONS="--name x"]',
    "poses": 'make poses FOLDER=my_scan [OPTIONS="--name x"]',
    "judge": "make judge PHOTOS=images RENDERS=renders|SPLAT=model.ply "
    '[CAMERAS=sparse/0] [DEPTH=depth] [OPTIONS="--name x"]',
    "export": "make export SCENE=my_photos [WIDTH=1600]",
    "clean": "make clean",
}
# What the workflow engine's lock means.
LOCKED = "another run works in this folder, or one was killed. If none works, type:"


def program(command):
    """The name of a command in its own help."""
    made = f"make {command.replace('demo', 'run')}"
    return provenance.typed(made, f"why-blurry {command}")


def parser(command, description, *shared):
    """The parser of a command; shared: options that several have."""
    made = argparse.ArgumentParser(
        prog=program(command),
        usage=provenance.typed(USAGE[command], None),
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    for option in shared:
        made.add_argument(option, **SHARED[option])
    return made


def bounded(kind, least, said):
    """argparse's type of a finite number, `least` or more."""

    def number(text):
        if not (least <= (value := kind(text)) < math.inf):
            raise argparse.ArgumentTypeError(f"{text!r}: {said}")
        return value

    return number


count = bounded(int, 1, "1 or more were expected")
minutes = bounded(float, math.ulp(0), "a number above 0 was expected")


def name(text):
    """A name that files and rules can have."""
    if folders.free(text) != text:
        raise argparse.ArgumentTypeError(
            f"{text!r} is taken, or has other characters than letters, digits, _ and "
            f"-: {folders.free(text)!r} is possible"
        )
    return text


SHARED = {
    "--name": {"type": name, "help": "name of the results; else after the folder"},
    "--cores": {
        "type": count,
        "default": machine.cores(),
        "help": "CPU cores that are used; else all",
    },
    "--background": {
        "choices": sorted(photos.BACKGROUNDS),
        "help": "color behind transparent pixels",
    },
    "--pose-convention": {
        "choices": scene_keys.CONVENTIONS,
        "metavar": "NAME",
        "help": "convention in which the cameras were written by mistake, to convert "
        "them: opencv, ros, xyzw, ...; as_stated: change nothing",
    },
    "--only-config": {
        "action": "store_true",
        "help": "write the config, results/NAME.yaml, and stop",
    },
}


def needed(value, what, make, installed):
    """ValueError where a value is missing, with the whole command as it is typed."""
    if not value:
        raise ValueError(f"{what} is missing: {provenance.typed(make, installed)}")


def remember(command, args):
    """Keep a command, as argparse has read it, for the foot of the page that it makes.

    Of a path from the root the last name alone: the page is sent to others.
    """
    given, options = {}, []
    # `--before none` is read as "".
    none = {"before": "none"} if getattr(args, "before", None) == "" else {}
    for key, value in (vars(args) | none).items():
        if key == "cores" or value in (None, "", False):
            continue
        path, option = str(value), f"--{key.replace('_', '-')}"
        if key in PATHS:
            given[key.upper()] = Path(path).name if os.path.isabs(path) else path
        elif key == "held_out":
            options.append(f"{option} every={value}")
        else:
            options.append(option if value is True else f"{option} {shlex.quote(path)}")
    said = provenance.as_command(command, given, " ".join(options))
    os.environ[provenance.COMMAND] = faults.one_line(said)


def of_photos(args):
    """{key: value} of a scene, of the options that are given."""
    keys = ("background", "pose_convention")
    return {key: value for key in keys if (value := getattr(args, key))}


def unlocking():
    """The command that takes Snakemake's lock of this folder away."""
    words = ["snakemake", "--unlock"]
    if Path.cwd() != sources.PIPELINE:
        words += ["--snakefile", str(sources.PIPELINE / "Snakefile")]
    return shlex.join(words)


def read(path):
    """A config that is there. ValueError, naming it, where it is none."""
    content = yaml_files.read(path)
    instead = "move it away, or give another name (--name)"
    if not isinstance(content, dict):
        raise ValueError(f"{path}: not a config: {instead}")
    if not isinstance(content.get("scenes"), dict):
        raise ValueError(f"{path}: no scenes in it: {instead}")
    return content


def can_export(scene):
    """Whether a scene of a config may have an export; what is wrong is said later."""
    try:
        checked = of_scenes.checked(scene)
    except ValueError:
        return True
    return base.of(checked).can_export(checked)


def say_where(path, config, folder, *, by="photos"):
    """Write the config, and print its path; a config that a user has changed is kept.

    by: the command. Raises ValueError, before anything is written, where what is there
    is of other inputs or another command, or lies in a user's folder.
    """
    check_there(path, config, by)
    if path.exists() and not is_untouched(path):
        there = read(path)
        check.checked(there, [path])
        if differing := sorted(kept(config, there)):
            log.warning("%s: you edited it: its %s is kept", path, ", ".join(differing))
        print(f"config: {path}, as you edited it")
        return
    complete = check.checked(config)
    results.check_folders(complete.scenes, complete.methods)
    text = yaml.safe_dump(config, sort_keys=False, allow_unicode=True)
    head = HEAD.format(
        command=program(by), folder=ascii(str(folder)), digest=digest_of(text)
    )
    with atomic.replace_file(path) as temporary:
        temporary.write_text(head + text, encoding="utf-8")
    print(f"config: {path}")


def check_there(path, config, by):
    """ValueError where results are there already, of other inputs than a config's."""
    other = provenance.typed(
        f'make {by} ... OPTIONS="--name other"',
        f"why-blurry {by} ... --name other",
    )
    instead = f"Give another name: {other}"
    # Runs leave what a config came to, also those by Snakemake itself.
    places = [Path("results", name) for name in config["scenes"]]
    before = [one / "config.yaml" for one in places if owned.is_marked(one)]
    for one in filter(Path.exists, [path, *before]):
        check_same(one, read(one), config, instead)
    for name, place in zip(config["scenes"], places, strict=True):
        report = place / ADJUSTED
        if by == "poses" and report.is_file():
            of = json_files.read(report).get("of")
            check_same(report, {"scenes": {name: {"path": of}}}, config, instead)


def kept(asked, there):
    """Keys of what is asked that a config has otherwise, with those above them."""
    for key, value in asked.items():
        own = there.get(key)
        if isinstance(value, dict) and isinstance(own, dict):
            yield from (f"{key}.{inner}" for inner in kept(value, own))
        elif own != value:
            yield key


def check_same(path, there, config, instead):
    """ValueError where a config's scenes are others than those of `path`, whose results
    would be replaced, or lost from sight.

    instead: what to type.
    """
    for name, before in there["scenes"].items():
        told, scene = inputs_of(path, name, before), config["scenes"].get(name)
        if scene is None:
            # A user may add scenes; and one of several folders may be gone.
            if not is_untouched(path) or not os.path.exists(told.get("path", "")):
                continue
            fault = f"{told['path']}, which is not among those given"
            raise ValueError(f"{path}: scene {name} is of {fault}. {instead}")
        now = inputs_of(path, name, scene)
        if ("renders" in told) != ("renders" in now):
            kinds = ("renders that are judged", "photos to be trained on")
            of, to = kinds if "renders" in told else kinds[::-1]
            raise ValueError(f"{path}: scene {name} is of {of}, not of {to}. {instead}")
        for key, own in told.items():
            if key not in now or os.path.realpath(own) != os.path.realpath(now[key]):
                fault = f"{own}, not of {now.get(key, f'no {key}')}"
                raise ValueError(f"{path}: scene {name} is of {fault}. {instead}")


def inputs_of(path, name, scene):
    """{key: path} of what a config's scene is of; ValueError for one that is none."""
    scene = scene if isinstance(scene, dict) else {}
    if "judged" in scene:
        raise ValueError(
            f"{path}: scenes.{name}.judged is called 'external_renders' now, and so is "
            "source 'judged'"
        )
    judged = scene.get("external_renders")
    found = {"path": scene.get("path")} | (judged if isinstance(judged, dict) else {})
    found = {k: found.get(k) for k in ("path", "renders", "cameras", "depth")}
    for key, own in found.items():
        if own is not None and (not isinstance(own, str) or "\0" in own):
            raise ValueError(
                f"{path}: scenes.{name}.{key}: {faults.shown(own)} is no path"
            )
    return {key: own for key, own in found.items() if own}


def digest_of(text):
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def is_untouched(path):
    """Whether a config is as it was written here."""
    _, mark, rest = faults.text(path).partition("# as written: ")
    digest, _, body = rest.partition("\n")
    return bool(mark) and digest == digest_of(body)
