"""Which files are this program's: marks list them, and nothing else is removed.

A folder with files and without a mark is a user's: nothing is written into it. The mark
of a folder that is written as a whole lists its files: any other file there is a
user's, and stays. So is a link, which is neither written through nor removed.
"""

import json
import os
import re
import shutil
from pathlib import Path

from alignerf.io import faults, json_files

MARK = ".why-blurry"
# A mark that is being written.
FRESH = f"{MARK}.new"
# What the program is writing, or has half written (`atomic`): `.model.~host~123~abc`.
TEMPORARY = re.compile(r"\.[^/]*~(?P<host>[^~/]*)~(?P<process>\d+)~[^/]*\Z")
# Marks, and what systems and the workflow engine put into any folder.
JUNK = {MARK, FRESH, ".snakemake_timestamp"}
JUNK |= {".DS_Store", "Thumbs.db", "desktop.ini"}
# Where Snakemake has the copies of files that lie in a storage.
STORAGE = ".snakemake/storage"


def check(folder):
    """ValueError where a folder has files, and no mark; or lies behind a link."""
    check_links(folder)
    if not is_marked(folder) and next(files_of(folder), None):
        raise ValueError(
            f"{folder}: has files, and none is {MARK}, the mark of this program: move "
            "it away, or give results another name (--name)"
        )


def check_links(path):
    """ValueError where a path leads through a link below results/ or a marked folder.

    results/ itself may be one, as onto another disk. A scene's folder may lead into a
    storage of the workflow engine.
    """
    path, inside = Path(os.path.abspath(path)), False
    for one in [*reversed(path.parents), path]:
        if inside and one.is_symlink() and STORAGE not in os.readlink(one):
            raise ValueError(
                f"{one}: a link, and nothing is written through one: move it away, or "
                "let results/ itself be a link"
            )
        inside = inside or one == Path.cwd() / "results" or is_marked(one)


def is_marked(folder):
    return (Path(folder) / MARK).is_file()


def claim(folder):
    """Make a folder with a mark; ValueError as of `check`."""
    check(folder)
    put(folder)


def put(folder, names=()):
    """Make a folder with a mark, or put one into it; `names` are files to come."""
    check_links(folder)
    Path(folder).mkdir(parents=True, exist_ok=True)
    if not is_marked(folder) or names:
        write_mark(folder, listed(folder) | set(names))


def seal(folder):
    """List a folder's files in its mark."""
    write_mark(folder, files_of(folder))


def write_mark(folder, names):
    """Whole or not at all, also where the machine stops: an empty one lists nothing."""
    fresh = Path(folder) / FRESH
    with open(fresh, "w", encoding="utf-8") as file:
        json.dump(sorted(names), file)
        file.flush()
        os.fsync(file.fileno())
    os.replace(fresh, Path(folder) / MARK)


def listed(folder):
    """Relative paths of those files of a folder that its mark lists."""
    try:
        said = json_files.read_list(Path(folder) / MARK)
    except (OSError, ValueError):
        return set()
    # It could list anything, and what is listed is removed.
    names = {name for name in said if isinstance(name, str)} & set(files_of(folder))
    return {name for name in names if not Path(folder, name).is_symlink()}


def files_of(folder):
    """Relative paths of the files of a folder and below; a link counts as one."""
    for root, inner, names in os.walk(folder):
        inner[:] = [name for name in inner if not TEMPORARY.match(name)]
        links = [name for name in inner if os.path.islink(os.path.join(root, name))]
        for name in [*names, *links]:
            if name not in JUNK and not TEMPORARY.match(name):
                yield os.path.relpath(os.path.join(root, name), folder)


def own(folder):
    """Relative paths of this program's files in a folder, by its outermost marks.

    A mark that lists nothing, as a scene's does, leaves it to those below.
    """
    if found := listed(folder):
        return found
    for one in os.scandir(folder) if os.path.isdir(folder) else ():
        if one.is_dir(follow_symlinks=False) and not TEMPORARY.match(one.name):
            found |= {os.path.join(one.name, name) for name in own(one.path)}
    return found


def others(folder):
    """Relative paths of a user's files in a folder."""
    return sorted(set(files_of(folder)) - own(folder))


def check_replaced(folder):
    """ValueError where a folder that is about to be removed has a user's files."""
    if found := others(folder):
        raise ValueError(
            f"{Path(folder, found[0])}: not of this program, which replaces {folder}: "
            f"move it away ({faults.some_names(found)})"
        )


def remove(folder, is_ours=lambda name: False):
    """Remove this program's files from a folder, and what is empty then.

    is_ours: whether a file that no mark lists is, by its path in the folder. Returns
    the paths of a user's files, which stay.
    """
    check_links(folder)
    listed_ones = own(folder)
    for name in [*files_of(folder)]:
        path = Path(folder, name)
        if name in listed_ones or (is_ours(name) and not path.is_symlink()):
            path.unlink()
    for root, inner, names in os.walk(folder, topdown=False):
        inside = [one for one in inner if os.path.lexists(os.path.join(root, one))]
        if not inside and set(names) <= JUNK:
            for name in names:
                Path(root, name).unlink()
            os.rmdir(root)
    return sorted(files_of(folder))


def clear(folder):
    """Remove a folder that another program's command has to itself, with all of it."""
    check_links(folder)
    if Path(folder).is_dir():
        shutil.rmtree(folder)


def merge(fresh, folder):
    """Move a sealed folder's files into one that has a user's beside its own.

    ValueError, before anything is moved, where one of a user's is in the way.
    """
    new, before, theirs = listed(fresh), listed(folder), set(others(folder))
    for name in sorted(new):
        way = {name, *map(str, Path(name).parents)}
        # A user's folder in the place of a file is in the way, too.
        if (blocked := sorted(way & theirs)) or Path(folder, name).is_dir():
            one = Path(folder, *blocked[:1] or [name])
            raise ValueError(f"{one}: not of this program: move it away")
    # Should it be killed now, the next run knows all files that may be there.
    write_mark(folder, new | before)
    for name in before - new:
        Path(folder, name).unlink(missing_ok=True)
    for name in [*sorted(new), MARK]:
        Path(folder, name).parent.mkdir(parents=True, exist_ok=True)
        os.replace(Path(fresh, name), Path(folder, name))
