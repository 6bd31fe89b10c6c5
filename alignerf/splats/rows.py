"""The structure of a .ply: its header, and the rows of its elements in blocks.

What the header promises is held against the size of the file before any of it is read.
"""

import itertools
import re
from typing import NamedTuple

import numpy as np

# Each type has two names.
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2"}
TYPES |= {"int": "i4", "uint": "u4", "float": "f4", "double": "f8"}
TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"}
TYPES |= {"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}
MAX_LINE_BYTES, MAX_LINES = 4096, 4096
# Rows of a block: few enough for a core's cache.
BLOCK = 8192
# A number as text: a digit and a space.
LEAST_TEXT_BYTES = 2


class Element(NamedTuple):
    """name, count: of rows. dtype: of a row, a list in it as an object."""

    name: str
    count: int
    dtype: np.dtype


class Header(NamedTuple):
    """encoding: of ORDERS. elements: by name, in the file's order. begins: the first
    byte of the rows. comments: lower-case.
    """

    encoding: str
    elements: dict
    comments: tuple
    begins: int


def read_header(file) -> Header:
    """The header of an open .ply; ValueError, without the path, where it is none."""
    lines = [file.readline(MAX_LINE_BYTES).strip()]
    if lines[0] != b"ply":
        raise ValueError("not a .ply")
    while lines[-1] != b"end_header":
        line = file.readline(MAX_LINE_BYTES)
        if not line.endswith(b"\n") or len(lines) == MAX_LINES:
            raise ValueError("its header has no end")
        lines.append(line.strip())
    encoding, fields, counts, comments = None, {}, {}, []
    for line in (line.decode("latin-1") for line in lines[1:-1]):
        match line.split():
            case ["format", kind, _] if kind in ORDERS and not fields:
                order = ORDERS[encoding := kind]
            case ["element", name, count] if is_count(count) and name not in counts:
                counts[name], fields[name] = int(count), []
            case ["property", "list", _, _, field] if fields:
                fields[name].append((field, "O"))
            case ["property", kind, field] if kind in TYPES and fields and encoding:
                fields[name].append((field, order + TYPES[kind]))
            case ["comment" | "obj_info", *_]:
                comments.append(line.partition(" ")[2].strip().lower())
            case []:
                pass
            case _:
                raise ValueError(f"{line[:60]!a} in its header is none of a .ply")
    if encoding is None:
        raise ValueError("its header names no format")
    elements = {
        name: Element(name, counts[name], np.dtype(own)) for name, own in fields.items()
    }
    return Header(encoding, elements, tuple(comments), file.tell())


def is_count(text):
    """Whether a header's text is a number of rows that a file can have."""
    return re.fullmatch(r"\d{1,15}", text) is not None


def check_sizes(header, names, file_bytes):
    """ValueError where a file is too short for its elements, up to the last of names.

    Also where lists, which have no fixed size, lie before one of these.
    """
    need = header.begins
    for element in before(header, names):
        if element.dtype.hasobject:
            raise ValueError(f"lists of {element.name!a} lie before its Gaussians")
        row_bytes = element.dtype.itemsize
        if header.encoding == "ascii":
            row_bytes = LEAST_TEXT_BYTES * len(element.dtype)
        need += element.count * row_bytes
    # The last number of a text needs no space after it.
    if file_bytes < need - (header.encoding == "ascii"):
        raise ValueError(f"cut off: {file_bytes:,} bytes of at least {need:,}")


def before(header, names):
    """Elements from the first to the last of these names."""
    elements = list(header.elements.values())
    last = max(i for i, element in enumerate(elements) if element.name in names)
    return elements[: last + 1]


def blocks(file, header, name):
    """Yield (first row, rows as a structured array) of an element, block by block."""
    element = header.elements[name]
    if is_text := header.encoding == "ascii":
        file.seek(header.begins)
        earlier = sum(e.count for e in before(header, [name])[:-1])
        for _ in itertools.islice(file, earlier):
            pass
    for first in range(0, element.count, BLOCK):
        count = min(BLOCK, element.count - first)
        if is_text:
            yield first, text_rows(file, count, element.dtype)
        else:
            yield first, at(file, header, name, first, count)


def at(file, header, name, first, count):
    """Rows of an element of a binary file, from one of them on."""
    *earlier, element = before(header, [name])
    size = element.dtype.itemsize
    begins = header.begins + sum(e.count * e.dtype.itemsize for e in earlier)
    file.seek(begins + first * size)
    return np.frombuffer(file.read(count * size), element.dtype, count)


def text_rows(file, count, dtype):
    """The next rows of a text."""
    text = b"".join(itertools.islice(file, count))
    words = text.split()
    # Python would read it, as 10.
    if b"_" in text:
        raise ValueError("1_0 and the like are no numbers")
    if len(words) != count * len(dtype):
        raise ValueError(f"{len(words)} numbers where {count * len(dtype)} should be")
    numbers = np.array(words, np.float64).reshape(count, len(dtype))
    rows = np.empty(count, dtype)
    for i, field in enumerate(dtype.names):
        rows[field] = numbers[:, i]
    return rows
