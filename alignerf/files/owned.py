"""Which folders are this program's: a mark lies in each, written first.

A folder with files and without a mark is a user's: nothing is written into it. The mark
of a folder that is replaced as a whole lists its files: any other file is a user's, and
stays.
"""

import json
import os
from pathlib import Path

from alignerf.files import json_files

MARK = ".why-blurry"
# What systems and the workflow engine put into any folder.
JUNK = {MARK, ".DS_Store", "Thumbs.db", "desktop.ini", ".snakemake_timestamp"}


def check(folder):
    """ValueError where a folder has files, and no mark."""
    if not is_marked(folder) and next(files_of(folder), None):
        raise ValueError(
            f"{folder}: has files, and none is {MARK}, the mark of this program: give "
            f"results another name. Where they are its own: touch {folder}/{MARK}"
        )


def is_marked(folder):
    return (Path(folder) / MARK).is_file()


def claim(folder):
    """Make a folder with a mark; ValueError as of `check`."""
    check(folder)
    put(folder)


def put(folder):
    """Make a folder with a mark, or put one into it."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    (Path(folder) / MARK).touch()


def seal(folder):
    """List a folder's files in its mark."""
    (Path(folder) / MARK).write_text(json.dumps(sorted(files_of(folder))))


def listed(folder):
    """Relative paths of those files of a folder that its mark lists."""
    try:
        said = json_files.read_list(Path(folder) / MARK)
    # A mark alone is empty.
    except (OSError, ValueError):
        return set()
    # It could list anything, and what is listed is removed.
    names = {name for name in said if isinstance(name, str)}
    return names & set(files_of(folder))


def files_of(folder):
    """Relative paths of the files of a folder and below; a link counts as one."""
    for root, inner, names in os.walk(folder):
        links = [name for name in inner if os.path.islink(os.path.join(root, name))]
        for name in [*names, *links]:
            if name not in JUNK:
                yield os.path.relpath(os.path.join(root, name), folder)


def others(folder):
    """Relative paths of a user's files in a folder that is replaced, and below.

    Each is looked up in the mark of the folder nearest to it. Without any mark all are
    the program's, of a version before.
    """
    marks = [Path(root) for root, _, names in os.walk(folder) if MARK in names]
    ours = {
        os.path.relpath(one / name, folder) for one in marks for name in listed(one)
    }
    return sorted(set(files_of(folder)) - ours) if marks else []


def check_replaced(folder):
    """ValueError where a folder that is about to be removed has a user's file."""
    if os.path.isdir(folder) and (found := others(folder)):
        raise ValueError(
            f"{Path(folder, found[0])}: not of this program, which replaces {folder}: "
            "move it away"
        )


def merge(fresh, folder):
    """Move a sealed folder's files into one that has a user's beside its own.

    ValueError, before anything is moved, where one of a user's would be overwritten.
    """
    new, before = listed(fresh), listed(folder)
    if clash := sorted(new & set(others(folder))):
        raise ValueError(f"{Path(folder, clash[0])}: not of this program: move it away")
    # Should it be killed now, the next run knows all files that may be there.
    (Path(folder) / MARK).write_text(json.dumps(sorted(new | before)))
    for name in before - new:
        Path(folder, name).unlink(missing_ok=True)
    for name in [*sorted(new), MARK]:
        Path(folder, name).parent.mkdir(parents=True, exist_ok=True)
        os.replace(Path(fresh, name), Path(folder, name))
