"""Which folder of photos a file's cameras are of, and whether by its lens.

Undistorted photos may lie beside those as taken, by the same names and of the same
size: matches tell them apart. Undistorting them may have changed the focal length.
"""

import functools
import logging
import tempfile
from pathlib import Path

import numpy as np

from alignerf.colmap import mapping
from alignerf.io import faults, images
from alignerf.scenes import distortion, photos, prepare
from alignerf.sfm import calibration, matches

log = logging.getLogger("alignerf")

# Of photos that are matched: pairs, px of the longer side, and features of each.
PAIRS, SIZE_PX, FEATURES = 10, 800, 1024
# Fewer matches tell nothing.
MIN_MATCHES = 50
# A pair looks apart by less, and is as far apart as this share of the views that do.
MAX_TURN, SHARE = np.radians(45), 1 / 12
# Errors that differ by less are alike; by larger ones nothing is told of a lens.
ALIKE, FITS_PX = 1.4, 1.5
# Focal lengths of undistorted photos over that of the lens; then between two of these.
TIMES, BETWEEN = np.geomspace(0.5, 2, 57), np.geomspace(0.975, 1.025, 21)


def choose(where, shots, folders):
    """(index of the folder, shots) that matches fit best; of those alike, the first.

    shots: `readers.shots.Shot`s of the file `where`, sized; folders: {name: path} each.
    What comes back may have no distortion: then the photos are undistorted already.
    Nothing is matched where a pinhole has one folder.
    """
    straight = all(distortion.is_pinhole(shot.lens[1]) for shot in shots)
    if straight and len(folders) == 1:
        return 0, shots
    usual = prepare.usual_size([shot.size for shot in shots])
    some = [s for s in shots if all(s.name in folder for folder in folders)]
    some = [shot for shot in some if shot.size == usual and min(usual) > 0]
    some.sort(key=lambda shot: shot.name)
    pairs = pairs_of(np.array([shot.pose for shot in some]).reshape(-1, 3, 4))
    if not len(pairs):
        return 0, shots
    used, pairs = np.unique(pairs, return_inverse=True)
    used, pairs = [some[i] for i in used], pairs.reshape(-1, 2).tolist()
    every = [
        matched(
            tuple(faults.resolved(folder[shot.name]) for shot in used),
            usual,
            frozenset(map(tuple, pairs)),
        )
        for folder in folders
    ]
    if not all(found and found.count() >= MIN_MATCHES for found in every):
        return 0, shots
    trials = [(k, None) for k in range(len(folders))]
    if not straight:
        trials += [(k, 1.0) for k in range(len(folders))]
        trials += [(k, focal_of(found, used)) for k, found in enumerate(every)]
    errors = [error_px(every[k], with_lens(used, times)) for k, times in trials]
    if min(errors) > FITS_PX:
        return 0, shots
    best = next(i for i, error in enumerate(errors) if error <= ALIKE * min(errors))
    k, times = trials[best]
    if best or len(folders) > 1:
        told = f"photos of {Path(next(iter(folders[k].values()))).parent}"
        if times:
            told += ", which are undistorted already: their distortion is left out"
        if times not in (None, 1.0):
            told += f", and their focal length is {times:.3f} times the lens's"
        log.info("%s: %s (matches: %.2g px)", where, told, errors[best])
    return k, with_lens(shots, times)


def with_lens(shots, times):
    """The shots with pinholes of so many times the focal length; None: as they are."""
    if times is None:
        return shots
    each = np.array([times, times, 1.0])
    return [
        shot._replace(
            lens=(np.where(np.eye(3), each * shot.lens[0], shot.lens[0]), np.zeros(5))
        )
        for shot in shots
    ]


def pairs_of(camtoworlds):
    """[p, 2] indices of at most PAIRS pairs of views that see much of the same."""
    n, found = len(camtoworlds), []
    for i in range(0, n, max(-(-n // PAIRS), 1)):
        turned = camtoworlds[:, :, 2] @ camtoworlds[i, :, 2] < np.cos(MAX_TURN)
        away = np.linalg.norm(camtoworlds[:, :, 3] - camtoworlds[i, :, 3], axis=1)
        away[turned | (np.arange(n) == i)] = np.inf
        order = np.argsort(away, kind="stable")[: np.isfinite(away).sum()]
        found += [(i, order[min(int(SHARE * n), len(order) - 1)])] if len(order) else []
    return np.array(found, int).reshape(-1, 2)


# A stage may read its photos more than once.
@functools.lru_cache(maxsize=8)
def matched(paths, size, pairs):
    """The `matches.Matches` of pairs of small copies of photos.

    None where a photo is broken, or of another shape than its camera.
    """
    names = [f"{i:04d}" for i in range(len(paths))]
    times = max(1, max(size) / SIZE_PX)
    width, height = (round(side / times) for side in size)
    with tempfile.TemporaryDirectory() as work:
        database = Path(work, "matched.db")
        for name, path in zip(names, paths, strict=True):
            try:
                image, _ = photos.decode(path, upright=False, least_px=SIZE_PX)
            except (ValueError, OSError):
                return None
            if not prepare.has_shape(image.shape[1::-1], size):
                return None
            small = prepare.shrink(image, width, height)
            images.write(Path(work, f"{name}.png"), small)
        numbers = {(min(pair) + 1, max(pair) + 1) for pair in pairs}
        with mapping.room_for(database):
            matches.write_views(database, names, (width, height))
            mapping.extract(database, work, names, SIZE_PX, most=FEATURES)
            mapping.match(database, len(names), 0, numbers)
        ids = {name: i for i, name in enumerate(names, 1)}
        return matches.read(database, ids, (width, height), seed=0)


def focal_of(found, shots):
    """Of how many times their focal length pinholes fit the matches best."""

    def best(of):
        return min(of, key=lambda times: error_px(found, with_lens(shots, times)))

    return float(best(best(TIMES) * BETWEEN))


def error_px(found, shots):
    """Median epipolar error of matches by cameras, in px of the small photos."""
    size = shots[0].size
    ratios = np.diag([found.width / size[0], found.height / size[1], 1.0])
    camtopix = ratios @ np.array([shot.lens[0] for shot in shots])
    straight = []
    for xy, one, shot in zip(found.keypoints, camtopix, shots, strict=True):
        points = distortion.camera(one, shot.lens[1]).cam_from_img(xy)
        # What lies behind a wide lens has no place in a pinhole's photo.
        points[~(np.abs(points) < np.tan(distortion.MAX_ANGLE))] = np.nan
        straight.append(points @ one[:2, :2].T + one[:2, 2])
    views, xy = found._replace(keypoints=straight).places()
    poses = np.array([shot.pose for shot in shots])
    errors = calibration.errors_px(views, xy, np.linalg.inv(camtopix), poses)
    seen = errors[np.isfinite(errors)]
    return float(np.median(seen)) if len(seen) >= MIN_MATCHES else np.inf
