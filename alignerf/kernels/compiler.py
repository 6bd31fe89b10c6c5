"""C++ sources compiled once for a kind of processor, with the user's compiler.

A library lies beside JAX's compiled programs, or in the user's cache. This module does
without JAX.
"""

import ctypes
import hashlib
import os
import shlex
import shutil
import subprocess
from pathlib import Path

from alignerf.io import atomic, machine

COMPILERS = ("c++", "g++", "clang++")
# Products and sums are not fused into one rounding: a kernel's bits then depend on the
# compiler and the processor as little as they can.
FLAGS = ("-std=c++17", "-O3", "-march=native", "-ffp-contract=off")
# Nobody asks errno of a negative root, nor the processor's flags of a comparison: loops
# with either become vectors.
FLAGS += ("-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC", "-w")
# A compilation takes three seconds.
MAX_S = 300


def load(name, sources, *, options=(), version=""):
    """The loaded library of a .cc, the first of `sources`, and of its headers.

    options: of the compiler, besides FLAGS. version: of headers that lie elsewhere.
    Raises ValueError, OSError or subprocess.SubprocessError where it cannot be made.
    """
    key = digest(sources, options=options, version=version)
    path = folder() / f"{name}-{machine.processor()}-{key}.so"
    if not path.is_file():
        compile_to(path, sources[0], options=options)
    return ctypes.CDLL(str(path))


def folder():
    """Where libraries lie: a folder of this user's own."""
    if beside := os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return Path(beside)
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "alignerf"


def digest(sources, *, options=(), version=""):
    """Changes with all that a library is made of."""
    found = hashlib.sha256(" ".join([version, *FLAGS, *options]).encode())
    for path in sources:
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


def compile_to(path, source, *, options=()):
    """Write the library; of several that do so at once each writes all of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic.replace_file(path) as temporary:
        command = [*compiler(), *FLAGS, *options, str(source)]
        done = subprocess.run(
            [*command, "-o", str(temporary)],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=MAX_S,
        )
        if done.returncode:
            said = done.stderr.strip().splitlines() or [f"ended with {done.returncode}"]
            raise ValueError(f"{command[0]}: {said[0]:.200}")
