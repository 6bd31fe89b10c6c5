"""The points of a .ply file, which nerfstudio and 3D Gaussian splatting begin with.

Read are x, y, z and, where they are there, red, green, blue of its vertices: ASCII or
binary, little-endian or big. The format: Turk 1994.
"""

import io
import logging
import os
from pathlib import Path

import numpy as np

from alignerf.files import archives, faults

log = logging.getLogger("alignerf")

KINDS = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": None}
MOST_HEAD_BYTES, MOST_POINTS = 65536, 50_000_000


def of_scene(path, scene):
    """The points that a transforms.json names under `ply_file_path`, or None.

    A file that is missing or none is left out with a warning: cameras do without.
    """
    name = scene.get("ply_file_path")
    if name is None:
        return None
    folder = os.path.abspath(Path(path).parent)
    if not isinstance(name, str):
        raise ValueError(f"{path}: 'ply_file_path' must be a path")
    place = os.path.normpath(os.path.join(folder, name))
    if not place.startswith(folder.rstrip(os.sep) + os.sep):
        raise ValueError(f"{path}: {faults.shown(name)} leads out of its folder")
    try:
        return read(place)
    except (ValueError, OSError) as error:
        log.warning("no points: %s", error)
        return None


def read(path):
    """(positions [m, 3] float64, colours [m, 3] uint8) of a file's vertices.

    Colours are grey where it has none. Raises ValueError naming the file.
    """
    with faults.opened(path) as file:
        try:
            form, count, fields = head(file)
            check_size(file, form, count, fields)
            values = vertices(file, form, count, fields)
        except (ValueError, OverflowError, EOFError) as error:
            raise ValueError(f"{path}: not a readable .ply: {error}") from None
    positions = np.stack([values[axis] for axis in "xyz"], axis=-1).astype(np.float64)
    colours = np.full((count, 3), 128, np.uint8)
    if all(name in values.dtype.names for name in ("red", "green", "blue")):
        colours = np.stack([values[c] for c in ("red", "green", "blue")], axis=-1)
        colours = np.clip(colours, 0, 255).astype(np.uint8)
    known = np.isfinite(positions).all(axis=-1)
    return positions[known], colours[known]


def head(file):
    """(form, number of vertices, [(name, kind)]) of a file's head."""
    if file.readline(16).strip() != b"ply":
        raise ValueError("it does not begin with `ply`")
    form, count, fields, inside, first = None, None, [], False, True
    while True:
        line = file.readline(MOST_HEAD_BYTES)
        words = line.decode("ascii", "replace").split()
        if not line or file.tell() > MOST_HEAD_BYTES:
            raise ValueError("its head has no end")
        if words[:1] == ["format"] and len(words) > 1:
            form = words[1]
        elif words[:1] == ["element"] and len(words) == 3:
            inside = words[1] == "vertex"
            if inside and not first:
                raise ValueError("its vertices are not its first element")
            first, count = False, int(words[2]) if inside else count
        elif words[:1] == ["property"] and inside:
            if len(words) != 3 or words[1] not in KINDS:
                raise ValueError(
                    f"a property of vertices: {faults.shown(' '.join(words))}"
                )
            fields.append((words[2], KINDS[words[1]]))
        elif words == ["end_header"]:
            break
    if form not in ORDERS:
        raise ValueError(f"format {faults.shown(form)}")
    if count is None or not 0 <= count <= MOST_POINTS:
        raise ValueError(f"{count} vertices")
    if missing := set("xyz") - {name for name, _ in fields}:
        raise ValueError(f"vertices without {sorted(missing)[0]}")
    return form, count, fields


def check_size(file, form, count, fields):
    """ValueError where a file is shorter than its head says, or they take too much."""
    each = sum(int(kind[1]) for _, kind in fields)
    if count * each > archives.MOST_BYTES:
        raise ValueError(f"{count} vertices of {each} bytes are too many")
    # Of a text a number and what is behind it.
    least = 2 * len(fields) if form == "ascii" else each
    # The last line may have no end.
    if count * least > os.fstat(file.fileno()).st_size - file.tell() + 1:
        raise ValueError("it is cut short")


def vertices(file, form, count, fields):
    """The vertices [count] as a structured array."""
    if form == "ascii":
        lines = [file.readline(4096) for _ in range(count)]
        table = np.loadtxt(io.BytesIO(b"".join(lines)), ndmin=2) if count else None
        if count and table.shape[1] < len(fields):
            raise ValueError("a line is too short")
        found = np.zeros(count, [(name, kind) for name, kind in fields])
        for i, (name, _) in enumerate(fields):
            if count:
                found[name] = table[:, i]
        return found
    kind = np.dtype([(name, ORDERS[form] + one) for name, one in fields])
    content = file.read(count * kind.itemsize)
    if len(content) < count * kind.itemsize:
        raise ValueError("it is cut short")
    return np.frombuffer(content, kind)
