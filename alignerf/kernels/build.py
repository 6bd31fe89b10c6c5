"""The compiled library: made once for a kind of processor, with the user's compiler.

It lies beside JAX's compiled programs, or in the user's cache.
"""

import ctypes
import functools
import hashlib
import logging
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import jax

from alignerf.io import atomic, machine

log = logging.getLogger("alignerf")

SOURCES = tuple(
    Path(__file__).with_name(name)
    for name in ("kernels.cc", "adam.h", "elementary.h", "histograms.h", "lookup.h")
)
COMPILERS = ("c++", "g++", "clang++")
# Products and sums are not fused into one rounding: a kernel's bits then depend on the
# compiler and the processor as little as they can.
FLAGS = ("-std=c++17", "-O3", "-march=native", "-ffp-contract=off")
# Nobody asks errno of a negative root, nor the processor's flags of a comparison: loops
# with either become vectors.
FLAGS += ("-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC", "-w")
# A compilation takes three seconds.
MOST_S = 300
WITHOUT = "kernels: %s: JAX's own code is used, which takes half as long again and more"


@functools.cache
def library():
    """The loaded library; None, with a line in the log, where it cannot be made."""
    try:
        path = folder() / f"kernels-{machine.processor()}-{digest()}.so"
        if not path.is_file():
            compile_to(path)
        return ctypes.CDLL(str(path))
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        log.warning(WITHOUT, error)
        return None


def folder():
    """Where it lies: a folder of this user's own."""
    if beside := os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return Path(beside)
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "alignerf"


def digest():
    """Changes with all that the library is made of."""
    found = hashlib.sha256(" ".join([jax.__version__, *FLAGS]).encode())
    for path in SOURCES:
        found.update(path.read_bytes())
    return found.hexdigest()[:16]


def compiler():
    """The words of the C++ compiler: CXX, or the first that is there."""
    if chosen := shlex.split(os.environ.get("CXX", "")):
        return chosen
    for name in COMPILERS:
        if found := shutil.which(name):
            return [found]
    raise ValueError(f"no C++ compiler ({', '.join(COMPILERS)})")


def compile_to(path):
    """Write the library; of several that do so at once each writes all of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic.replace_file(path) as temporary:
        command = [*compiler(), *FLAGS, "-I", jax.ffi.include_dir(), str(SOURCES[0])]
        done = subprocess.run(
            [*command, "-o", str(temporary)],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=MOST_S,
        )
        if done.returncode:
            said = done.stderr.strip().splitlines() or [f"ended with {done.returncode}"]
            raise ValueError(f"{command[0]}: {said[0]:.200}")
