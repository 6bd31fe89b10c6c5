"""Gaussians of a .ply: of 3DGS and those that write alike, of Mip-Splatting, packed.

Files hold logarithms of scales, logits of opacities and colours by channel; what is
read here is ready to be rendered.
"""

import dataclasses
import logging
import math
import os

import numpy as np
import psutil

from alignerf.io import faults
from alignerf.splats import packed, plain, rows

log = logging.getLogger("alignerf")

# Variance in px^2 that is added on the screen. Brush and Mip-Splatting, whose filter is
# a pixel's box, take less than 3DGS, which only wants no Gaussian to fall between
# pixels.
DILATION_PX2, MIP_DILATION_PX2 = 0.3, 0.1
# How Brush and Postshot say that opacities are compensated for it.
COMMENTS = {
    "splatrendermode: default": (False, DILATION_PX2),
    "splatrendermode: mip": (True, MIP_DILATION_PX2),
    "antialiased 0": (False, DILATION_PX2),
    "antialiased 1": (True, DILATION_PX2),
}
# Of the free memory: the rest is for renders, and for what others take meanwhile.
USABLE = 0.8


@dataclasses.dataclass(frozen=True)
class Gaussians:
    """A splat, float32: means [n, 3] and scales [n, 3] (standard deviations) in the
    unit of its world, quaternions [n, 4] (w, x, y, z) of length 1, opacities [n] in
    [0, 1], spherical harmonics [n, k, 3].

    antialiased: opacities are compensated for the dilation; None where the file does
    not say. dilation_px2: the variance that is added on the screen.
    """

    means: np.ndarray
    scales: np.ndarray
    quaternions: np.ndarray
    opacities: np.ndarray
    sh: np.ndarray
    antialiased: bool | None = None
    dilation_px2: float = DILATION_PX2


def read(path) -> Gaussians:
    """The Gaussians of a .ply; those with NaN or infinite numbers are left out.

    Raises ValueError naming the file where it holds no splat, is cut off, or is larger
    than the free memory.
    """
    try:
        with faults.opened(path) as file:
            header = rows.read_header(file)
            kind = packed if packed.is_packed(header) else plain
            shapes = shapes_of(kind.coefficients(header))
            size = os.fstat(file.fileno()).st_size
            rows.check_sizes(header, kind.ELEMENTS, size)
            count = header.elements["vertex"].count
            check_memory(count, shapes)
            # What overflows is infinite, and left out.
            with np.errstate(over="ignore", invalid="ignore"):
                arrays = finite(kind.blocks(file, header), count, shapes)
    except ValueError as error:
        if isinstance(error, faults.Named):
            raise
        raise faults.Named(f"{path}: {error}") from None
    if left_out := count - len(arrays["means"]):
        told = f"{left_out:,} of {count:,} Gaussians"
        log.warning("%s: %s hold NaN or infinity and are left out", path, told)
    antialiased, dilation_px2 = filter_of(header)
    return Gaussians(**arrays, antialiased=antialiased, dilation_px2=dilation_px2)


def shapes_of(coefficients):
    """{array: shape of a row} of `Gaussians`; ValueError for no degree up to 3."""
    if coefficients not in (1, 4, 9, 16):
        raise ValueError(
            f"{coefficients} coefficients a channel are of no degree up to 3"
        )
    shapes = {"means": (3,), "scales": (3,), "quaternions": (4,), "opacities": ()}
    return shapes | {"sh": (coefficients, 3)}


def filter_of(header):
    """(antialiased, dilation_px2): what a file says of its filter on the screen."""
    if "filter_3D" in header.elements["vertex"].dtype.names:
        return True, MIP_DILATION_PX2
    told = [COMMENTS[line] for line in header.comments if line in COMMENTS]
    return told[-1] if told else (None, DILATION_PX2)


def finite(blocks, count, shapes):
    """{name: array} of blocks, without Gaussians that have NaN or infinite numbers."""
    found = {name: np.empty((count, *of), np.float32) for name, of in shapes.items()}
    kept = 0
    for block in blocks:
        block["quaternions"] = normalized(block["quaternions"])
        each = [np.isfinite(v).reshape(len(v), -1).all(1) for v in block.values()]
        whole = np.logical_and.reduce(each)
        begins, kept = kept, kept + np.count_nonzero(whole)
        for name, values in block.items():
            found[name][begins:kept] = values[whole]
    if not kept:
        raise ValueError(f"all of its {count:,} Gaussians hold NaN or infinity")
    return {name: values[:kept] for name, values in found.items()}


def check_memory(count, shapes):
    """ValueError where there are no Gaussians, or more than the free memory holds."""
    if not count:
        raise ValueError("a splat without Gaussians")
    need = 4 * count * sum(math.prod(of) for of in shapes.values())
    if need > (free := USABLE * psutil.virtual_memory().available):
        raise ValueError(
            f"{count:,} Gaussians take {need / 2**30:.3g} GiB of memory, and "
            f"{free / 2**30:.3g} are free"
        )


def normalized(quaternions):
    """Of length 1; one of length 0 turns nothing, as it does in PyTorch's trainers."""
    length = np.linalg.norm(quaternions.astype(np.float64), axis=1, keepdims=True)
    unit = quaternions / np.where(length > 0, length, 1)
    return np.where(length > 0, unit, (1, 0, 0, 0)).astype(np.float32)
