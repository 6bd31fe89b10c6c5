"""Which photo a name in a file means, and what its view is called.

Files that come with cameras name photos by paths: relative to one folder or another, of
another machine, with backslashes, in another case, with another suffix or none.
"""

import collections
import logging
import os
import re
import unicodedata
from pathlib import PurePosixPath
from urllib.parse import unquote

from alignerf.io import faults

log = logging.getLogger("alignerf")

SUFFIXES = frozenset(
    [".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp", ".heic", ".heif"]
)
# Folders beside photos whose images are none of them.
OTHERS = re.compile(
    r"__MACOSX|@eaDir|masks?|sparse.*|thumb(nail)?s?|previews?|(.*[_-])?(depths?|normals?|confidence)([_-].*)?|images_\d+",
    re.IGNORECASE,
)
# What a file of a photo's name says that it is: no photo, where there is one, too.
BESIDE = (
    r"depths?|normals?|masks?|conf(?:idence)?|disparity|semantics?|labels?|instances?"
    r"|thumb(?:nail)?s?"
)
PHOTO = "colou?r|rgb|image|img|frame|photo"
SCALE = re.compile(r"\d+x")
# More files are no folder of photos.
MAX_FILES = 100_000
# Of the photos that a file names, so many may have been sorted out.
MAX_MISSING = 1 / 3


def match(names, paths, where=None):
    """{name: path} of the names that mean one of the paths, which are `listed`.

    A name is looked up by its whole path, then by as many of its last folders as are
    needed, then by these without case and suffix. What fits two paths, or a path that
    two names fit, is not taken, nor one of another folder where the name's own is
    listed: no photo is taken for another, and none twice. where: the file, of which it
    is said once that names are not paths.
    """
    names, found = list(dict.fromkeys(names)), {}
    plain = {name: _parts(name) for name in names}
    whole = {path: _parts(path) for path in paths}
    deepest = max(map(len, whole.values()), default=0)
    folded, others = (
        {one: _folded(parts) for one, parts in of.items()} for of in (plain, whole)
    )
    for own, theirs in ((plain, whole), (folded, others)):
        _take(found, own, theirs)
        for depth in range(deepest, 0, -1):
            # Where its own folder is listed, a photo of another one is not meant.
            there = {parts[-depth - 1 : -1] for parts in others.values()}
            keys = {
                name: key
                for name, key in _tails(own, depth).items()
                if len(own[name]) == depth or folded[name][-depth - 1 : -1] not in there
            }
            _take(found, keys, _tails(theirs, depth))
    inexact = [
        name for name in names if name in found and plain[name] != whole[found[name]]
    ]
    if where and inexact:
        log.info(
            "%s: %d of %d photos are found by name: %s is %s",
            *(where, len(inexact), len(names), faults.name_of(inexact[0], 100)),
            faults.name_of(found[inexact[0]], 100),
        )
    return found


def _take(found, names, paths):
    """Add the names whose key is that of one path, and of no other name."""
    by_key = collections.defaultdict(list)
    for path, key in paths.items():
        by_key[key].append(path)
    times, taken = collections.Counter(names.values()), set(found.values())
    for name, key in names.items():
        fits = by_key.get(key, ())
        if name not in found and len(fits) == times[key] == 1 and fits[0] not in taken:
            found[name] = fits[0]


def _parts(name):
    """The parts of a path of any system, without those that lead nowhere."""
    parts = name.replace("\\", "/").split("/")
    return tuple(part for part in parts if part not in ("", "."))


def _folded(parts):
    """The parts without case, suffix, %20 and the ways of writing an accent."""
    if not parts:
        return parts
    parts = [unicodedata.normalize("NFC", unquote(part)) for part in parts]
    plain = [part.casefold() for part in parts]
    stem, dot, suffix = plain[-1].rpartition(".")
    return (
        *plain[:-1],
        stem if stem and dot + suffix in SUFFIXES else plain[-1],
    )


def _tails(parts_of, depth):
    """{one: its last parts} of those that have as many."""
    return {
        one: parts[-depth:] for one, parts in parts_of.items() if len(parts) >= depth
    }


def natural(name):
    """A sorting key by which 2 comes before 10."""
    return [int(t) if t.isdecimal() else t for t in re.split(r"(\d+)", name)]


def view_names(paths):
    """{path: name of its view}: its stem, and folders before it where stems collide."""
    names, depth = {}, {path: 1 for path in paths}
    while True:
        for path in paths:
            parts = PurePosixPath(os.path.splitext(path)[0]).parts
            names[path] = "_".join(parts[-depth[path] :])
        times = collections.Counter(names.values())
        deeper = [
            path
            for path in paths
            if times[names[path]] > 1 and depth[path] < len(PurePosixPath(path).parts)
        ]
        if not deeper:
            return names
        for path in deeper:
            depth[path] += 1


def without_kind(stem, kinds):
    """A file's stem without a word of `kinds` at its end, or before its number."""
    return re.sub(
        rf"^(?:{kinds})[._-]?(?=\d)|(?<=.)[._-](?:{kinds})$", "", stem, flags=re.I
    )


def photos_of(names):
    """The files' names of a folder without depth maps, masks, ... of photos in it."""
    stems = {name: os.path.splitext(name)[0] for name in names}
    bare = {name: without_kind(stem, BESIDE) for name, stem in stems.items()}
    plain = {name: without_kind(stem, PHOTO) for name, stem in bare.items()}
    own = {name for name in names if bare[name] == stems[name]}
    there = {plain[n] for n in own if os.path.splitext(n)[1].lower() in SUFFIXES}
    return [n for n in names if n in own or plain[n] not in there]


def listed(folder, suffixes=SUFFIXES):
    """Paths of the photos in a folder and below, relative to it, with slashes, sorted.

    Left out are hidden files, folders of what is beside photos (OTHERS), such files
    (`photos_of`), and of Nerfies' 1x, 2x, ... all but the first. Raises ValueError for
    more than MAX_FILES files.
    """
    found, seen = [], 0
    for root, inner, files in walk(folder):
        inner[:] = sorted(
            one for one in inner if one[0] != "." and not OTHERS.fullmatch(one)
        )
        scaled = sorted(filter(SCALE.fullmatch, inner), key=natural)
        inner[:] = [one for one in inner if one not in scaled[1:]]
        seen += len(files)
        if seen > MAX_FILES:
            raise ValueError(f"{folder}: over {MAX_FILES} files: not photos alone")
        inside = os.path.relpath(root, folder)
        for name in photos_of(files):
            if name[0] != "." and os.path.splitext(name)[1].lower() in suffixes:
                found.append(os.path.normpath(os.path.join(inside, name)))
    return sorted(path.replace(os.sep, "/") for path in found)


def walk(folder):
    """`os.walk` that follows links out of a folder, and enters each folder once."""
    own, entered = os.path.join(os.path.realpath(folder), ""), set()

    def is_new(path):
        # What a link inside leads to is found by its own name.
        at = os.path.realpath(path)
        return not (os.path.islink(path) and f"{at}{os.sep}".startswith(own))

    for root, inner, files in os.walk(folder, followlinks=True):
        if (at := os.path.realpath(root)) in entered:
            inner.clear()
            continue
        entered.add(at)
        inner[:] = [name for name in inner if is_new(os.path.join(root, name))]
        yield root, inner, files
