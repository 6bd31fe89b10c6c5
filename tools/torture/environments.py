"""Stages of a finished chain under environments that nobody expects.

The oracle: a stage makes the same files as before, or refuses in one line that names a
variable. A finding is made as small as it can be: one variable, mostly.
"""

import jax

from tools.torture import running, stages

# What JAX's settings of text and of choices may be given, besides nonsense.
WORDS = ("1", "0", "x", "", "bfloat16", "float32", "high", "strict", "raise", "rbg")
# Of other libraries, of Python and of the system. Left out are those that may change a
# last digit, which a training's timing.json notes.
OTHERS = {
    "JAX_PLATFORMS": ("cuda", "nonsense", "cpu", ""),
    # A flag that changes no digit.
    "XLA_FLAGS": ("--xla_dump_hlo_as_text=false",),
    "PYTHONHASHSEED": ("0", "7"),
    "PYTHONOPTIMIZE": ("1", "2"),
    "PYTHONUTF8": ("0", "1"),
    "PYTHONIOENCODING": ("ascii", "utf-16"),
    "LC_ALL": ("C", "POSIX", "tr_TR.UTF-8", "nonsense"),
    "TZ": ("Pacific/Kiritimati", "nonsense"),
    "HOME": ("/nowhere", ""),
    "COLUMNS": ("1", "x"),
    "TERM": ("dumb", ""),
    "OPENCV_LOG_LEVEL": ("DEBUG", "x"),
    "PANDAS_COPY_ON_WRITE": ("0",),
    "NUMEXPR_MAX_THREADS": ("x",),
    "GIT_DIR": ("/nowhere",),
    "SLURM_JOB_ID": ("x",),
    "SLURM_PROCID": ("3",),
    "MALLOC_ARENA_MAX": ("1",),
}
# Folders of a user's, which a run may make or read.
NOT_TRIED = ("CACHE", "DUMP", "COORDINATOR", "ADDRESS", "MOCK", "PROFIL")
MAX_AT_ONCE = 5


def variables():
    """{name: values} of all variables that are tried."""
    found = {}
    for name, value in jax.config.values.items():
        name = name.upper() if name.startswith("jax") else f"JAX_{name.upper()}"
        if not any(word in name for word in NOT_TRIED):
            flag = isinstance(value, bool)
            found[name] = (str(int(not value)), "x") if flag else WORDS
    return found | OTHERS


def drawn(random, known):
    """Some variables, each with one of its values."""
    names = random.sample(sorted(known), random.randint(1, MAX_AT_ONCE))
    return {name: random.choice(known[name]) for name in names}


def attack(stage, environment, base, place):
    """What is wrong with a stage under an environment; None where nothing is."""
    stages.copy_chain(base, place)
    for output in stage.outputs:
        made = place / output
        if made.is_file():
            made.unlink()
    before = stages.hidden(place)
    ended = running.run(stage.command, place, running.variables(place) | environment)
    if left := stages.hidden(place) - before:
        return f"left {min(left)} behind"
    if ended.code:
        return running.fault_of(ended, list(environment))
    if "Traceback" in ended.output:
        return "traceback"
    others = [
        out
        for out in stage.outputs
        if stages.content(base, out) != stages.content(place, out)
    ]
    return f"another {others[0]}" if others else None


def smallest(environment, is_bad):
    """Those variables without which there is no finding."""
    kept = dict(environment)
    for name in environment:
        fewer = {k: v for k, v in kept.items() if k != name}
        if fewer and is_bad(fewer):
            kept = fewer
    return kept
