"""Files of splats, as programs write them: plain ones, and PlayCanvas' compressed."""

import numpy as np

NAMES = {
    "means": [*"xyz"],
    "dc": ["f_dc_0", "f_dc_1", "f_dc_2"],
    "opacities": ["opacity"],
    "scales": ["scale_0", "scale_1", "scale_2"],
    "quaternions": ["rot_0", "rot_1", "rot_2", "rot_3"],
}
COUNT = 300


def columns(rng, *, rest=45, count=COUNT):
    """{property: numbers [count]} as 3DGS writes them."""
    names = [name for of in NAMES.values() for name in of]
    names += [f"f_rest_{i}" for i in range(rest)]
    return {name: rng.normal(size=count) for name in names}


def write(
    path, table, *, kind="f4", encoding="binary_little_endian", comments=(), more=""
):
    """A .ply of one element."""
    order = ">" if "big" in encoding else "<"
    type_name = {"f4": "float", "f8": "double"}[kind]
    head = ["ply", f"format {encoding} 1.0", *(f"comment {line}" for line in comments)]
    head += [f"element vertex {len(next(iter(table.values())))}"]
    head += [f"property {type_name} {name}" for name in table]
    values = np.stack(list(table.values()), axis=-1)
    rows = values.astype(order + kind).tobytes()
    if encoding == "ascii":
        rows = "".join(" ".join(map(repr, row)) + "\n" for row in values.tolist())
        rows = rows.encode()
    head = "\n".join([*head, f"{more}end_header", ""])
    path.write_bytes(head.encode() + rows)
    return path


def write_packed(path, gaussians, *, has_colours=True):
    """A compressed .ply of arrays as of `ply.Gaussians`."""
    count = len(gaussians.means)
    parts = {"xyz": gaussians.means, "scale_xyz": np.log(gaussians.scales)}
    colours = 0.5 + 0.28209479177387814 * gaussians.sh[:, 0]
    if has_colours:
        parts["rgb"] = colours
    bounds, shares = {}, {"rgb": colours}
    for name, values in parts.items():
        ends = []
        for end, of in (("min", np.min), ("max", np.max)):
            chunks = [of(values[i : i + 256], axis=0) for i in range(0, count, 256)]
            prefix = "scale_" if "scale" in name else ""
            for axis, column in zip(name[-3:], np.transpose(chunks), strict=True):
                bounds[f"{end}_{prefix}{axis}"] = column
            ends.append(np.repeat(chunks, 256, axis=0)[:count])
        shares[name] = (values - ends[0]) / (ends[1] - ends[0])
    words = np.stack(
        [
            pack(shares["xyz"], (11, 10, 11)),
            pack(turns(gaussians.quaternions), (2, 10, 10, 10)),
            pack(shares["scale_xyz"], (11, 10, 11)),
            pack(np.c_[shares["rgb"], gaussians.opacities], (8, 8, 8, 8)),
        ],
        axis=-1,
    )
    rest = gaussians.sh[:, 1:].transpose(0, 2, 1).reshape(count, -1)
    head = ["ply", "format binary_little_endian 1.0"]
    head += [f"element chunk {-(-count // 256)}"]
    head += [f"property float {name}" for name in bounds]
    head += [f"element vertex {count}"]
    of_words = ("position", "rotation", "scale", "color")
    head += [f"property uint packed_{name}" for name in of_words]
    if rest.size:
        head += [f"element sh {count}"]
        head += [f"property uchar f_rest_{i}" for i in range(rest.shape[1])]
    path.write_bytes(
        "\n".join([*head, "end_header", ""]).encode()
        + np.stack(list(bounds.values()), axis=-1).astype("<f4").tobytes()
        + words.astype("<u4").tobytes()
        + np.uint8(np.clip((rest / 8 + 0.5) * 256, 0, 255)).tobytes()
    )
    return path


def pack(values, widths):
    """Numbers [n, parts] in [0, 1] as words, the first part in the highest bits."""
    words = np.zeros(len(values), np.uint32)
    for value, width in zip(values.T, widths, strict=True):
        words = words << width | np.uint32(np.round(value * (2**width - 1)))
    return words


def turns(quaternions):
    """[n, 4] in [0, 1]: the place of the largest component, and the others."""
    place = np.abs(quaternions).argmax(axis=1)
    sign = np.sign(quaternions[np.arange(len(place)), place])
    others = np.array(
        [np.delete(q, i) for q, i in zip(quaternions, place, strict=True)]
    )
    return np.c_[place / 3, sign[:, None] * others / np.sqrt(2) + 0.5]
