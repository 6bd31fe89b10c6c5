"""What may happen to any folder: of its files, and of what JSON, tables and texts hold.

A mutation is a function(folder, rng) that returns in words what it has done; None where
it does not apply. The same numbers do the same.
"""

import json
import os
import shutil

import numpy as np
from PIL import Image

from tools.torture import damage

# What a file may be called.
NAMES = ("a\nerror: b", "\x1b[2J", "%03d", "-rf", "ä" * 60, "a b", "A.PNG", "x" * 250)
NAMES += ("=cmd|1", "a.png.png", "\u202egnp", "$(x)", "con", "..x", "concat:a", "'")
VALUES = (0, -1, 1, 0.5, 5e-324, 1e-30, 1e18, 1e30, 1e300, 2**63, 10**400, True, False)
VALUES += (None, "", "1", "../x", "x" * 100_000, "a\nb", "\x1b[0m", [], {}, [[]], [1])
VALUES += (float("nan"), float("inf"), -0.0)


def files_of(folder):
    return sorted(p for p in folder.rglob("*") if p.is_file() or p.is_symlink())


def pick(paths, rng):
    return paths[rng.integers(len(paths))]


def some(folder, rng, suffixes=None):
    """A file of the folder; None where none has such a suffix."""
    found = [p for p in files_of(folder) if not suffixes or p.suffix in suffixes]
    return pick(found, rng) if found else None


def told(folder, *paths):
    return " ".join(repr(str(path.relative_to(folder))) for path in paths)


def doubled(make):
    """A second name of a file, beside it or beside another one."""

    def apply(folder, rng):
        path, other = some(folder, rng), some(folder, rng)
        target = other.parent / f"{rng.integers(1000):03d}{path.suffix}"
        if target.exists() or not path.exists():
            return None
        make(path, target)
        return told(folder, path, target)

    return apply


def replaced(make):
    """A file in another's place."""

    def apply(folder, rng):
        path = some(folder, rng)
        other = some(folder, rng, {path.suffix})
        if other == path or not path.exists():
            return None
        other.unlink()
        make(path, other)
        return told(folder, path, other)

    return apply


def renamed(folder, rng):
    path = some(folder, rng)
    name = str(pick(NAMES, rng)) + (path.suffix if rng.integers(2) else "")
    if len(name.encode()) > 255 or (path.parent / name).exists():
        return None
    path.rename(path.parent / name)
    return told(folder, path, path.parent / name)


def of_other_case(folder, rng):
    path = some(folder, rng)
    path.rename(path.parent / path.name.swapcase())
    return told(folder, path)


def folder_as_link(folder, rng):
    """A folder becomes a link to another one."""
    inner = sorted(p for p in folder.rglob("*") if p.is_dir() and not p.is_symlink())
    if len(inner) < 2:
        return None
    path, other = pick(inner, rng), pick(inner, rng)
    if path == other or other in path.parents or path in other.parents:
        return None
    shutil.rmtree(other)
    other.symlink_to(path.resolve())
    return told(folder, path, other)


def damaged(folder, rng):
    path = some(folder, rng)
    if not path.exists():
        return None
    ways = damage.ways_of(path)
    name = pick(sorted(ways), rng)
    # A bomb of bytes takes seconds.
    if "bomb" in name or ways[name](path, rng) is False:
        return None
    return f"{told(folder, path)} {name}"


def resized(folder, rng):
    path = some(folder, rng, {".png", ".jpg", ".webp", ".bmp", ".tif"})
    if path is None or not path.exists():
        return None
    size = [(1, 1), (64, 48), (48, 64), (31, 200), (600, 40), (9000, 33)]
    size = size[rng.integers(len(size))]
    pixels = rng.integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    path.unlink()
    Image.fromarray(pixels).save(path)
    return f"{told(folder, path)} {size}"


def emptied(folder, rng):
    """All black, all white or all transparent."""
    path = some(folder, rng, {".png"})
    if path is None or not path.exists():
        return None
    with Image.open(path) as image:
        size = image.size
    mode, value = [("RGB", 0), ("RGB", 255), ("RGBA", 0), ("L", 0)][rng.integers(4)]
    path.unlink()
    Image.new(mode, size, (value,) * len(mode) if len(mode) > 1 else value).save(path)
    return f"{told(folder, path)} {mode} {value}"


