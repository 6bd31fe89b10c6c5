"""COLMAP's matching beside other work: the same pairs and matches on every run.

With several threads, pycolmap 4.2.1 loses nearly all matches of a pair now and then,
about one in 400 where other processes take the cores. Nothing says so. And it finds
other photos that look alike while it matches.
"""

import contextlib
import os
import shutil
import sqlite3
import subprocess
import sys
from collections import Counter, defaultdict
from unittest import mock

import pycolmap

from alignerf.files import images
from alignerf.scenes.capture import mapping
from alignerf.scenes.courtyard import scene as courtyard

VIEWS, SIZE = 56, (240, 180)
RUNS = 8
PAIRS = RUNS * VIEWS * (VIEWS - 1) // 2


def beside_others(reference, folder):
    """All pairs of photos, and of many photos those that look alike.

    Matches of each pair are the same in all runs, while every core is busy.
    """
    database = features(folder / "matching")
    busy = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"])
        for _ in range(os.cpu_count())
    ]
    try:
        found = repeated(database, "all")
        with mock.patch.multiple(mapping, MOST_EXHAUSTIVE=0, FOLLOWING=1, ALIKE=5):
            return found + repeated(database, "alike")
    finally:
        for child in busy:
            child.kill()
            child.wait()


def repeated(database, name):
    """What differs between runs on copies of a database."""
    seen = defaultdict(Counter)
    for run in range(RUNS):
        copy = shutil.copy(database, database.with_name(f"{name}{run}.db"))
        mapping.match(copy, VIEWS, seed=0)
        for table, pair, found in matches(copy):
            seen[table, pair][found] += 1
    usual = {key: max(counts.values()) for key, counts in seen.items()}
    return [
        f"{name}, {table} of pair {pair}: {RUNS - most} of {RUNS} runs"
        for (table, pair), most in usual.items()
        if most < RUNS
    ]


def features(folder):
    """A database of the features of some views of the courtyard."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    world = courtyard.build_world(seed=0)
    pixtocams, poses = courtyard.make_cameras(
        views=VIEWS, width=SIZE[0], height=SIZE[1], seed=0
    )
    names = [f"view {i:02d}" for i in range(VIEWS)]
    for name, pixtocam, pose in zip(names, pixtocams, poses, strict=True):
        rendered = courtyard.render(world, pixtocam, pose, *SIZE, courtyard.at_rest())
        images.write(folder / f"{name}.png", rendered.image)
    database = folder / "database.db"
    pycolmap.Database.open(database).close()
    mapping.quiet(0)
    files = [f"{name}.png" for name in names]
    pycolmap.import_images(database, folder, image_names=files)
    mapping.extract(database, folder, names, max(SIZE))
    return database


def matches(database):
    """[(table, pair id, bytes of its matches)], as found and as verified."""
    with contextlib.closing(sqlite3.connect(database)) as opened:
        return [
            (table, *row)
            for table in ("matches", "two_view_geometries")
            for row in opened.execute(f"SELECT pair_id, data FROM {table}")
        ]
