"""The folders that a run writes into, before the workflow engine meets them.

A user's files are read, and never changed: no path of a config lies in or above such a
folder, and one that is there has this program's mark.
"""

import contextlib
import os
from pathlib import Path

from alignerf.captures import base
from alignerf.experiment.checks.common import fault
from alignerf.io import owned
from alignerf.methods import named_folders

# Folders of a scene besides those of its methods.
INSIDE = ("images", "tables", "figures", "logs", "pretrain", "testset")


def check_folders(scenes, methods, results="results"):
    """ValueError for a file in the place of a folder, for a link that leads nowhere,
    and for a folder of a scene, or one that a link leads to, which is a user's.
    """
    for folder in folders_of(scenes, methods, results):
        # What is not there will be made.
        if os.path.lexists(folder) and not folder.is_dir():
            raise ValueError(
                f"{folder}: a folder was expected there: move this file away"
            )
    for folder in outermost(scenes, methods, results):
        if not is_stored(folder):
            owned.check(folder)


def check_writable(scenes, methods, results="results"):
    """ValueError for a folder in which this user can write nothing."""
    for folder in folders_of(scenes, methods, results):
        if folder.is_dir() and not os.access(folder, os.W_OK | os.X_OK):
            raise ValueError(f"{folder}: cannot be written to, by its permissions")


def claim(scenes, replaced, results="results"):
    """Put the mark into the folders of scenes, before any job begins.

    replaced: folders that jobs write as a whole. ValueError for a user's file in one.
    """
    for scene in scenes:
        folder = Path(results, scene)
        if is_stored(folder):
            continue
        owned.claim(folder)
        # Results of a version without marks have them nowhere inside.
        if not owned.takes_all(folder):
            for one in replaced:
                if folder in Path(one).parents:
                    owned.check_replaced(one)


def is_stored(folder):
    """Whether a folder holds a storage's copies, which come and go."""
    return ".snakemake" in Path(os.path.realpath(folder)).parts


def check_apart(config, results="results"):
    """ValueError naming a key whose path lies in or above a folder that is written."""
    written = outermost(config["scenes"], config["methods"], results)
    check_reads(paths_of(config), [Path(results, "logs"), *written])


def check_reads(paths, written):
    """The same of {key: path} and folders. Real paths count, as links lead to them."""
    # Crops have the photos of their scene: each path is looked at once.
    first = {}
    for key, path in paths.items():
        if path:
            first.setdefault(path, key)
    every = [(k, one) for path, k in first.items() for one in with_links(path)]
    for key, path in every:
        for folder in written:
            inside = lies_in(path, folder)
            if inside or lies_in(folder, path):
                where = "lies in" if inside else "holds"
                fault(
                    key,
                    f"{path} {where} {folder}, which this run writes: give results "
                    "another name (--name), or run it from another folder",
                )


def with_links(path):
    """A path, and links in a folder, which lead to what is read; one for each folder.

    There may be a link for each of thousands of photos.
    """
    yield path
    places = {}
    with contextlib.suppress(OSError), os.scandir(path) as inside:
        for one in inside:
            if one.is_symlink():
                real = os.path.realpath(one.path)
                place = real if os.path.isdir(real) else os.path.dirname(real)
                places.setdefault(place, one.path)
    yield from places.values()


def paths_of(config):
    """{key: path} of all that a complete config reads; of a template what is fixed."""
    found = {f"lpips.{net}": path for net, path in config["lpips"].items()}
    found["frequency_weights"] = config["frequency_weights"]
    for scene, keys in config["scenes"].items():
        own = base.reads(keys).items()
        found |= {f"scenes.{scene}.{key}": path for key, path in own}
    templates = {"flow.folder": config["flow"]["folder"]}
    for name, method in config["methods"].items():
        for place, mapping, key in named_folders(method):
            templates[f"methods.{name}.{place}"] = mapping.get(key)
    for key, template in templates.items():
        for scene in config["scenes"] if template else ():
            path = template.replace("{scene}", scene).partition("{")[0]
            found[f"{key}, {scene}"] = path
    return found


def lies_in(path, folder):
    """Whether a path is a folder, or lies below it, by what links lead to."""
    if not os.path.exists(folder):
        return False
    real = Path(os.path.realpath(path))
    return any(
        os.path.exists(one) and os.path.samefile(one, folder)
        for one in (real, *real.parents)
    )


def outermost(scenes, methods, results):
    """Folders of scenes, and those inside that links lead out of them to."""
    every = list(folders_of(scenes, methods, results))[1:]
    return [one for one in every if one.parent == Path(results) or one.is_symlink()]


def folders_of(scenes, methods, results):
    """Paths of the folders, those above before those below."""
    yield Path(results)
    for scene in scenes:
        yield Path(results, scene)
        for name in (*INSIDE, *methods):
            yield Path(results, scene, name)
