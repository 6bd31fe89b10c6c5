"""What may be wrong with a file: each way as a function from its bytes to others.

A way returns None where it does not apply. Ways of a folder or a link change the place
itself. None of them is harmless by itself: a stage refuses it, or does not read it.
MUTATIONS are of any folder: a mutation is a function(folder, rng) that returns in words
what it has done; None where it does not apply. The same numbers do the same.
"""

import csv
import functools
import io
import json
import os
import shutil
import struct
import zipfile

import numpy as np
from PIL import Image

from tests import damaged_cases

BOMB_BYTES = 2**32
DEEP = 100_000


def ways_of(path):
    """{name: function(path, rng)} of all that may be done to a file or a folder."""
    if path.is_dir():
        return FOLDER_WAYS
    return ANY_WAYS | WAYS.get(path.suffix, {})


def rewritten(change):
    """A way that turns bytes into others; the file is a new one, not a link's other."""

    def apply(path, rng):
        found = change(path.read_bytes(), rng)
        if found is None:
            return False
        path.unlink()
        path.write_bytes(found)
        return True

    return apply


def removed(path, rng):
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    return True


def as_folder(path, rng):
    path.unlink()
    path.mkdir()
    return True


def as_link(target):
    def apply(path, rng):
        removed(path, rng)
        path.symlink_to(target or path.name)
        return True

    return apply


def as_fifo(path, rng):
    """Whoever opens it waits for a writer that never comes."""
    path.unlink()
    os.mkfifo(path)
    return True


