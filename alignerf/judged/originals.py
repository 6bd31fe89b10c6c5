"""The files that a scene was made of, and which of them have changed since.

A photo that was overwritten in its place would go out with the cameras of another one:
the workflow engine looks at the time of its folder alone.
"""

import collections
import contextlib
import hashlib
import json
import os
from pathlib import Path

from alignerf.captures import base
from alignerf.colmap import video
from alignerf.io import faults, json_files
from alignerf.judged import camera_files

# Below a prepared scene's folder.
FILE = "images/originals.json"
# Poses in formats of scenes that are not judged.
OF_POSES = ("poses_bounds.npy", "transforms_train.json", "transforms_test.json")


def of_views(config, views):
    """Paths of the photos, masks and cameras that the views of a scene are read from;
    config: its keys. Frames of videos, which are taken anew, have none.
    """
    read = [*views.photos, *(views.masks or ())]
    found = [one.path for one in read if one.path]
    if config.path and base.of(config).trains:
        found += camera_files.files_of(config.path)
        found += [Path(config.path, name) for name in OF_POSES]
    return found


def write(scene, paths):
    """Note files as they are now, for `changed`; scene: its prepared folder."""
    found = filter(os.path.isfile, paths)
    files = {named(path): described(path) for path in found}
    if files:
        (Path(scene) / FILE).write_text(json.dumps(files, indent=1) + "\n")


def named(path):
    """A path from the working folder, where it is below: both may be moved together."""
    real = os.path.relpath(os.path.realpath(path), os.path.realpath("."))
    return os.path.abspath(path) if real.startswith(os.pardir) else real


def described(path):
    """[bytes, time of the last change in ns, digest of the content]."""
    with open(path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return [*stamp(path), digest]


def stamp(path):
    found = Path(path).stat()
    return [found.st_size, found.st_mtime_ns]


def noted(scene):
    """{path: as of `described`} of a scene; {} of one without a note."""
    path = Path(scene) / FILE
    found = json_files.read(path) if path.is_file() else {}
    for name, told in found.items():
        kinds = [type(one) for one in told] if isinstance(told, list) else None
        if kinds != [int, int, str]:
            raise ValueError(f"{path}: {faults.name_of(name)} is {faults.shown(told)}")
    return found


def digest(scene, paths):
    """One digest of the names and contents of files; `write` may know these already."""
    known, found = noted(scene), {}
    for path in filter(os.path.isfile, paths):
        *before, content = known.get(named(path), [None])
        same = stamp(path) == before
        found[named(path)] = content if same else described(path)[2]
    return hashlib.sha256(json_files.canonical(found).encode()).hexdigest()


def changed(scene):
    """Paths of a scene's files that are gone, or have another content, since then."""
    return [path for path, before in noted(scene).items() if is_other(path, before)]


def is_other(path, before):
    """Whether a file is gone, or no longer as described."""
    if not Path(path).is_file():
        return True
    return stamp(path) != before[:2] and described(path)[2] != before[2]


def check(scene):
    """ValueError naming a file that has changed since the scene was made of it."""
    if found := changed(scene):
        raise ValueError(
            f"{faults.some_names(found)}: changed since the cameras of {scene} were "
            "found: put it back, or run the command that has made these results again"
        )


def alone(paths):
    """The folder of most photos among the paths, if no cameras lie there; else None."""
    found = (path for path in map(Path, paths) if video.is_taken(path))
    # Masks come after the photos, and are no more.
    usual = collections.Counter(path.parent for path in found).most_common(1)
    for folder, _ in usual:
        with contextlib.suppress(ValueError, OSError):
            record = base.detected(folder)
            is_alone = record and record.poses == ("colmap",)
            return named(folder) if is_alone else None
    return None
