"""COLMAP's own steps, the same on every run: features, matching, mapping."""

import contextlib
import errno
import itertools
import json
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pycolmap

from alignerf.io import faults, machine, progress

log = logging.getLogger(__name__)

# With more photos not all pairs are matched: 150 have 11,175, 300 have 44,850.
MAX_EXHAUSTIVE = 150
# Each photo then meets so many that follow it by name, and that look most like it.
FOLLOWING, ALIKE = 10, 30
# With fewer photos a camera's distortion is one number instead of four.
FEW_OF_A_CAMERA = 5
# Features of an image.
MOST = 8192
# How long all takes is told by so many photos and their pairs, if it is over a minute.
# Poses and adjustments take about as long again as features and matches.
FIRST, WHOLE, LONG_S = 4, 2.0, 60.0
# Features that the words are learnt from, and their number: a few hundred a word.
WORDS_FEATURES, WORDS = 200_000, 1024
# Of a feature, and of what is kept of it within a word: COLMAP's own numbers.
SIFT_DIMENSIONS, SHORT_DIMENSIONS = 128, 64
# Python's SQLite counts in a process of its own: beside COLMAP's copy in one process,
# each drops the other's locks (sqlite.org/howtocorrupt.html, 2.2.1).
COUNT = """
import contextlib, sqlite3, sys
database, table = sys.argv[1:]
with contextlib.closing(sqlite3.connect(database, uri=True)) as opened:
    print(*opened.execute(f"SELECT count(*) FROM {table}").fetchone())
"""
# Fewer pairs than this are matched faster than a process begins.
MIN_PAIRS, MAX_LOG_BYTES = 50, 2**20
# Each process has its own copy of the database.
MAX_PROCESSES = 8
# Beside a parent that is gone nothing goes on.
MATCH = """
import json, os, sys, threading, time
sys.path[:], parent = json.loads(sys.argv[1]), os.getppid()
def watch():
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)
threading.Thread(target=watch, daemon=True).start()
from alignerf.colmap import mapping
mapping.match_listed(*sys.argv[2:])
"""
# A step that has ended waits for the last count.
COUNT_S = 10.0
# Between looks at processes that match.
POLL_S = 0.05


def models_of(
    image_folder, work_folder, taken_by, *, camera_model, max_size_px, masks, seed
):
    """All pycolmap.Reconstructions that COLMAP finds; arguments: `estimate_poses`."""
    names = sorted(name for camera in taken_by for name in camera.names)
    database = Path(work_folder) / "database.db"
    with room_for(database):
        pycolmap.Database.open(database).close()
        pycolmap.set_random_seed(seed)
        # Imported first, so that image ids follow the names: parallel extraction hands
        # them out in any order, and the result depends on them.
        for camera in taken_by:
            reader = pycolmap.ImageReaderOptions()
            # Few photos do not tell a lens's distortion in full: it folds their image
            # over.
            simple = camera_model == "OPENCV" and len(camera.names) < FEW_OF_A_CAMERA
            reader.camera_model = "SIMPLE_RADIAL" if simple else camera_model
            if camera.focal_px is not None:
                start = pycolmap.Camera.create_from_model_name(
                    1, reader.camera_model, camera.focal_px, *camera.size
                )
                reader.camera_params = ", ".join(map(repr, start.params.tolist()))
            pycolmap.import_images(
                database,
                image_folder,
                camera_mode=pycolmap.CameraMode.SINGLE,
                image_names=[f"{name}.png" for name in sorted(camera.names)],
                options=reader,
            )
        options = {"max_size_px": max_size_px, "masks": masks, "seed": seed}
        find_matches(database, image_folder, names, **options)
        return _map(database, image_folder, work_folder, seed, len(names))


@contextlib.contextmanager
def room_for(database):
    """A full disk, which COLMAP's database tells in words, as the system tells it."""
    try:
        yield
    except RuntimeError as error:
        if "disk is full" not in str(error):
            raise
        said = os.strerror(errno.ENOSPC)
        raise OSError(errno.ENOSPC, said, str(database)) from None


