"""Variables of the environment: what would change results is left out, COLMAP quiet.

JAX reads its settings from variables when it is imported: with JAX_ENABLE_X64=1 the
same job trains another model. So each command begins with this, before that; a program
that imports `alignerf` keeps its variables. What is left, and may still change a last
digit, is noted with each training (`io.provenance`).
"""

import os
import re
import sys

CHANGING = re.compile(
    r"JAX_(ENABLE_X64|DEFAULT_\w+|RANDOM_\w+|THREEFRY_\w+|NUMPY_\w+|DISABLE_JIT"
    r"|DEBUG_NANS|DEBUG_INFS|OPTIMIZATION_LEVEL)"
)
# Under this name others find it again, whose programs may need it.
ASIDE = "ALIGNERF_LEFT_OUT_"
# COLMAP logs what ends its process alone, and into no file of the temporary folder.
QUIET = {"GLOG_minloglevel": "3", "GLOG_logtostderr": "1"}


def settle(environ=os.environ):
    """Take out of an environment what would change results, and say so once.

    COLMAP is made quiet where nobody has asked it to speak.
    """
    for name, value in QUIET.items():
        environ.setdefault(name, value)
    for name in sorted(filter(CHANGING.fullmatch, environ)):
        if name.startswith("JAX_D") and environ.get("ALIGNERF_DEBUG"):
            continue
        said = f"environment: {name}={environ[name]!r:.80} may change results, and "
        print(f"{said}is not used", file=sys.stderr)
        environ[ASIDE + name] = environ.pop(name)


def restored(environ):
    """A copy of an environment as it was, for programs that are not ours."""
    return {
        name.removeprefix(ASIDE): value
        for name, value in environ.items()
        if QUIET.get(name) != value
    }
