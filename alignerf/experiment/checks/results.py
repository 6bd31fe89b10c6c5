"""The folders that a run writes into, before the workflow engine meets them.

A user's files are read, and never changed: no path of a config lies in or above such a
folder, and one that is there has this program's mark.
"""

import atexit
import contextlib
import os
import sys
from pathlib import Path

import filelock

from alignerf.experiment.checks.common import fault
from alignerf.io import atomic, faults, owned

# Folders of a scene besides those of its methods.
INSIDE = ("images", "tables", "figures", "logs", "pretrain", "testset")
# Logs of runs and of tables, and compiled programs.
SHARED = ("logs", ".jax_cache")
# In the environment: PROCESS:NAME of results that are held, for processes below.
HELD = "ALIGNERF_HELD"


def check_folders(scenes, methods, results="results"):
    """ValueError for a file or a link in the place of a folder, and for a folder of a
    scene which is a user's.
    """
    for folder in folders_of(scenes, methods, results):
        # What is not there will be made.
        if os.path.lexists(folder) and not folder.is_dir():
            raise ValueError(
                f"{folder}: a folder was expected there: move this file away"
            )
        owned.check_links(folder)
    for shared in SHARED:
        owned.check_links(Path(results, shared))
    for scene in scenes:
        if not is_stored(Path(results, scene)):
            owned.check(Path(results, scene))


def check_writable(scenes, methods, results="results"):
    """ValueError for a folder in which this user can write nothing."""
    for folder in folders_of(scenes, methods, results):
        if folder.is_dir() and not os.access(folder, os.W_OK | os.X_OK):
            raise ValueError(f"{folder}: cannot be written to, by its permissions")


def claim(scenes, replaced=(), written=(), results="results"):
    """Put the mark into the folders of scenes, before any job begins.

    replaced: folders that jobs write as a whole. written: all that they write.
    ValueError for a user's file in one of the former, and for a link in any.
    """
    ours = [Path(results, scene) for scene in scenes]
    ours = [folder for folder in ours if not is_stored(folder)]
    for folder in ours:
        owned.claim(folder)
    for path in written:
        owned.check_links(path)
    for path in replaced:
        if not {*ours}.isdisjoint(Path(path).parents):
            owned.check_replaced(path)


@contextlib.contextmanager
def held(*names, results="results"):
    """Keep results/NAME, of each, to this process and those that it starts.

    What a killed run has half written there goes. The locks end with the process, also
    where that is killed, and lie with what they guard: other checkouts may share it.
    Raises ValueError where a run is at work.
    """
    kept, own = os.environ.get(HELD, "").split(), f"{os.getpid()}:"
    above = {one.partition(":")[2] for one in kept if not one.startswith(own)}
    with contextlib.ExitStack() as stack:
        for name in sorted({*names}):
            path = lock_of(name, results).absolute()
            # Who starts others may be killed before them: they have a second lock.
            second = path.with_suffix(".jobs")
            if name in above:
                path = second
            # Of a run that was refused nothing is left.
            if not path.parent.exists():
                path.parent.mkdir()
                stack.callback(remove_empty, path.parent)
            try:
                stack.enter_context(filelock.FileLock(path, blocking=False))
                stack.callback(path.unlink, missing_ok=True)
                if second.exists() and name not in above:
                    with filelock.FileLock(second, blocking=False):
                        pass
            except filelock.Timeout:
                fault = f"{results}/{name}: another run is at work there"
                raise ValueError(fault) from None
            except OSError as error:
                raise ValueError(f"{path}: {error.strerror or error}") from None
            if name in above:
                continue
            tell_swept(atomic.sweep(path.parent, below=False))
            tell_swept(atomic.sweep(Path(results, name)))
        os.environ[HELD] = " ".join([*kept, *(own + name for name in names)])
        stack.callback(os.environ.__setitem__, HELD, " ".join(kept))
        yield


def hold(*names):
    """`held`, until this process ends."""
    stack = contextlib.ExitStack()
    stack.enter_context(held(*names))
    atexit.register(stack.close)


def lock_of(name, results="results"):
    """The lock of results/NAME."""
    return Path(results, f".{name}.held")


def remove_empty(folder):
    with contextlib.suppress(OSError):
        folder.rmdir()


def tell_swept(found):
    """Say what was removed of that which a killed run has half written."""
    if found:
        few = faults.some_names([faults.one_line(str(path)) for path in found])
        print(f"removed what a killed run had half written: {few}", file=sys.stderr)


def is_stored(folder):
    """Whether a folder holds a storage's copies, which come and go."""
    return owned.STORAGE in os.path.realpath(folder)


def check_apart(config, results="results"):
    """ValueError naming a key whose path lies in or above a folder that is written."""
    written = [Path(results, name) for name in (*SHARED, *config.scenes)]
    # Crops have the photos of their scene, whose key comes first.
    found = {
        path.replace("{scene}", scene).partition("{")[0]: key
        for key, path in reversed(config.paths().items())
        for scene in (config.scenes if "{" in path else [""])
    }
    check_reads(found, written)


def check_reads(paths, written):
    """The same of {path: key} and folders. Real paths count, as links lead to them."""
    every = [(k, one) for path, k in paths.items() if path for one in with_links(path)]
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


def lies_in(path, folder):
    """Whether a path is a folder, or lies below it, by what links lead to."""
    if not os.path.exists(folder):
        return False
    real = Path(os.path.realpath(path))
    return any(
        os.path.exists(one) and os.path.samefile(one, folder)
        for one in (real, *real.parents)
    )


def folders_of(scenes, methods, results):
    """Paths of the folders, those above before those below."""
    yield Path(results)
    for scene in scenes:
        yield Path(results, scene)
        for name in (*INSIDE, *methods):
            yield Path(results, scene, name)
