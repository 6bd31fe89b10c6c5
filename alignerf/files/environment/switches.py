"""Variables of the environment that would change what JAX computes: left out.

JAX takes each of its settings from a variable too, and reads them when it is imported:
with JAX_ENABLE_X64=1 the same job trains another model. So this runs before, when
`alignerf` is imported. What is left, and may still change a last digit, is noted with
each training (`files.provenance`).
"""

import functools
import os
import re
import sys

# Where JAX runs, whom it meets, what it keeps, and what it logs.
KEPT = re.compile(
    r"JAX_(PLATFORMS|PLATFORM_NAME|\w+_VISIBLE_DEVICES|NUM_CPU_DEVICES"
    r"|COORDINATOR_\w+|NUM_PROCESSES|PROCESS_ID|LOCAL_DEVICE_IDS|\w+_INDEX"
    r"|CPU_\w+|CROSS_HOST_\w+|SHARE_BINARY_\w+|ENABLE_PREEMPTION_SERVICE"
    r"|ENABLE_RECOVERABILITY|\w*COMPILATION_CACHE\w*|\w*PERSISTENT_CACHE\w*"
    r"|LOG\w+|DEBUG_LOG_MODULES|EXPLAIN_CACHE_MISSES"
    r"|DUMP_\w+|TRACEBACK_\w+|\w*TRACEBACKS?_\w+|COMPILER_DETAILED_\w+"
    r"|DISABLE_MOST_OPTIMIZATIONS)"
)
# For those who look for a fault; they stop a run, or slow it down.
DEBUGGING = re.compile(
    r"JAX_(DEBUG_\w+|DISABLE_JIT|CHECK_TRACER_LEAKS|ENABLE_CHECKS|TRANSFER_GUARD\w*)"
)
# Flags of XLA's that round in another way, switched on.
INEXACT = re.compile(
    r"--xla_\w*(fast_math|fast_min_max|unsafe_math)\w*"
    r"(=(?!false\b|0\b)\S*)?(?=\s|$)",
    re.IGNORECASE,
)
# Under this name others find it again, whose programs may need it.
ASIDE = "ALIGNERF_LEFT_OUT_"


def settle(environ=os.environ, modules=sys.modules):
    """Take out of an environment what would change results, and say so once.

    Nothing is done where JAX is there already: it has read them.
    """
    if "jax" in modules:
        return
    kept = without_inexact(environ.get("XLA_FLAGS", ""))
    found = [name for name in environ if name.startswith("JAX_") and is_left_out(name)]
    found += ["XLA_FLAGS"] if kept is not None else []
    for name in sorted(found):
        if environ[name]:
            print(
                f"environment: {name}={environ[name]!r:.80} may change results, and "
                "is not used",
                file=sys.stderr,
            )
        environ[ASIDE + name] = environ.pop(name)
    if kept:
        environ["XLA_FLAGS"] = kept


def watch(modules=sys):
    """Let an import of JAX that fails at a variable's value end in one line."""
    modules.excepthook = functools.partial(say, modules.excepthook)


def say(others, kind, error, trace):
    """Print what ended the process; others: the hook for all that names no variable."""
    said = str(error).lower()
    # As JAX writes it: in lower case in some messages.
    named = [n for n in os.environ if n.startswith("JAX_") and n.lower() in said]
    if not (named and issubclass(kind, ValueError)) or os.environ.get("ALIGNERF_DEBUG"):
        return others(kind, error, trace)
    name = max(named, key=len)
    text = f"{name}={os.environ[name]!r:.80}: unset it: {error!s:.200}"
    return print(f"error: environment: {text}", file=sys.stderr)


def is_left_out(name):
    """Whether a variable of JAX's may change results or break a run."""
    if DEBUGGING.fullmatch(name) and os.environ.get("ALIGNERF_DEBUG"):
        return False
    return not KEPT.fullmatch(name)


def without_inexact(flags):
    """XLA_FLAGS without those that round in another way; None where there are none."""
    kept = " ".join(INEXACT.sub("", flags).split())
    return None if kept == " ".join(flags.split()) else kept


def restored(environ):
    """A copy of an environment as it was, for programs that are not ours."""
    found = {k: v for k, v in environ.items() if not k.startswith(ASIDE)}
    aside = {k.removeprefix(ASIDE): v for k, v in environ.items() if k not in found}
    return found | aside
