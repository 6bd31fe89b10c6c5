"""COLMAP's matching beside other work: the same pairs and matches on every run.

With several threads, pycolmap 4.2.1 loses most matches of a pair in one run of
hundreds. Nothing says so. And it finds other photos that look alike while it matches.
While it works its rows are counted, for the progress: that may cost no pair, and not
end it.
"""

import functools
import os
import shutil
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path
from unittest import mock

import pycolmap

from alignerf.io import images, progress
from alignerf.scenes.capture import mapping
from alignerf.scenes.courtyard import scene as courtyard
from tools.torture import running

VIEWS, SIZE = 56, (240, 180)
RUNS = 8
PAIRS = RUNS * VIEWS * (VIEWS - 1) // 2
# Of the database that is looked at: its views, its runs, and the rest between looks.
LOOKED, LOOKED_RUNS, LOOK_S = 20, 12, 0.002
WORK = """
import sys
from tools.torture import matching
matching.work(*sys.argv[1:])
"""


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
        with mock.patch.multiple(mapping, MAX_EXHAUSTIVE=0, FOLLOWING=1, ALIKE=5):
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
        for key, found in contents(copy):
            seen[key][found] += 1
    usual = {key: max(counts.values()) for key, counts in seen.items()}
    return [
        f"{name}, {table} of {of}: {RUNS - most} of {RUNS} runs"
        for (table, of), most in usual.items()
        if most < RUNS
    ]


def looked_at(reference, folder):
    """What is lost, and what ends, where rows are counted all the time.

    Each run is a process: COLMAP has ended by a bus error when its locks were dropped.
    """
    folder = folder / "looked"
    photos(folder, LOOKED)
    found, first = [], None
    for run in range(LOOKED_RUNS):
        database = folder / f"{run}.db"
        # Nobody looks at the first.
        command = [sys.executable, "-c", WORK, database, str(LOOK_S if run else 1e6)]
        ended = running.run(command, folder)
        if ended.code:
            last = ended.output.splitlines()[-1:]
            found.append(f"run {run} ended with {ended.code}: {last}")
            continue
        now = dict(contents(database))
        first = first or now
        found += [
            f"run {run}, {table} of {of}"
            for table, of in sorted(first.keys() | now.keys())
            if first.get((table, of)) != now.get((table, of))
        ]
    return found


def work(database, rest_s):
    """Features and matches of the photos beside a database, and its progress."""
    database = Path(database)
    names = sorted(path.stem for path in database.parent.glob("*.png"))
    often = functools.partial(progress.watched, every_s=float(rest_s))
    with mock.patch.object(progress, "watched", often):
        extracted(database, names)
        mapping.match(database, len(names), seed=0)


def features(folder):
    """A database of the features of some views of the courtyard."""
    names = photos(folder, VIEWS)
    database = folder / "database.db"
    extracted(database, names)
    return database


def photos(folder, views):
    """Views of the courtyard in an empty folder; their names."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    world = courtyard.build_world(seed=0)
    pixtocams, poses = courtyard.make_cameras(
        views=views, width=SIZE[0], height=SIZE[1], seed=0
    )
    names = [f"view {i:02d}" for i in range(views)]
    for name, pixtocam, pose in zip(names, pixtocams, poses, strict=True):
        rendered = courtyard.render(world, pixtocam, pose, *SIZE, courtyard.at_rest())
        images.write(folder / f"{name}.png", rendered.image)
    return names


def extracted(database, names):
    """Write features of the photos beside a database into it."""
    pycolmap.Database.open(database).close()
    pycolmap.set_random_seed(0)
    files = [f"{name}.png" for name in names]
    pycolmap.import_images(database, database.parent, image_names=files)
    mapping.extract(database, database.parent, names, max(SIZE))


def contents(database):
    """((table, image or pair), bytes): features, matches, and those verified."""
    with pycolmap.Database.open(database) as opened:
        for image in opened.read_all_images():
            number = image.image_id
            yield ("keypoints", number), opened.read_keypoints(number).tobytes()
            found = opened.read_descriptors(number).data
            yield ("descriptors", number), found.tobytes()
        for pair, found in zip(*opened.read_all_matches(), strict=True):
            yield ("matches", pair), found.tobytes()
        for pair, found in zip(*opened.read_two_view_geometries(), strict=True):
            verified = found.inlier_matches.tobytes()
            yield ("two_view_geometries", pair), verified
