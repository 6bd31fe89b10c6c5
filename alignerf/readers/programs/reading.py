"""The cameras that lie in a folder as a program exported them, and their photos."""

import logging
import re
from pathlib import Path

from alignerf.io import faults
from alignerf.readers import shots
from alignerf.readers.programs import (
    bundler,
    gaussians,
    metashape,
    nerfies,
    openmvg,
    opensfm,
    tum,
)
from alignerf.scenes import photo_names, photos

log = logging.getLogger("alignerf")

READERS = (metashape, openmvg, opensfm, bundler, gaussians, tum, nerfies)
HEAD_BYTES = 2**16
# Of other programs, by suffix or by what is in the name.
OTHERS = re.compile(
    r".*\.(csv|nvm|p4[pd]|ps[xz]|rcproj|rsproj|rcinfo|sfm|abc|xml|kml|gpx|bag|out)"
    r"|sfm_data.*\.bin|geo\.txt"
    r"|.*(camera|pose|traj|ground.?truth|extrinsic|intrinsic|calib|arcore|arkit|odometry|gps"
    r"|gnss|imu|frames|reconstruction).*\.(txt|json|log|npy|npz|ya?ml|tum)",
    re.IGNORECASE,
)
WITHOUT = "Without this file COLMAP finds the cameras"
# RealityCapture's own, of sidecars that others fill with colours.
XMP, MAX_XMP_BYTES = b"xcr:", 2**24
EXIF = {".jpg", ".jpeg", ".heic"}


def reader_of(path):
    """The module that reads a file, by its name and head; None of another file."""
    path = Path(path)
    named = [one for one in READERS if any(map(path.match, one.PATTERNS))]
    if not named or not path.is_file():
        return None
    with faults.opened(path) as file:
        head = file.read(HEAD_BYTES)
    return next((one for one in named if re.search(one.MARK, head)), None)


def find(folder):
    """The path of the file of most cameras in a folder or one below; or None."""
    found = [path for path in files_in(folder) if reader_of(path)]
    return max(found, key=cameras_in) if len(found) > 1 else next(iter(found), None)


def cameras_in(path):
    """The number of cameras in a file that have a pose; 0 of one that is broken."""
    try:
        return len(cameras_of(path).shots)
    except ValueError:
        return 0


def files_in(folder):
    """Paths of the files in a folder, and of those one below that are beside photos.

    A folder with photos of its own, but `images`, is another scene.
    """
    inner, folder = [], Path(folder)
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if path.is_file():
            yield path
        elif path.is_dir() and path.name[0] != ".":
            inner.append(path)
    for place in inner:
        if place.name == "images" or not photo_names.listed(place):
            yield from (path for path in sorted(place.iterdir()) if path.is_file())


def tell_unread(folder):
    """Log what may tell cameras in a folder of photos and is not read.

    Raises ValueError as of `photos.check_pinhole`.
    """
    found = {path.name: path for path in files_in(folder)}
    names = [name for name in found if OTHERS.fullmatch(name)]
    sidecars = [name for name in found if name.lower().endswith(".xmp")]
    if sidecars and XMP in faults.content(found[sidecars[0]], MAX_XMP_BYTES):
        names += sidecars
    if names:
        verb = "is" if len(names) == 1 else "are"
        told = faults.some_names(names)
        log.warning("%s: %s %s not read: poses come from COLMAP", folder, told, verb)
    inside = [folder / path for path in photo_names.listed(folder)]
    photos.check_pinhole(inside, folder)
    taken = [path for path in found.values() if path.suffix.lower() in EXIF]
    if any(map(photos.has_place, taken[:1])):
        log.info("%s: places (GPS) are not read: poses come from COLMAP", folder)


def cameras_of(path) -> shots.Cameras:
    """The cameras in a file; ValueError naming it where there are none."""
    path = Path(path)
    if (module := reader_of(path)) is None:
        raise ValueError(f"{path}: cameras of no program that is known")
    return shots.cameras(path, module.read(path), f"{path.name} of {module.NAME}")


def views_of(folder, masks=None):
    """(prepare.PosedViews, names of photos without a pose) of the cameras in a folder.

    masks: as of `shots.views_of`. Raises ValueError naming the file or photo.
    """
    folder, path = Path(folder), find(folder)
    if path is None:
        raise ValueError(f"{folder}: no cameras of a program that is known")
    try:
        own = shots.placed(cameras_of(path), [folder])
    except ValueError as error:
        raise ValueError(f"{error}. {WITHOUT}") from None
    log.info("%s: cameras of %s", path, own.kind)
    if reader_of(path) is tum:
        taken = sorted(own.shots, key=lambda shot: shot.photo)
        own = own._replace(shots=shots.evenly(taken, path))
    return shots.views_of(own, masks=masks), own.left_out