def find_matches(
    database,
    image_folder,
    names,
    *,
    max_size_px,
    seed,
    masks=None,
    most=MOST,
    pairs=None,
    write=None,
):
    """Features and matches of <name>.png of a folder, whose images the database knows.

    Logs how long all will take, by the first photos. most: features of an image, the
    largest ones. pairs: as of `match`. write: called with names whose files are needed.
    """
    count, few = len(names), names[:FIRST]

    def extract_some(some, extracting):
        if write:
            write(some)
        return extracting(database, image_folder, some, max_size_px, masks, most)

    started = time.monotonic()
    poor = extract_some(few, extract)
    if rest := names[FIRST:]:
        extracted = time.monotonic()
        known = set(itertools.combinations(sorted(ids_of(database, few)), 2))
        match(database, count, seed, known)
        # As many photos as there are cores are looked at at once.
        photos_s = (extracted - started) / max(FIRST, machine.cores()) * count
        pair_s = (time.monotonic() - extracted) / len(known)
        whole_s = WHOLE * (photos_s + pair_s * pairs_of(count, pairs))
        if whole_s > LONG_S:
            log.info("%d photos: about %.0f min", count, whole_s / 60)
        # Where all are short of features, the others are likely to be.
        extract_some(rest, extract_from if poor == few else extract)
    match(database, count, seed, pairs)


def pairs_of(count, pairs):
    """How many pairs of so many photos are matched, or some more."""
    if pairs is not None:
        return len(pairs)
    if count <= MAX_EXHAUSTIVE:
        return count * (count - 1) // 2
    return count * (FOLLOWING + ALIKE)


def ids_of(database, names):
    """The database's ids of images <name>.png."""
    with pycolmap.Database.open(database) as opened:
        found = {image.name: image.image_id for image in opened.read_all_images()}
    return [found[f"{name}.png"] for name in names]


def extract(database, image_folder, names, max_size_px, masks=None, most=MOST):
    """SIFT on <name>.png of a folder; most: features of an image, the largest ones.

    Images that have as many are not doubled in size to find smaller ones: that takes
    three quarters of the time. Returns the names of the others. Half as many are not
    enough: poses of castle_P30 are then off by 0.19 px instead of 0.13.
    """
    plain = Path(database).with_suffix(".plain.db")
    shutil.copyfile(database, plain)
    extract_from(plain, image_folder, names, max_size_px, masks, most, octave=0)
    poor = []
    with (
        pycolmap.Database.open(plain) as source,
        pycolmap.Database.open(database) as target,
    ):
        for name, number in zip(names, ids_of(plain, names), strict=True):
            if source.num_keypoints_for_image(number) < most:
                poor.append(name)
                continue
            target.write_keypoints(number, source.read_keypoints(number))
            target.write_descriptors(number, source.read_descriptors(number))
    plain.unlink()
    if poor:
        extract_from(database, image_folder, poor, max_size_px, masks, most)
    return poor


def extract_from(database, image_folder, names, max_size_px, masks, most, octave=-1):
    """The same, from one octave on: 0 for images as they are, -1 for doubled ones."""
    reader = pycolmap.ImageReaderOptions()
    if masks is not None:
        reader.mask_path = masks
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.use_gpu = False
    extraction.max_image_size = max_size_px
    extraction.sift.max_num_features = most
    extraction.sift.first_octave = octave
    with _told("features", [database], len(names), unit="photo"):
        pycolmap.extract_features(
            database,
            image_folder,
            image_names=[f"{name}.png" for name in names],
            reader_options=reader,
            extraction_options=extraction,
            device=pycolmap.Device.cpu,
        )


