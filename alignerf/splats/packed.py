"""The compressed .ply of PlayCanvas and SuperSplat: 16 bytes a Gaussian, and its SH.

A chunk of 256 Gaussians has the least and the largest of its positions, logarithms of
scales, and colours. A row holds where between these it is, in 11, 10 and 11 bits or in
8 each; and its rotation, as the 3 smaller components of a quaternion in 10 bits each
and, in 2, the place of the largest.
"""

import numpy as np

from alignerf.splats import plain, rows

# The type of all properties that are read, by element.
ELEMENTS = {"chunk": "float", "vertex": "uint", "sh": "uchar"}
CHUNK = 256
WORDS = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
BOUNDS = {
    "position": ("x", "y", "z"),
    "scale": ("scale_x", "scale_y", "scale_z"),
    # Older files have none: their colours lie in [0, 1].
    "colour": ("r", "g", "b"),
}
SH_C0 = 0.28209479177387814


def is_packed(header):
    """Whether a file is of this kind."""
    vertex = header.elements.get("vertex")
    return bool(vertex) and not {*WORDS}.isdisjoint(vertex.dtype.names)


def coefficients(header):
    """Spherical harmonics of a channel; ValueError where the parts do not fit."""
    names = {name: one.dtype.names for name, one in header.elements.items()}
    if header.encoding == "ascii" or "chunk" not in names:
        raise ValueError("a compressed splat as text, or without its chunks")
    wanted = {"vertex": WORDS, "chunk": [], "sh": []}
    for parts in BOUNDS.values():
        own = [f"{end}_{part}" for end in ("min", "max") for part in parts]
        if parts != BOUNDS["colour"] or not {*own}.isdisjoint(names["chunk"]):
            wanted["chunk"] += own
    each = -(-len(names.get("sh", ())) // 3)
    wanted["sh"] = [f"f_rest_{i}" for i in range(3 * each)]
    for element, properties in wanted.items():
        for one in properties:
            if one not in names[element]:
                raise ValueError(f"a compressed splat whose {element} has no {one}")
            found = header.elements[element].dtype[one].str[1:]
            if found != rows.TYPES[kind := ELEMENTS[element]]:
                raise ValueError(f"a compressed splat whose {one} is no {kind}")
    counts = {name: one.count for name, one in header.elements.items()}
    if counts["chunk"] != -(-counts["vertex"] // CHUNK):
        raise ValueError(
            f"{counts['chunk']:,} chunks of {counts['vertex']:,} Gaussians"
        )
    if counts.get("sh", counts["vertex"]) != counts["vertex"]:
        raise ValueError("spherical harmonics that do not fit its Gaussians")
    return 1 + each


def blocks(file, header):
    """Yield {name: values} of a block, as of `ply.Gaussians`."""
    chunks = np.concatenate([block for _, block in rows.blocks(file, header, "chunk")])
    for first, block in rows.blocks(file, header, "vertex"):
        of = chunks[(first + np.arange(len(block))) // CHUNK]
        colour = bits(block["packed_color"], (24, 16, 8, 0), (8, 8, 8, 8))
        dc = (between(of, "colour", colour[:, :3]) - 0.5) / SH_C0
        scale = bits(block["packed_scale"], (21, 11, 0), (11, 10, 11))
        position = bits(block["packed_position"], (21, 11, 0), (11, 10, 11))
        yield {
            "means": between(of, "position", position),
            "scales": np.exp(between(of, "scale", scale)),
            "quaternions": quaternions(block["packed_rotation"]),
            "opacities": colour[:, 3],
            "sh": plain.harmonics(dc, rest(file, header, first, len(block))),
        }


def bits(words, shifts, widths):
    """Parts of words [b], each as [b, parts] float32 in [0, 1]."""
    masks = [2**width - 1 for width in widths]
    parts = [words >> s & m for s, m in zip(shifts, masks, strict=True)]
    return np.stack(parts, axis=-1).astype(np.float32) / np.float32(masks)


def between(of, name, share):
    """Numbers [b, 3] that lie so far from the least to the largest of their chunks."""
    if f"min_{BOUNDS[name][0]}" not in of.dtype.names:
        return share
    least, most = (
        plain.stack(of, [f"{end}_{part}" for part in BOUNDS[name]])
        for end in ("min", "max")
    )
    return least * (1 - share) + most * share


def quaternions(words):
    """[b, 4] (w, x, y, z), whose largest component follows from the others."""
    others = (bits(words, (20, 10, 0), (10, 10, 10)) - 0.5) * np.sqrt(np.float32(2))
    largest = np.sqrt(np.maximum(0, 1 - np.sum(others**2, axis=1)))
    place = (words >> 30).astype(int)[:, None]
    found = np.empty((len(words), 4), np.float32)
    np.put_along_axis(found, place, largest[:, None], axis=1)
    np.put_along_axis(found, np.arange(3) + (np.arange(3) >= place), others, axis=1)
    return found


def rest(file, header, first, count):
    """[b, 3 (k - 1)] by channel, of bytes; the outermost of these are -4 and 4."""
    if "sh" not in header.elements:
        return np.zeros((count, 0), np.float32)
    block = rows.at(file, header, "sh", first, count)
    names = [f"f_rest_{i}" for i in range(len(block.dtype))]
    values = plain.stack(block, names)
    share = np.where(values > 254, 1, np.where(values < 1, 0, (values + 0.5) / 256))
    return ((share - 0.5) * 8).astype(np.float32)
