"""The compiled library of the kernels; it includes JAX's headers."""

import functools
import logging
import subprocess
from pathlib import Path

import jax

from alignerf.kernels import compiler

log = logging.getLogger("alignerf")

SOURCES = tuple(
    Path(__file__).with_name(name)
    for name in ("kernels.cc", "adam.h", "elementary.h", "histograms.h", "lookup.h")
)
WITHOUT = "kernels: %s: JAX's own code is used, which takes half as long again and more"


@functools.cache
def library():
    """The loaded library; None, with a line in the log, where it cannot be made."""
    options = ("-I", jax.ffi.include_dir())
    try:
        return compiler.load(
            "kernels", SOURCES, options=options, version=jax.__version__
        )
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        log.warning(WITHOUT, error)
        return None
