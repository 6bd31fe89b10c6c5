"""The .ply of 3DGS, gsplat, Brush, OpenSplat and Postshot: a property a number.

Mip-Splatting's has a property more, the size of its 3D filter.
"""

import numpy as np

from alignerf.io import faults
from alignerf.splats import rows

ELEMENTS = ("vertex",)
# Properties of a row, and what they are of `ply.Gaussians`.
PROPERTIES = {
    "means": ("x", "y", "z"),
    "scales": ("scale_0", "scale_1", "scale_2"),
    "quaternions": ("rot_0", "rot_1", "rot_2", "rot_3"),
    "opacities": ("opacity",),
    "dc": ("f_dc_0", "f_dc_1", "f_dc_2"),
}


def coefficients(header):
    """Spherical harmonics of a channel; ValueError where a file holds no splat."""
    vertex = header.elements.get("vertex")
    there = set(vertex.dtype.names if vertex else ())
    wanted = {name for names in PROPERTIES.values() for name in names}
    if (missing := wanted - there) == {"scale_2"}:
        raise ValueError("flat Gaussians of 2DGS, which are rendered otherwise")
    if missing:
        what = "a mesh" if "face" in header.elements else "points"
        few = faults.some_names(sorted(missing))
        raise ValueError(f"{what}, not a splat: its vertices have no {few}")
    rest = rest_of(there)
    if rest % 3 or any(f"f_rest_{i}" not in there for i in range(rest)):
        raise ValueError(f"{rest} properties f_rest: not of three channels")
    return 1 + rest // 3


def rest_of(names):
    """How many properties hold coefficients beyond the first of a channel."""
    return sum(name.startswith("f_rest_") for name in names)


def blocks(file, header):
    """Yield {name: values} of a block, as of `ply.Gaussians`."""
    for _, block in rows.blocks(file, header, "vertex"):
        columns = {name: stack(block, of) for name, of in PROPERTIES.items()}
        scales = np.exp(columns["scales"])
        opacities = 1 / (1 + np.exp(-columns["opacities"][:, 0]))
        if "filter_3D" in block.dtype.names:
            size = np.abs(block["filter_3D"].astype(np.float32))
            scales, opacities = filtered(scales, opacities, size)
        names = [f"f_rest_{i}" for i in range(rest_of(block.dtype.names))]
        yield {
            "means": columns["means"],
            "scales": scales,
            "quaternions": columns["quaternions"],
            "opacities": opacities,
            "sh": harmonics(columns["dc"], stack(block, names)),
        }


def stack(block, names):
    """Properties of rows as an array [b, names] float32."""
    found = np.empty((len(block), len(names)), np.float32)
    for i, name in enumerate(names):
        found[:, i] = block[name]
    return found


def harmonics(dc, rest):
    """[b, k, 3] of the first ones [b, 3] and of others [b, 3 (k - 1)], by channel."""
    others = rest.reshape(len(rest), 3, rest.shape[1] // 3)
    return np.concatenate([dc[:, None], others.transpose(0, 2, 1)], axis=1)


def filtered(scales, opacities, size):
    """Convolved with Mip-Splatting's 3D filter of this size [b] (arXiv 2311.16493)."""
    wide = np.hypot(scales, size[:, None])
    share = np.divide(scales, wide, out=np.ones_like(scales), where=wide > 0)
    return wide, opacities * share.prod(axis=1)
