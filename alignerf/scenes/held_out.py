"""That no photo is both learnt from and scored, whatever its files are called.

A photo may have two names: by a link, by a path in a json, or as a copy.
"""

import collections
import hashlib
import logging
import os

import numpy as np

from alignerf.io import faults
from alignerf.scenes import prepare

log = logging.getLogger(__name__)

# Of the entries of a pose: copies of a view have those that a file prints.
SAME_POSE = 1e-4


def check(where, views: prepare.PosedViews, splits):
    """ValueError where a file is the photo of a view to train on and of one to score.

    splits: {view: train or test}; views without one are of no account. A copy of a
    photo is the same where its camera is; with another camera it is warned of. Photos
    without a file are not looked at.
    """
    paths = {
        name: photo.path for name, photo in zip(views.names, views.photos, strict=True)
    }
    found = {name: path for name, path in paths.items() if path and name in splits}
    if pair := across({name: identity(path) for name, path in found.items()}, splits):
        raise ValueError(f"{where}: {told(found, pair)}, are one file. {SO}")
    if pair := across(contents(found), splits):
        if same_camera(views, *pair):
            raise ValueError(f"{where}: {told(found, pair)}, are one photo. {SO}")
        log.warning("%s: %s, are equal files", where, told(found, pair))


SO = "What is trained on cannot be scored: take one of them out"


def told(paths, pair):
    """The files of a pair of views, the one that is trained on first."""
    train, test = (faults.name_of(str(paths[name])) for name in pair)
    return f"{train}, which is trained on, and {test}, which is scored"


def identity(path):
    """What a file is on its disk, by whatever name."""
    at = os.stat(path)
    return at.st_dev, at.st_ino


def contents(paths):
    """{view: what tells its file's content from all others}."""
    sizes = {name: os.stat(path).st_size for name, path in paths.items()}
    counts = collections.Counter(sizes.values())
    return {
        name: (size, digest(paths[name]) if counts[size] > 1 else name)
        for name, size in sizes.items()
    }


def digest(path):
    """What a file's content is told by, without holding it."""
    with faults.opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def across(kinds, splits):
    """The first (view to train on, view to score) of one kind; None without any.

    kinds: {view: a value}.
    """
    scored = {kind: name for name, kind in kinds.items() if splits[name] == "test"}
    for name, kind in kinds.items():
        if splits[name] == "train" and kind in scored:
            return name, scored[kind]
    return None


def same_camera(views, first, second):
    """Whether two views, by name, look from one place in one direction."""
    poses = views.camtoworlds[[views.names.index(name) for name in (first, second)]]
    spread = np.ptp(views.camtoworlds[:, :, 3], axis=0).max()
    scale = np.array([1.0, 1.0, 1.0, max(spread, 1e-30)])
    return bool((np.abs(poses[0] - poses[1]) <= SAME_POSE * scale).all())


def without_copies(paths, where):
    """The paths without files that are equal to one before them, with a warning."""
    kept, first, copies = [], {}, []
    kinds = contents({path: path for path in paths})
    for path in paths:
        earlier = first.setdefault(kinds[path], path)
        if earlier == path:
            kept.append(path)
        else:
            copies.append(f"{path.name} (as {earlier.name})")
    if copies:
        few = faults.some_names(copies)
        log.warning("%s: left out %s: the same photo again", where, few)
    return kept
