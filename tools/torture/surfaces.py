"""Surfaces besides the chain: splats, the Python API, YAML, JSON, removal, plug-ins.

Each is attacked by the generator that its tests have, with as many cases as there is
time for. An attack is a function(case, place, rng) that returns a finding or None.
"""

import contextlib
import json
import logging
import os
import random
import sys
import time
from unittest import mock

import numpy as np

import alignerf
from alignerf.api import diagnosis
from alignerf.cli import clean
from alignerf.io import owned, yaml_files
from alignerf.io.environment import extensions
from alignerf.splats import ply
from tests import damaged_cases, splat_cases
from tests.alignerf.api import test_diagnosis as api
from tests.alignerf.cli import test_clean as removal
from tests.alignerf.io import test_links as links
from tests.alignerf.io.environment import test_extensions as plugs
from tests.alignerf.verdict import test_damaged as verdicts

# A refusal that takes longer was not bounded.
MAX_S = 5.0
TYPES = ("char", "uchar", "short", "ushort", "int", "uint", "float", "double")
TYPES += ("list uchar int", "int128", "")
COUNTS = ("0", "-1", "1", "1e3", "99999999999999999999", "x", "")
SCALARS = ("a", "''", "1e999", "0x_", "2001-01-01", "!!binary x", "!!python/name:os x")
SCALARS += ("&a [*a]", "*a", "<<", "? b", "- -", "{a: 1, a: 2}", "[" * 999, "\x00")
WRONG = (
    None,
    5,
    np.array(5),
    "nowhere",
    b"x",
    [],
    {},
    {1},
    object(),
    "~nouser/x",
    "\0",
)
WRONG += (
    np.ones((3, 4)),
    np.full((3, 40, 40), np.nan),
    np.ones((3, 40, 40, 3), complex),
)
WRONG += ([None] * 3, [[1, [2]]] * 3, True, -1, 10**30, np.zeros((0, 0)), 1e300)


def refused(call, names=("",)):
    """What is wrong with how a call ends; None where it is taken, or said in a line."""
    begun = time.monotonic()
    try:
        call()
    except ValueError as error:
        said = str(error)
        if "\n" in said or not any(name in said for name in names):
            return f"names no file: {said[:200]!r}"
    except BaseException as error:
        return f"traceback: {error!r:.200}"
    took = time.monotonic() - begun
    return f"{took:.0f} s" if took > MAX_S else None


def of_splat(number, place, rng):
    """A .ply, plain or packed, with changes in its head and in its bytes."""
    place.mkdir(parents=True, exist_ok=True)
    path = place / "model.ply"
    splat_cases.write(path, splat_cases.columns(rng, rest=9, count=40))
    if number % 2:
        splat_cases.write_packed(path, ply.read(path))
    head, end, rows = path.read_bytes().partition(b"end_header\n")
    lines = head.decode().splitlines()
    for _ in range(rng.integers(1, 4)):
        at = int(rng.integers(len(lines)))
        words = lines[at].split()
        way = rng.integers(5)
        if way == 0:
            lines.pop(at)
        elif way == 1:
            lines.insert(at, lines[int(rng.integers(len(lines)))])
        elif way == 2 and words[:1] == ["property"]:
            lines[at] = f"property {rng.choice(TYPES)} {words[-1]}"
        elif way == 3 and words[:1] == ["element"]:
            lines[at] = f"element {words[1]} {rng.choice(COUNTS)}"
        else:
            cut = rows[: int(rng.integers(len(rows) + 1))]
            rows = rng.choice([cut, rows + b"\xff" * 9, rng.bytes(len(rows))])
        if not lines:
            break
    path.write_bytes("\n".join([*lines, ""]).encode() + end + bytes(rows))

    def read():
        found = ply.read(path)
        arrays = (found.means, found.scales, found.opacities, found.sh)
        if not all(np.isfinite(one).all() for one in arrays):
            raise ArithmeticError("taken, with numbers that are none")

    fault = refused(read, [path.name])
    return fault and f"a splat {lines}: {fault}"


def of_api(number, place, rng):
    """`alignerf.diagnose` with one or two arguments of another kind."""
    given = {"images": api.IMAGES, "renders": api.IMAGES}
    given |= {"cameras": {"K": api.LENS, "camera_to_world": api.POSES}}
    keys = ("images", "renders", "cameras", "depth", "held_out", "cores", "K", "pose")
    told = {}
    for key in rng.choice(keys, int(rng.integers(1, 3)), replace=False):
        value = told[str(key)] = WRONG[int(rng.integers(len(WRONG)))]
        if key in ("K", "pose") and isinstance(given["cameras"], dict):
            inner = {"K": "K", "pose": "camera_to_world"}[key]
            given["cameras"] = given["cameras"] | {inner: value}
        elif key not in ("K", "pose"):
            given[key] = value
    with mock.patch.object(diagnosis, "run", side_effect=ValueError("taken")):
        fault = refused(lambda: alignerf.diagnose(**given))
    return fault and f"diagnose {told!r:.200}: {fault}"


