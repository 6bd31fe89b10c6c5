"""Grown folders, spoilt at random, and oracles that know what may come of them.

No list of expected results is kept. A case is refused in one short line that names what
is wrong, or taken: then no photo is both trained on and scored, and every photo of the
folder is used or named.
"""

import contextlib
import io
import logging
import os
import re
import shutil
import traceback
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np

from alignerf import poses
from alignerf.colmap import ingest, video
from alignerf.io import faults, images
from alignerf.scenes import photos, prepared
from tools.torture import damage, grown

MAX_MUTATIONS = 3
MAX_LETTERS = 1200
# Sources that take every photo of some folders.
ALL_OF = {
    "photos": ("taken", "masks"),
    "mipnerf360": ("images",),
    "llff": ("images",),
    "polycam": ("keyframes/images",),
    "record3d": ("rgb",),
    "external_renders": ("photos", "renders"),
}
WANTED = photos.SUFFIXES | video.SUFFIXES


class Case(NamedTuple):
    """A folder by its seed, and what happens to it: (mutation, seed) each."""

    source: str
    seed: int
    steps: tuple = ()


class Done(NamedTuple):
    """What came of a case: a fault or None, all that was said, files opened."""

    fault: Exception | None
    said: str
    opened: set


OPENED = set()


def note_opened(event, arguments):
    if event == "open" and isinstance(arguments[0], str | os.PathLike):
        OPENED.add(os.path.basename(os.fspath(arguments[0])))


def cases_of(source, seed, count):
    """As many cases of a source; the same for the same seed."""
    rng = np.random.default_rng([seed, sorted(grown.SOURCES).index(source)])
    names = list(damage.MUTATIONS)
    for _ in range(count):
        steps = [
            (names[rng.integers(len(names))], int(rng.integers(2**31)))
            for _ in range(rng.integers(1, MAX_MUTATIONS + 1))
        ]
        yield Case(source, int(rng.integers(2**31)), tuple(steps))


def build(case, folder):
    """(the scene's keys, in words what was done) of a case, in a new folder."""
    keys = grown.SOURCES[case.source](folder, np.random.default_rng(case.seed))
    done = []
    for name, seed in case.steps:
        words = damage.MUTATIONS[name](folder, np.random.default_rng(seed))
        done.append(words and f"{name}: {words}")
    return keys, [one for one in done if one]


def take(case, keys, work):
    """Let the program take a folder; COLMAP, which takes seconds, is left out."""
    if case.source == "photos":
        work.mkdir()
        ingest.ingest(keys["path"], work, masks=keys["masks"])
        return
    config = {"source": case.source, "min_train_views": 1, "downscale": 1} | keys
    if case.source != "external_renders":
        config["triangulate"] = False
    poses.main(config, work)


def run(case, keys, work) -> Done:
    said, fault = io.StringIO(), None
    handler = logging.StreamHandler(said)
    logging.getLogger().addHandler(handler)
    OPENED.clear()
    try:
        # All names, where a message has three of them.
        every = mock.patch.object(faults, "some_names", ", ".join)
        with contextlib.redirect_stderr(said), every:
            take(case, keys, work)
    except Exception as error:
        fault = error
    finally:
        logging.getLogger().removeHandler(handler)
    return Done(fault, said.getvalue(), set(OPENED))


def finding_of(case, place):
    """(what is wrong or None, what was done) of a case, in a folder of its own."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    keys, words = build(case, place / "in")
    return judge(case, run(case, keys, place / "out"), place), words


def judge(case, done, place):
    """What is wrong with what came of a case; None where nothing is."""
    if isinstance(done.fault, ValueError | OSError):
        return of_refusal(str(done.fault), place)
    if done.fault is not None:
        where = traceback.extract_tb(done.fault.__traceback__)[-1]
        kind = type(done.fault).__name__
        return (
            f"{kind} at {Path(where.filename).name}:{where.lineno}: {done.fault!s:.80}"
        )
    if case.source != "photos" and (found := of_scene(place / "out", done.said)):
        return found
    return of_files(case, done, place)


def of_refusal(message, place):
    """A refusal is one short line that prints, and names a place or a key."""
    if len(message) > MAX_LETTERS:
        return f"a message of {len(message)} letters"
    if not message.isprintable():
        return f"a message that does not print: {message!r:.200}"
    if str(place) not in message and "config" not in message and "'" not in message:
        return f"names nothing: {message:.100}"
    return None


def of_scene(out, said):
    """A scene loads, and shows no photo both in training and in scoring."""
    try:
        scene = prepared.load(out)
    except ValueError as error:
        return f"made what does not load: {error!s:.100}"
    seen = {}
    for name, split in zip(scene.names, scene.split, strict=True):
        content = images.read(out / "images" / f"{name}.png").tobytes()
        other = seen.setdefault(content, (name, split))
        if other[1] != split and "equal files" not in said:
            return f"{other[0]} ({other[1]}) and {name} ({split}) show one photo"
    return None


def of_files(case, done, place):
    """Every photo, film and mask was opened, or was spoken of."""
    told = done.said
    report = place / "out" / "poses.json"
    told += report.read_text() if report.is_file() else ""
    for inner in ALL_OF.get(case.source, ()):
        for path in (place / "in" / inner).glob("*"):
            known = path.suffix.lower() in WANTED and path.name[0] != "."
            # Renders may lie in folders of any name.
            known &= not (case.source == "external_renders" and path.is_dir())
            if known and path.name not in done.opened and not speaks_of(told, path):
                return f"{path.name!r} is neither used nor named"
    return None


def speaks_of(told, path):
    """Whether a file is named, whole or by its view, and not as a part of another."""
    names = {path.name, path.stem, ascii(path.name)[1:-1], ascii(path.stem)[1:-1]}
    # As views of Record3D are called.
    names |= {path.stem.zfill(6)} if path.stem.isdecimal() else set()
    either = "|".join(map(re.escape, names))
    return re.search(rf"(?<![\w.])({either})(?![\w.])", told) is not None