def flipped(data, rng):
    """One bit in the middle half, where data is."""
    found = bytearray(data)
    if not found:
        return None
    place = int(rng.integers(len(found) // 4, max(3 * len(found) // 4, 1)))
    found[place] ^= 1 << int(rng.integers(8))
    return bytes(found)


ANY_WAYS = {
    "missing": removed,
    "a folder": as_folder,
    "a link to nothing": as_link("nowhere"),
    "a link to itself": as_link(None),
    "a pipe": as_fifo,
    "empty": rewritten(lambda data, rng: b""),
    "first half": rewritten(lambda data, rng: data[: len(data) // 2]),
    "last bytes missing": rewritten(lambda data, rng: data[:-9]),
    "random bytes": rewritten(lambda data, rng: rng.bytes(max(len(data), 64))),
    "zeros": rewritten(lambda data, rng: bytes(max(len(data), 64))),
    "text": rewritten(lambda data, rng: b"hello\n"),
    "another's bytes": rewritten(lambda data, rng: b"\x89PNG\r\n\x1a\n" + data),
}


# Folders.


def first_file(path):
    return min((p for p in path.rglob("*") if p.is_file()), default=None)


def of_first(way):
    """A way of the folder's first file."""

    def apply(path, rng):
        found = first_file(path)
        return found is not None and way(found, rng)

    return apply


def file_instead(path, rng):
    shutil.rmtree(path)
    path.write_text("hello\n")
    return True


def emptied(path, rng):
    shutil.rmtree(path)
    path.mkdir()
    return True


FOLDER_WAYS = {
    "missing": removed,
    "a file instead": file_instead,
    "empty": emptied,
    "a link to itself": as_link(None),
    "a view missing": of_first(removed),
    "a view cut": of_first(rewritten(lambda data, rng: data[: len(data) // 2])),
    "a view with a bit flipped": of_first(rewritten(flipped)),
    "a view is a folder": of_first(as_folder),
    "a view is text": of_first(rewritten(lambda data, rng: b"hello\n")),
}


# Arrays.


def rearranged(change):
    """A way that changes {name: array} of an .npz."""

    def apply(data, rng):
        with np.load(io.BytesIO(data)) as stored:
            arrays = dict(stored)
        arrays = change(arrays, rng)
        if arrays is None:
            return None
        found = io.BytesIO()
        np.savez(found, **arrays)
        return found.getvalue()

    return rewritten(apply)


def of_largest(function):
    """Changes the largest array alone; those of integers may have no such value."""

    def change(arrays, rng):
        key = max(arrays, key=lambda name: arrays[name].nbytes)
        changed = function(arrays[key], rng)
        return None if changed is None else arrays | {key: changed}

    return rearranged(change)


def of_each(function):
    def change(arrays, rng):
        return {name: function(array, rng) for name, array in arrays.items()}

    return rearranged(change)


def with_value(value):
    def change(array, rng):
        if array.dtype.kind != "f":
            return None
        found = array.copy()
        found.flat[int(rng.integers(found.size))] = value
        return found

    return change


def declared(shape_text):
    """An .npz whose first array says that it is of this shape, and holds little."""

    def apply(data, rng):
        with zipfile.ZipFile(io.BytesIO(data)) as stored:
            names = stored.namelist()
        head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape_text}, }}"
        head += " " * (-(len(head) + 11) % 64) + "\n"
        member = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode()
        found = io.BytesIO()
        with zipfile.ZipFile(found, "w") as archive:
            for name in names:
                archive.writestr(name, member + bytes(64))
        return found.getvalue()

    return rewritten(apply)


def bomb(data, rng):
    """Each member grows to four GiB of zeros."""
    with zipfile.ZipFile(io.BytesIO(data)) as stored:
        name = stored.namelist()[0]
    found = io.BytesIO()
    head = f"{{'descr': '|u1', 'fortran_order': False, 'shape': ({BOMB_BYTES},), }}"
    head += " " * (-(len(head) + 11) % 64) + "\n"
    packed = {"compression": zipfile.ZIP_DEFLATED, "compresslevel": 1}
    with (
        zipfile.ZipFile(found, "w", **packed) as archive,
        archive.open(name, "w", force_zip64=True) as member,
    ):
        member.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)))
        member.write(head.encode())
        block = bytes(2**24)
        for _ in range(BOMB_BYTES // len(block)):
            member.write(block)
    return found.getvalue()


def encrypted(data, rng):
    """The flag of encryption in all of an archive's heads."""
    found = bytearray(data)
    for mark, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        start = data.find(mark)
        while start >= 0:
            found[start + place] |= 1
            start = data.find(mark, start + 4)
    return bytes(found)


def pickled(arrays, rng):
    return {name: np.array([{"a": 1}], dtype=object) for name in arrays}


NPZ_WAYS = {
    "a bit flipped": rewritten(flipped),
    "an array missing": rearranged(lambda a, rng: dict(list(a.items())[1:])),
    "NaN": of_largest(with_value(np.nan)),
    "infinite": of_largest(with_value(np.inf)),
    "1e30": of_largest(with_value(1e30)),
    "pickled objects": rearranged(pickled),
    "a head of 10^12 values": declared("(1000000, 1000000)"),
    "a head of negative size": declared("(-1, 4)"),
    "a zip bomb": rewritten(bomb),
    "encrypted": rewritten(encrypted),
}


# Images.


def redrawn(function, **options):
    def apply(data, rng):
        with Image.open(io.BytesIO(data)) as image:
            image.load()
            found = io.BytesIO()
            function(image).save(found, **{"format": "PNG", **options})
        return found.getvalue()

    return rewritten(apply)


POSTSCRIPT = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 48 36\nshowpage\n"

PNG_WAYS = {
    "a bit flipped": rewritten(flipped),
    "a pixel wider": redrawn(
        lambda image: image.resize((image.width + 1, image.height))
    ),
    "grey": redrawn(lambda image: image.convert("L")),
    "alpha": redrawn(lambda image: image.convert("RGBA")),
    "palette": redrawn(lambda image: image.convert("P")),
    "a JPEG": redrawn(lambda image: image, format="JPEG"),
    "a GIF": redrawn(lambda image: image, format="GIF"),
    "PostScript": rewritten(lambda data, rng: POSTSCRIPT),
    "13000 pixels wide": redrawn(lambda image: image.resize((13000, 13000))),
    "one pixel": redrawn(lambda image: image.resize((1, 1))),
    "across": redrawn(lambda image: image.resize(image.size[::-1])),
    "black": redrawn(lambda image: Image.new("RGB", image.size)),
    "transparent": redrawn(lambda image: Image.new("RGBA", image.size)),
}


# Text of values.


def value_changed(data, rng):
    """A value anywhere is another, that of another place, gone, or there twice."""
    value = json.loads(data)
    places = [at for at in damaged_cases.places(value) if at]
    if not places:
        return None
    at = places[rng.integers(len(places))]
    around, how = within(value, at[:-1]), rng.integers(5)
    if how == 0 and isinstance(around, list):
        around.insert(at[-1], around[at[-1]])
    elif how == 1:
        like = [one for one in places if one[-1] == at[-1]]
        other = within(value, like[rng.integers(len(like))])
        value = damaged_cases.changed(value, at, other)
    else:
        value = damaged_cases.changed(value, at, VALUES[rng.integers(len(VALUES))])
    return json.dumps(value).encode()


def within(value, at):
    for key in at:
        value = value[key]
    return value


VALUES = [*damaged_cases.VALUES, 5e-324, 1e30, "../x", "x" * 100_000, "a\nb", "\x1b[0m"]


JSON_WAYS = {
    "a list": rewritten(lambda data, rng: b"[1, 2]"),
    "null": rewritten(lambda data, rng: b"null"),
    "a number of 5000 digits": rewritten(lambda data, rng: b"1" * 5000),
    "deep": rewritten(lambda data, rng: b"[" * DEEP),
    "deep and whole": rewritten(lambda data, rng: b"[" * DEEP + b"]" * DEEP),
    "Latin-1": rewritten(lambda data, rng: b'{"\xe4": 1}'),
    **{f"a value changed ({n})": rewritten(value_changed) for n in range(8)},
}


def retabled(change):
    def apply(data, rng):
        rows = list(csv.reader(io.StringIO(data.decode())))
        if len(rows) < 2 or (rows := change(rows, rng)) is None:
            return None
        found = io.StringIO()
        csv.writer(found).writerows(rows)
        return found.getvalue().encode()

    return rewritten(apply)


# What a camera explains of a flow may be less than nothing: no number is wrong there.
ANY_NUMBER = ("camera_fraction",)


def with_cell(text):
    def change(rows, rng):
        row = rows[int(rng.integers(1, len(rows)))]
        places = [k for k, name in enumerate(rows[0]) if name not in ANY_NUMBER]
        row[int(rng.choice(places))] = text
        return rows

    return change


CSV_WAYS = {
    "no head": retabled(lambda rows, rng: rows[1:]),
    "a head alone": retabled(lambda rows, rng: rows[:1]),
    "a column missing": retabled(lambda rows, rng: [row[1:] for row in rows]),
    "a last column missing": retabled(lambda rows, rng: [row[:-1] for row in rows]),
    "a short row": retabled(lambda rows, rng: [*rows[:-1], rows[-1][:1]]),
    "a row twice": retabled(lambda rows, rng: [*rows, rows[-1]]),
    "a cell of a million letters": retabled(with_cell("x" * 10**6)),
    "Latin-1": rewritten(lambda data, rng: data + b"\xe4\xf6"),
    **{
        f"a cell is {text or 'empty'!r}": retabled(with_cell(text))
        for text in ("", "x", "nan", "inf", "1e999", "-1", "\0")
    },
}

MSGPACK_WAYS = {
    "deep": rewritten(lambda data, rng: b"\x91" * DEEP),
    "a length of 4 GiB": rewritten(lambda data, rng: b"\xc6\xff\xff\xff\xff" + data),
    "a map of 2^32": rewritten(lambda data, rng: b"\xdf\xff\xff\xff\xff"),
    "NaN in it": rewritten(
        lambda data, rng: data.replace(data[-8:-4], struct.pack("<f", np.nan))
    ),
    "a number": rewritten(lambda data, rng: b"\x07"),
}


def with_numbers(change):
    """A way of an .npy, whose array is changed in its place."""

    def apply(data, rng):
        rows = np.load(io.BytesIO(data))
        at = tuple(rng.integers(side) for side in rows.shape)
        change(rows, at, rng)
        found = io.BytesIO()
        np.save(found, rows)
        return found.getvalue()

    return rewritten(apply)


def another_number(rows, at, rng):
    rows[at] = rng.choice([0, -1, 1e-30, 1e30, np.nan, np.inf, 5e-324])


def another_row(rows, at, rng):
    rows[at[0]] = rows[rng.integers(len(rows))]


def bytes_changed(data, rng):
    """Eight bytes become others: a count, a number, a size."""
    if len(data) < 16:
        return None
    place = int(rng.integers(min(len(data), 400) - 8))
    values = [bytes(8), b"\xff" * 8, b"\0\0\0\0\0\0\xf8\x7f", rng.bytes(8)]
    return data[:place] + values[rng.integers(4)] + data[place + 8 :]


def word_changed(data, rng):
    """A word of a text becomes another, or is gone."""
    words = data.split(b" ")
    word = rng.choice(["0", "-1", "nan", "1e400", "x", "", "99999999999999999999"])
    words[rng.integers(len(words))] = str(word).encode()
    return b" ".join(words)


NPY_WAYS = {
    "another number": with_numbers(another_number),
    "another row": with_numbers(another_row),
}
BYTES_WAYS = {f"other bytes ({n})": rewritten(bytes_changed) for n in range(4)}
TEXT_WAYS = {f"another word ({n})": rewritten(word_changed) for n in range(4)}


PHOTOS = {".png", ".jpg", ".webp", ".bmp", ".tif"}
OTHERS = {".npy", ".bin", ".avi", ".txt"}
WAYS = {
    ".npz": NPZ_WAYS,
    **dict.fromkeys(PHOTOS, PNG_WAYS),
    ".json": JSON_WAYS,
    ".csv": CSV_WAYS,
    ".msgpack": MSGPACK_WAYS,
    ".npy": NPY_WAYS,
    **dict.fromkeys((".bin", ".avi"), BYTES_WAYS),
    ".txt": TEXT_WAYS,
}


# Any folder.

# What a file may be called.
NAMES = ("a\nerror: b", "\x1b[2J", "%03d", "-rf", "ä" * 60, "a b", "A.PNG", "x" * 250)
NAMES += ("=cmd|1", "a.png.png", "\u202egnp", "$(x)", "con", "..x", "concat:a", "'")


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


def damaged(folder, rng, suffixes=None):
    path = some(folder, rng, suffixes)
    if path is None or not path.is_file():
        return None
    ways = ways_of(path)
    # What is special to its kind is tried as often as what is not.
    chosen = [*ways] if rng.integers(2) else [*ways.keys() - ANY_WAYS.keys()] or [*ways]
    name = pick(sorted(chosen), rng)
    # These take seconds.
    if "bomb" in name or "13000" in name:
        return None
    try:
        done = ways[name](path, rng)
    # What is damaged already is no longer of its kind.
    except Exception:
        return None
    return f"{told(folder, path)} {name}" if done else None


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
    "a file": damaged,
    "a photo": functools.partial(damaged, suffixes=PHOTOS),
    "cameras": functools.partial(damaged, suffixes={".json"}),
    "cameras again": functools.partial(damaged, suffixes={".json"}),
    "another kind": functools.partial(damaged, suffixes=OTHERS),
}
