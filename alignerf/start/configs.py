"""The config beside the results of a folder: written, and kept where it is a user's."""

import argparse
import hashlib
import logging
import math
import os
from pathlib import Path

import yaml

from alignerf.experiment.keys import scene as scene_keys
from alignerf.files import atomic, faults, json_files, owned, provenance, yaml_files
from alignerf.start import claims, folders

log = logging.getLogger("alignerf")

HEAD = """\
# Written by `{command}`, of {folder}
# Yours to edit: then it is kept. Every key: docs/reference/keys.md.
# To run it: the same command again.
# as written: {digest}
"""
# How to give results another name, by what has written the config: by make, and by the
# installed command.
OTHER_NAME = {
    "photos": (
        'make photos FOLDER=... PHOTOS="--name other"',
        "why-blurry photos ... --name other",
    ),
    "poses": (
        'make poses FOLDER=... POSES="--name other"',
        "why-blurry poses ... --name other",
    ),
    "judge": (
        'make judge PHOTOS=... RENDERS=... JUDGE="--name other"',
        "why-blurry judge --photos ... --renders ... --name other",
    ),
}
# What `make poses` has written, and of which folder.
ADJUSTED = "adjusted/report.json"
# How a folder of photos is given: by make, and to the installed command.
PHOTOS = ("make photos FOLDER={}", "why-blurry photos {}")


def program(command):
    """The name of a command in its own help."""
    made = f"make {command.replace('demo', 'run')}"
    return provenance.typed(made, f"why-blurry {command}")


def read(path):
    """A config that is there. ValueError, naming it, where it is none."""
    content = yaml_files.read(path)
    instead = "move it away, or give another name (--name)"
    if not isinstance(content, dict):
        raise ValueError(f"{path}: not a config: {instead}")
    if not isinstance(content.get("scenes"), dict):
        raise ValueError(f"{path}: no scenes in it: {instead}")
    return content


def say_where(path, config, folder, *, by="photos"):
    """Write the config, and log its path; a config that a user has changed is kept.

    by: a key of OTHER_NAME. Raises ValueError, before anything is written, where what
    is there is of other inputs or another command, or lies in a user's folder.
    """
    check_there(path, config, by)
    if path.exists() and not is_untouched(path):
        there = read(path)
        if differing := sorted(kept(config, there)):
            log.warning("%s is yours: its %s is kept", path, ", ".join(differing))
        print(f"config: {path}, as it is there")
        return
    claims.check_free(config)
    text = yaml.safe_dump(config, sort_keys=False, allow_unicode=True)
    command = program(by)
    head = HEAD.format(
        command=command, folder=ascii(str(folder)), digest=digest_of(text)
    )
    with atomic.replace_file(path) as temporary:
        temporary.write_text(head + text, encoding="utf-8")
    print(f"config: {path}")


def check_there(path, config, by):
    """ValueError where results are there already, of other inputs than a config's."""
    instead = f"Give another name: {provenance.typed(*OTHER_NAME[by])}"
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
    judged = scene.get("judged")
    found = {"path": scene.get("path")} | (judged if isinstance(judged, dict) else {})
    found = {k: found.get(k) for k in ("path", "renders", "cameras", "depth")}
    for key, own in found.items():
        if own is not None and (not isinstance(own, str) or "\0" in own):
            raise ValueError(f"{path}: scenes.{name}.{key}: {own!r:.60} is no path")
    return {key: own for key, own in found.items() if own}


def digest_of(text):
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def is_untouched(path):
    """Whether a config is as it was written here."""
    _, mark, rest = faults.text(path).partition("# as written: ")
    digest, _, body = rest.partition("\n")
    return bool(mark) and digest == digest_of(body)


def minutes(text):
    """Minutes of a training: more than none."""
    value = float(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r}: a number above 0 was expected")
    return value


def count(text):
    """A number of pixels, or of cores."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: 1 or more were expected")
    return value


def add_pose_convention(parser):
    """The flag for a mistake of a file of cameras, as commands share it."""
    parser.add_argument(
        "--pose-convention",
        choices=scene_keys.CONVENTIONS,
        help="the mistake of the file of cameras, which is undone; as_stated: none",
    )


def name(text):
    """A name that files and rules can have."""
    if folders.free(text) != text:
        raise argparse.ArgumentTypeError(f"{text!r}: letters, digits and _, and free")
    return text
