"""Which folders are this program's: a mark lies in each, written first.

A folder with files and without a mark is a user's: nothing is written into it. The mark
of a folder that is replaced as a whole lists its files: any other file is a user's, and
stays, and so is a link in the place of one. An empty mark, as `touch` makes it, takes
all there is for the program's.
"""

import json
import os
import re
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


def check(folder):
    """ValueError where a folder has files, and no mark."""
    if not is_marked(folder) and next(files_of(folder), None):
        raise ValueError(
            f"{folder}: has files, and none is {MARK}, the mark of this program: move "
            "it away, or give results another name (--name). Where all files are the "
            f"program's own: touch {folder}/{MARK}"
        )


def is_marked(folder):
    return (Path(folder) / MARK).is_file()


def claim(folder):
    """Make a folder with a mark; ValueError as of `check`."""
    check(folder)
    put(folder)


def put(folder, names=()):
    """Make a folder with a mark, or put one into it; `names` are files to come."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    if not is_marked(folder) or names:
        write_mark(folder, listed(folder) | set(names))


def seal(folder):
    """List a folder's files in its mark."""
    write_mark(folder, files_of(folder))


def write_mark(folder, names):
    """Whole or not at all: an empty one says another thing."""
    fresh = Path(folder) / FRESH
    fresh.write_text(json.dumps(sorted(names)))
    os.replace(fresh, Path(folder) / MARK)


def takes_all(folder):
    """Whether an empty mark takes all there is in a folder for the program's."""
    return is_marked(folder) and (Path(folder) / MARK).stat().st_size == 0


def listed(folder):
    """Relative paths of those files of a folder that its mark lists."""
    there = set(files_of(folder))
    if takes_all(folder):
        return there
    try:
        said = json_files.read_list(Path(folder) / MARK)
    except (OSError, ValueError):
        return set()
    # It could list anything, and what is listed is removed.
    names = {name for name in said if isinstance(name, str)} & there
    return {name for name in names if not Path(folder, name).is_symlink()}


def files_of(folder):
    """Relative paths of the files of a folder and below; a link counts as one."""
    for root, inner, names in os.walk(folder):
        inner[:] = [name for name in inner if not TEMPORARY.match(name)]
        links = [name for name in inner if os.path.islink(os.path.join(root, name))]
        for name in [*names, *links]:
            if name not in JUNK and not TEMPORARY.match(name):
                yield os.path.relpath(os.path.join(root, name), folder)


def others(folder):
    """Relative paths of a user's files in a folder, by its outermost marks."""
    if is_marked(folder):
        return sorted(set(files_of(folder)) - listed(folder))
    found = []
    for one in os.scandir(folder) if os.path.isdir(folder) else ():
        if TEMPORARY.match(one.name):
            continue
        if one.is_dir(follow_symlinks=False):
            found += [os.path.join(one.name, name) for name in others(one.path)]
        elif one.name not in JUNK:
            found.append(one.name)
    return sorted(found)


def check_replaced(folder):
    """ValueError where a folder that is about to be removed has a user's files."""
    if found := others(folder):
        raise ValueError(
            f"{Path(folder, found[0])}: not of this program, which replaces {folder}: "
            f"move it away ({faults.some_names(found)})"
        )


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