def match(database, count, seed, pairs=None):
    """Match all pairs; of many photos those that look alike or follow one another.

    In as many processes as there are cores. pairs: of image ids, where others say which
    photos see the same.
    """
    if pairs is None and count <= MAX_EXHAUSTIVE:
        with pycolmap.Database.open(database) as opened:
            ids = sorted(image.image_id for image in opened.read_all_images())
        pairs = itertools.combinations(ids, 2)
    if pairs is None:
        with progress.heartbeat("COLMAP: photos that look alike"):
            pairs = _neighbours(database, seed)
    # Neighbours by number share photos, which are read once.
    pairs = sorted({*pairs} - pairs_in(database))
    processes = min(machine.cores(), MAX_PROCESSES)
    each = max(-(-len(pairs) // processes), MIN_PAIRS)
    shares = [pairs[i : i + each] for i in range(0, len(pairs), each)]
    if len(shares) < 2:
        list_pairs(database, pairs)
        with _told("matching", [database], len(pairs), unit="pair"):
            match_listed(database, seed)
        return
    with tempfile.TemporaryDirectory(dir=Path(database).parent) as folder:
        parts = [Path(folder, f"{i}.db") for i in range(len(shares))]
        with contextlib.ExitStack() as running:
            jobs = []
            for part, share in zip(parts, shares, strict=True):
                shutil.copyfile(database, part)
                list_pairs(part, share)
                job = [sys.executable, "-I", "-c", MATCH, json.dumps(sys.path)]
                job += [str(part), str(seed)]
                with open(part.with_suffix(".log"), "w") as said:
                    jobs.append(subprocess.Popen(job, stdout=said, stderr=said))
                running.callback(jobs[-1].wait)
                running.callback(jobs[-1].kill)
            with _told("matching", parts, len(pairs), unit="pair"):
                codes = [job.poll() for job in jobs]
                while None in codes and not any(codes):
                    time.sleep(POLL_S)
                    codes = [job.poll() for job in jobs]
        # Not of those that were ended after it.
        if failed := [part for part, code in zip(parts, codes, strict=True) if code]:
            said = faults.content(failed[0].with_suffix(".log"), MAX_LOG_BYTES)
            last = said.decode(errors="replace").strip()[-500:]
            last = last or "killed, perhaps for want of memory"
            raise RuntimeError(f"a process that matches has stopped: {last}")
        for part in parts:
            take_pairs(database, part)


def list_pairs(database, pairs):
    """Write pairs of image ids beside a database, for `match_listed`."""
    listed = "".join(f"{one} {other}\n" for one, other in pairs)
    Path(database).with_suffix(".pairs").write_text(listed)


def match_listed(database, seed):
    """Match the pairs that are listed beside a database, one after another."""
    matching = pycolmap.FeatureMatchingOptions()
    matching.use_gpu = False
    # With several, pycolmap 4.2.1 loses most matches of a pair in one run of hundreds,
    # with no other SQLite beside it.
    matching.num_threads = 1
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = int(seed)
    by_list = pycolmap.ImportedPairingOptions()
    by_list.match_list_path = Path(database).with_suffix(".pairs")
    with _numbers_as_names(database):
        pycolmap.match_image_pairs(
            database,
            pairing_options=by_list,
            matching_options=matching,
            verification_options=verification,
            device=pycolmap.Device.cpu,
        )


def pairs_in(database):
    """The pairs of image ids that are matched already."""
    with pycolmap.Database.open(database) as opened:
        numbers, _ = opened.read_two_view_geometries()
    return {tuple(sorted(pycolmap.pair_id_to_image_pair(one))) for one in numbers}


def take_pairs(database, part):
    """Write the pairs that another database has more."""
    known = pairs_in(database)
    with (
        pycolmap.Database.open(part) as source,
        pycolmap.Database.open(database) as target,
    ):
        for number, found in zip(*source.read_two_view_geometries(), strict=True):
            pair = pycolmap.pair_id_to_image_pair(number)
            if tuple(sorted(pair)) not in known:
                target.write_two_view_geometry(*pair, found)


def _told(step, databases, total, *, unit):
    """Show how far a step of COLMAP is, by the rows of its databases' table."""
    table = {"photo": "keypoints", "pair": "two_view_geometries"}[unit]
    # Several are copies of one.
    known, before = {}, rows(databases[0], table) or 0

    def count():
        for database in databases:
            if (found := rows(database, table)) is not None:
                known[database] = found - before
        return sum(known.values())

    return progress.watched(f"COLMAP: {step}", total, count, unit=unit)


def rows(database, table):
    """How many rows a database's table has; None where it cannot be told now."""
    # A step that writes is not disturbed, and may keep readers out.
    where = f"{Path(database).absolute().as_uri()}?mode=ro"
    # No folder or variable of the user's takes part.
    command = [sys.executable, "-IS", "-c", COUNT, where, table]
    with contextlib.suppress(OSError, ValueError, subprocess.SubprocessError):
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=COUNT_S,
            check=True,
        )
        return int(done.stdout)
    return None


def _neighbours(database, seed):
    """Pairs of image ids: those that follow one another, and those that look alike.

    Found before any pair is matched: beside matching, COLMAP finds other pairs in one
    run of thirty. Likely its linear algebra is not safe among threads.
    """
    following = pycolmap.SequentialPairingOptions()
    following.overlap = FOLLOWING
    following.quadratic_overlap = False
    # Words depend on it, and then on nothing that came before.
    pycolmap.set_random_seed(seed)
    alike = pycolmap.VocabTreePairingOptions()
    alike.num_images, alike.vocab_tree_path = ALIKE, build_vocabulary(database)
    alike.num_threads = 1
    with pycolmap.Database.open(database) as opened:
        pairs = pycolmap.SequentialPairGenerator(following, opened).all_pairs()
        pairs += pycolmap.VocabTreePairGenerator(alike, opened).all_pairs()
    return {(min(pair), max(pair)) for pair in pairs if pair[0] != pair[1]}


@contextlib.contextmanager
def _numbers_as_names(database):
    """Its images are called as their ids within: COLMAP's list takes no spaces."""
    with pycolmap.Database.open(database) as opened:
        names = {image.image_id: image.name for image in opened.read_all_images()}
    _rename(database, {number: str(number) for number in names})
    try:
        yield
    finally:
        _rename(database, names)


def _rename(database, names):
    with pycolmap.Database.open(database) as opened:
        for image in opened.read_all_images():
            image.name = names[image.image_id]
            opened.update_image(image)


def _map(database, image_folder, work_folder, seed, count):
    sparse = Path(work_folder) / "sparse"
    sparse.mkdir()
    placed = 2

    def one_more():
        nonlocal placed
        placed += 1

    with progress.watched("COLMAP: poses", count, lambda: placed, unit="photo"):
        models = pycolmap.incremental_mapping(
            database,
            image_folder,
            sparse,
            pipeline_options(seed),
            next_image_callback=one_more,
        )
    return list(models.values())


def pipeline_options(seed):
    """COLMAP's, with the same result on every run."""
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = seed
    # Sums over threads come in any order, and poses would differ by 0.1 px.
    options.num_threads = 1
    return options


def build_vocabulary(database):
    """Write a vocabulary of a COLMAP database's features beside it; returns its path.

    COLMAP finds photos that look alike by it. Its own, learnt from photos of elsewhere,
    would have to be downloaded. The same features give the same words.
    """
    opened = pycolmap.Database.open(database)
    ids = [image.image_id for image in opened.read_all_images()]
    each = max(1, WORDS_FEATURES // max(len(ids), 1))
    descriptors = [spread(opened.read_descriptors(i).data, each) for i in ids]
    opened.close()
    descriptors = np.concatenate(descriptors).astype(np.float32)
    features = pycolmap.FeatureDescriptorsFloat(
        pycolmap.FeatureExtractorType.SIFT, descriptors
    )
    index = pycolmap.VisualIndex.create(SIFT_DIMENSIONS, SHORT_DIMENSIONS)
    options = pycolmap.VisualIndex.BuildOptions()
    options.num_visual_words = min(WORDS, max(2, len(descriptors) // 50))
    options.num_threads = 1
    index.build(options, features)
    path = Path(database).with_suffix(".words")
    index.write(path)
    return path


def spread(rows, count):
    """At most `count` of the rows, evenly spaced."""
    if len(rows) <= count:
        return rows
    return rows[np.linspace(0, len(rows) - 1, count).round().astype(int)]