def of_yaml(number, place, rng):
    """A YAML of anchors, aliases and what else the format has."""
    place.mkdir(parents=True, exist_ok=True)
    lines = ["l0: &l0 [x, x, x, x, x, x, x, x, x]"]
    for level in range(1, int(rng.integers(1, 12))):
        lines.append(f"l{level}: &l{level} [{', '.join([f'*l{level - 1}'] * 9)}]")
    for one in rng.choice(SCALARS, int(rng.integers(1, 5))):
        lines.insert(int(rng.integers(len(lines) + 1)), f"k{len(lines)}: {one}")
    path = place / "x.yaml"
    path.write_text("\n".join(lines), encoding="utf-8")
    fault = refused(lambda: yaml_files.read(path), [path.name])
    return fault and f"YAML {lines!r:.300}: {fault}"


def of_json(number, place, rng):
    """A verdict.json or a poses.json with another value in one place."""
    folder = place / "results" / diagnosis.NAME
    (folder / "tables").mkdir(parents=True, exist_ok=True)
    (folder / "index.html").write_text("<html>")
    (folder / "tables/views.csv").write_text("view,split,psnr_db\na,train,20\n")
    name, read = (
        ("verdict.json", verdicts.read_verdict),
        ("poses.json", verdicts.read_poses),
    )[number % 2]
    choice = random.Random(int(rng.integers(2**31)))
    contents = verdicts.verdicts() if number % 2 == 0 else [json.loads(verdicts.POSES)]
    content = choice.choice(contents)
    at = choice.choice([*damaged_cases.places(content)][1:])
    value = choice.choice(damaged_cases.VALUES)
    (folder / name).write_text(json.dumps(damaged_cases.changed(content, at, value)))
    with contextlib.chdir(place):
        found = [refused(one, [name]) for one in read(folder)]
    fault = next(filter(None, found), None)
    return fault and f"{name} {at} = {value!r:.40}: {fault}"


def of_removal(number, place, rng):
    """Results with a user's files among them, and `make clean`."""
    place.mkdir(parents=True, exist_ok=True)
    with contextlib.chdir(place), contextlib.redirect_stdout(None):
        removal.made("yard")
        folders = sorted({root for root, *_ in os.walk("results")} - {"results"})
        mine = {
            f"{rng.choice(folders)}/{name}"
            for name in rng.choice(removal.THEIRS, int(rng.integers(1, 9)))
        }
        for path in mine:
            removal.write(path, "mine")
        if rng.random() < 0.2:
            folder = str(rng.choice([f for f in folders if owned.is_marked(f)]))
            removal.write(f"{folder}/{owned.MARK}", "" if rng.random() < 0.5 else "[")
        try:
            clean.main([])
        except Exception as error:
            return f"clean: traceback: {error!r:.200}"
        gone = [path for path in mine if not os.path.exists(path)]
    return f"clean: {gone} is gone" if gone else None


def of_links(number, place, rng):
    """Each way of writing, through a link somewhere above."""
    place.mkdir(parents=True, exist_ok=True)
    way = [*links.WAYS][number % len(links.WAYS)]
    with contextlib.chdir(place):
        (place / "disk/deep").mkdir(parents=True, exist_ok=True)
        (place / "disk/a.csv").write_text("mine")
        (place / "disk" / owned.MARK).write_text('["a.csv"]')
        owned.claim("results/yard")
        parts = ["results", "yard", *rng.choice(["a", "b", "c"], rng.integers(0, 4))]
        path = place.joinpath(*parts, "link")
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_symlink():
            path.symlink_to(place / "disk")
        inside = path / str(rng.choice(["", "deep", "new"]))
        fault = refused(lambda: links.WAYS[way](inside), ["a link"])
        lost = (place / "disk/a.csv").read_text() != "mine"
        more = {*os.listdir("disk")} - {"deep", "a.csv", owned.MARK}
    if lost or more:
        return f"{way}: put {more or 'another file'} through a link"
    return fault and f"{way}: {fault}"


def of_plugin(number, place, rng):
    """A package whose object ends the process, or has whatever is asked for."""
    place.mkdir(parents=True, exist_ok=True)
    name = f"plug{int(rng.integers(2**31))}"
    codes = [*plugs.ENDS, plugs.MOCK.format("MagicMock")]
    codes += [plugs.WILD.format(one) for one in ("return self", "1 / 0", "return 1")]
    group, code = rng.choice(plugs.GROUPS), str(rng.choice(codes))
    plugs.package(place, name, group, f"k = {name}:ANY", code)
    sys.path.insert(0, str(place))
    extensions.points.cache_clear()
    try:
        extensions.of_group.__wrapped__(group)
    except SystemExit as end:
        said = str(end.code)
        fault = None if name in said and "\n" not in said else f"said {said!r:.200}"
    except BaseException as error:
        fault = f"traceback: {error!r:.200}"
    else:
        fault = "taken"
    finally:
        sys.path.remove(str(place))
        extensions.points.cache_clear()
    return fault and f"plug-in {code!r} of {group}: {fault}"


def fresh(attack):
    """The attack, each case in a folder of its own."""

    def one(case, place, rng):
        try:
            logging.disable()
            return attack(case, place / str(case), rng)
        finally:
            logging.disable(logging.NOTSET)

    return one


# {what: (its cases, the attack)}.
EVERY = {
    "splats, plain and packed": (range(20_000), fresh(of_splat)),
    "arguments of alignerf.diagnose": (range(10_000), fresh(of_api)),
    "YAML": (range(5_000), fresh(of_yaml)),
    "verdict.json and poses.json": (range(10_000), fresh(of_json)),
    "make clean among a user's files": (range(1_000), fresh(of_removal)),
    "writing through links": (range(2_000), fresh(of_links)),
    "plug-ins": (range(1_000), fresh(of_plugin)),
}
