"""Renders of a splat by the CPU, with 3DGS's arithmetic; `rasterize.cc` has the loops.

Unlike the kernels of the trainings it has no twin in JAX. A million Gaussians in
800 x 600 px take 0.3 s of a core.
"""

import ctypes
import functools
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.io import machine
from alignerf.kernels import compiler

SOURCES = (
    Path(__file__).with_name("rasterize.cc"),
    Path(compiler.__file__).with_name("elementary.h"),
)
# 3DGS renders what lies further away than this, in the world's unit; gsplat, nerfstudio
# and Brush take 0.01. It matters to Gaussians that float right before a camera.
NEAR = 0.2
# Of an alpha, in 3DGS; gsplat and Brush have 0.999. It hardly shows.
MAX_ALPHA = 0.99
# A side of the largest photo that there may be.
MAX_PX = 2**14


class Camera(NamedTuple):
    """world_to_camera [3, 4], with OpenCV's axes: x right, y down, z forward.

    Focal lengths and principal point in px, pixel centres at +0.5.
    """

    world_to_camera: np.ndarray
    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int


class Render(NamedTuple):
    """float32: colour [h, w, 3], on the background, from 0, not cut at 1; alpha [h, w].

    depth [h, w]: along the optical axis, the mean by the weights; 0 where alpha is 0.
    """

    colour: np.ndarray
    alpha: np.ndarray
    depth: np.ndarray


class _Gaussians(ctypes.Structure):
    _fields_ = (
        ("count", ctypes.c_int64),
        ("coefficients", ctypes.c_int32),
        *((n, ctypes.c_void_p) for n in ("means", "scales", "quaternions")),
        *((n, ctypes.c_void_p) for n in ("opacities", "sh")),
    )


class _View(ctypes.Structure):
    _fields_ = (
        ("rotation", ctypes.c_double * 9),
        ("translation", ctypes.c_double * 3),
        *((n, ctypes.c_double) for n in ("fx", "fy", "cx", "cy")),
        *((n, ctypes.c_double) for n in ("near", "dilation_px2")),
        ("max_alpha", ctypes.c_float),
        ("background", ctypes.c_float * 3),
        *((n, ctypes.c_int32) for n in ("width", "height", "antialiased", "threads")),
    )


@functools.cache
def library():
    """The compiled rasteriser; ValueError where it cannot be made."""
    try:
        found = compiler.load("splats", SOURCES, options=("-pthread",))
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        raise ValueError(
            f"a splat is rendered by a compiled program: {error}"
        ) from None
    found.alignerf_rasterize.restype = ctypes.c_int32
    return found


def render(
    gaussians,
    camera,
    *,
    background=(0, 0, 0),
    antialiased=None,
    dilation_px2=None,
    near=NEAR,
    max_alpha=MAX_ALPHA,
    threads=None,
) -> Render:
    """`ply.Gaussians` as a camera sees them; the same bits for any number of threads.

    antialiased, dilation_px2: instead of what the Gaussians say; not antialiased where
    nobody does. Raises ValueError for a camera that is none, or without a compiler.
    """
    pose = np.asarray(camera.world_to_camera, np.float64)
    if antialiased is None:
        antialiased = bool(gaussians.antialiased)
    if dilation_px2 is None:
        dilation_px2 = gaussians.dilation_px2
    check(camera, pose, near, dilation_px2)
    width, height = camera.width, camera.height
    view = _View(
        (ctypes.c_double * 9)(*pose[:, :3].ravel()),
        (ctypes.c_double * 3)(*pose[:, 3]),
        *(camera.fx, camera.fy, camera.cx, camera.cy),
        *(near, dilation_px2, max_alpha, (ctypes.c_float * 3)(*background)),
        *(width, height, antialiased, threads or machine.cores()),
    )
    arrays = arrays_of(gaussians)
    count, coefficients = arrays[-1].shape[:2]
    images = [np.empty((height, width, *of), np.float32) for of in ((3,), (), ())]
    failed = library().alignerf_rasterize(
        ctypes.byref(_Gaussians(count, coefficients, *(a.ctypes.data for a in arrays))),
        ctypes.byref(view),
        *(ctypes.c_void_p(image.ctypes.data) for image in images),
    )
    if failed:
        raise MemoryError(f"{count:,} Gaussians are too many to render")
    return Render(*images)


def arrays_of(gaussians):
    """Its arrays in the order of `_Gaussians`; ValueError where they do not fit."""
    names = ("means", "scales", "quaternions", "opacities", "sh")
    arrays = [np.ascontiguousarray(getattr(gaussians, n), np.float32) for n in names]
    count, coefficients = arrays[-1].shape[:2]
    wanted = [(count, *of) for of in ((3,), (3,), (4,), (), (coefficients, 3))]
    if coefficients not in (1, 4, 9, 16) or [a.shape for a in arrays] != wanted:
        raise ValueError("arrays that are not of the same Gaussians")
    return arrays


def check(camera, pose, near, dilation_px2):
    """ValueError where a camera is none, or a number of the projection is no length."""
    sizes = camera.width, camera.height
    if pose.shape != (3, 4) or not np.isfinite(pose).all():
        raise ValueError("a camera's pose is 3 x 4 finite numbers")
    if not all(1 <= size <= MAX_PX for size in sizes):
        raise ValueError(f"a render of {sizes[0]} x {sizes[1]} px")
    if not np.isfinite([camera.cx, camera.cy]).all():
        raise ValueError(f"a principal point at {camera.cx}, {camera.cy}")
    lengths = camera.fx, camera.fy, near, dilation_px2
    if not all(1e-9 < length < 1e9 for length in lengths):
        raise ValueError(f"focal lengths, near plane, dilation {lengths}: of no length")
