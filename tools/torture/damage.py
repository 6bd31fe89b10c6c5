"""What may be wrong with a file: each way as a function from its bytes to others.

A way returns None where it does not apply. Ways of a folder or a link change the place
itself. None of them is harmless by itself: a stage refuses it, or does not read it.
"""

import csv
import io
import json
import os
import shutil
import struct
import zipfile

import numpy as np
from PIL import Image

BOMB_BYTES = 2**32
DEEP = 100_000


def ways_of(path):
    """{name: function(path, rng)} of all that may be done to a file or a folder."""
    if path.is_dir():
        return FOLDER_WAYS
    by_kind = {
        ".npz": NPZ_WAYS,
        ".png": PNG_WAYS,
        ".json": JSON_WAYS,
        ".csv": CSV_WAYS,
        ".msgpack": MSGPACK_WAYS,
    }
    return ANY_WAYS | by_kind.get(path.suffix, {})


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
}


# Text of values.

WRONG_VALUES = (
    None,
    "x",
    [],
    {},
    True,
    -1,
    10**400,
    float("nan"),
    float("inf"),
    "\0",
    [[[[0]]]],
)


def json_places(value, place=()):
    """The places of all values in nested lists and mappings, the whole one first."""
    yield place
    entries = value.items() if isinstance(value, dict) else ()
    if isinstance(value, list):
        entries = enumerate(value[:2])
    for key, entry in entries:
        yield from json_places(entry, (*place, key))


def with_wrong_value(data, rng):
    """A value anywhere is of another kind, or far from what it can be."""
    value = json.loads(data)
    places = list(json_places(value))[1:]
    if not places:
        return None
    *above, last = places[int(rng.integers(len(places)))]
    inner = value
    for key in above:
        inner = inner[key]
    inner[last] = WRONG_VALUES[int(rng.integers(len(WRONG_VALUES)))]
    return json.dumps(value).encode()


def without_a_key(data, rng):
    value = json.loads(data)
    places = [p for p in json_places(value) if p and isinstance(p[-1], str)]
    if not places:
        return None
    *above, last = places[int(rng.integers(len(places)))]
    inner = value
    for key in above:
        inner = inner[key]
    del inner[last]
    return json.dumps(value).encode()


JSON_WAYS = {
    "a list": rewritten(lambda data, rng: b"[1, 2]"),
    "null": rewritten(lambda data, rng: b"null"),
    "a number of 5000 digits": rewritten(lambda data, rng: b"1" * 5000),
    "deep": rewritten(lambda data, rng: b"[" * DEEP),
    "deep and whole": rewritten(lambda data, rng: b"[" * DEEP + b"]" * DEEP),
    "Latin-1": rewritten(lambda data, rng: b'{"\xe4": 1}'),
    **{f"a wrong value ({n})": rewritten(with_wrong_value) for n in range(8)},
    **{f"a key missing ({n})": rewritten(without_a_key) for n in range(3)},
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