def nodes_of(value, place=()):
    """All places of a JSON's value."""
    yield place
    inner = value.items() if isinstance(value, dict) else ()
    inner = enumerate(value) if isinstance(value, list) else inner
    for key, one in inner:
        yield from nodes_of(one, (*place, key))


def at(value, place):
    for key in place:
        value = value[key]
    return value


def json_changed(folder, rng):
    """A value of a JSON becomes another, that of another place, two, or none."""
    path = some(folder, rng, {".json"})
    if path is None:
        return None
    try:
        content = json.loads(path.read_text())
    except (ValueError, OSError):
        return None
    places = [place for place in nodes_of(content) if place]
    if not places:
        return None
    place = pick(places, rng)
    parent, key = at(content, place[:-1]), place[-1]
    how = ("other", "other", "of another place", "gone", "doubled")[rng.integers(5)]
    if how == "other":
        parent[key] = pick(VALUES, rng)
        how = f"= {parent[key]!r:.40}"
    elif how == "of another place":
        like = [p for p in places if p[-1] == key] if rng.integers(2) else places
        parent[key] = json.loads(json.dumps(at(content, pick(like, rng))))
    elif how == "gone":
        del parent[key]
    elif isinstance(parent, list):
        parent.insert(key, parent[key])
    path.unlink()
    path.write_text(json.dumps(content))
    return f"{told(folder, path)} {place} {how}"


def table_changed(folder, rng):
    """A cell of an array becomes another number, or a row that of another."""
    path = some(folder, rng, {".npy"})
    if path is None:
        return None
    try:
        rows = np.load(path)
        cell = tuple(rng.integers(side) for side in rows.shape)
        if rng.integers(2):
            rows[cell] = rng.choice([0, -1, 1e-30, 1e30, np.nan, np.inf, 5e-324])
        else:
            rows[cell[0]] = rows[rng.integers(len(rows))]
    except (ValueError, OSError, IndexError):
        return None
    path.unlink()
    np.save(path, rows)
    return f"{told(folder, path)} {cell}"


def bytes_changed(folder, rng):
    """Eight bytes of a file become others: a count, a number, a size."""
    path = some(folder, rng, {".bin", ".avi"})
    if path is None or not path.is_file():
        return None
    content = bytearray(path.read_bytes())
    if len(content) < 16:
        return None
    place = int(rng.integers(min(len(content), 400) - 8))
    values = [bytes(8), b"\xff" * 8, b"\0\0\0\0\0\0\xf8\x7f", rng.bytes(8)]
    content[place : place + 8] = values[rng.integers(4)]
    path.unlink()
    path.write_bytes(content)
    return f"{told(folder, path)} at {place}"


def word_changed(folder, rng):
    """A word of a text becomes another, or is gone."""
    path = some(folder, rng, {".txt"})
    if path is None or not path.is_file():
        return None
    lines = path.read_text(errors="replace").split("\n")
    line = int(rng.integers(len(lines)))
    words = lines[line].split(" ")
    word = str(rng.choice(["0", "-1", "nan", "1e400", "x", "", "99999999999999999999"]))
    words[rng.integers(len(words))] = word
    lines[line] = " ".join(words)
    path.write_text("\n".join(lines))
    return f"{told(folder, path)} line {line} {word!r}"


def linked(path, target):
    target.symlink_to(path.resolve())


MUTATIONS = {
    "a copy": doubled(shutil.copyfile),
    "a link": doubled(linked),
    "a hard link": doubled(os.link),
    "a copy instead": replaced(shutil.copyfile),
    "a link instead": replaced(linked),
    "renamed": renamed,
    "of other case": of_other_case,
    "a folder as a link": folder_as_link,
    "damaged": damaged,
    "resized": resized,
    "emptied": emptied,
    "json": json_changed,
    "json again": json_changed,
    "table": table_changed,
    "bytes": bytes_changed,
    "word": word_changed,
}
