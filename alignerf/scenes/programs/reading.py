"""The cameras that lie in a folder as a program exported them, and their photos."""

import logging
from pathlib import Path

import numpy as np

from alignerf.io import faults
from alignerf.scenes import photo_names, photos, prepare
from alignerf.scenes.capture import canvas
from alignerf.scenes.formats import shots
from alignerf.scenes.programs import bundler, gaussians, metashape, openmvg, opensfm

log = logging.getLogger("alignerf")

READERS = (metashape, openmvg, opensfm, bundler, gaussians)
HEAD_BYTES = 2**16
# Of the photos that a file names, so many must be there.
LEAST_THERE = 2 / 3


def reader_of(path):
    """The module that reads a file, by its name and head; None of another file."""
    path = Path(path)
    named = [one for one in READERS if any(map(path.match, one.PATTERNS))]
    if not named or not path.is_file():
        return None
    with faults.opened(path) as file:
        head = file.read(HEAD_BYTES)
    return next((one for one in named if one.MARK in head), None)


def find(folder):
    """The path of the first file of cameras in a folder or one below; or None."""
    folder = Path(folder)
    if not folder.is_dir():
        return None
    inner = sorted(p for p in folder.iterdir() if p.is_dir() and p.name[0] != ".")
    for place in (folder, *inner):
        for module in READERS:
            for pattern in module.PATTERNS:
                for path in sorted(place.glob(pattern)):
                    if reader_of(path) is module:
                        return path
    return None


def read(path):
    """The cameras in a file [base.Given]; ValueError naming it where there are none."""
    module = reader_of(path)
    if module is None:
        raise ValueError(f"{path}: cameras of no program that is known")
    found = module.read(path)
    if not found:
        raise ValueError(f"{path}: no camera has a pose")
    names = [one.name for one in found]
    if len({*names}) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{path}: two cameras are of {faults.shown(twice)}")
    return found


def views_of(folder):
    """(prepare.PosedViews, names of those left out) of the cameras in a folder.

    Photos of several sizes and lenses are laid on one canvas. They are taken as stored,
    as the programs take them. Raises ValueError naming the file or photo.
    """
    folder, path = Path(folder), find(folder)
    if path is None:
        raise ValueError(f"{folder}: no cameras of a program that is known")
    given = read(path)
    listed = photo_names.listed(folder)
    found = photo_names.match([one.name for one in given], listed, where=path)
    missing = [one.name for one in given if one.name not in found]
    if len(found) < LEAST_THERE * len(given):
        raise ValueError(
            f"{path}: {len(missing)} of {len(given)} photos that it names are not in "
            f"{folder}: {faults.some_names(missing)}. Without this file COLMAP finds "
            "the cameras"
        )
    if missing:
        log.warning("%s: no photo of %s", path, faults.some_names(missing))
    names = photo_names.view_names(listed)
    left_out = sorted(names[one] for one in {*listed} - {*found.values()})
    if left_out:
        log.warning("%s: no pose of %s", path, faults.some_names(left_out))
    given = sorted(
        (one for one in given if one.name in found), key=lambda one: found[one.name]
    )
    shots.check_apart(given, path)
    places = [folder / found[one.name] for one in given]
    # Each is decoded whole to be sure.
    sizes = [photos.as_stored(place).shape[1::-1] for place in places]
    lenses = [
        one.at(size, place)
        for one, size, place in zip(given, sizes, places, strict=True)
    ]
    numbers = {}
    camera_of = [
        numbers.setdefault((k.tobytes(), bent.tobytes()), len(numbers))
        for k, bent in lenses
    ]
    views = canvas.views_of(
        [names[found[one.name]] for one in given],
        lenses,
        sizes,
        np.stack([one.camtoworld for one in given]),
        camera_of=camera_of,
        photos=[prepare.Photo(place, (photos.as_stored,)) for place in places],
        where=path,
    )
    log.info("%s: cameras of %s", path, reader_of(path).NAME)
    return views, left_out + missing
