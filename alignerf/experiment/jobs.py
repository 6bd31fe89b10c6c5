"""The environment that the jobs of a run inherit."""

import os
import sys
from pathlib import Path


def set_environment(root):
    """Let jobs find the sources in `root`, wherever the results go, and our Python.

    That is the Python that runs Snakemake, also where its environment is not
    activated. Compiled JAX programs are kept between jobs and runs.
    """
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path("results/.jax_cache")))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.5")
    prepend("PYTHONPATH", root)
    prepend("PATH", Path(sys.executable).parent)


def prepend(variable, folder):
    """Put a folder first in a search path; once, however often this is called."""
    rest = os.environ.get(variable, "").split(os.pathsep)
    kept = [part for part in rest if part and part != str(folder)]
    os.environ[variable] = os.pathsep.join([str(folder), *kept])
