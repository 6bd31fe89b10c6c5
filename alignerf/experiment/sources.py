"""Which code a job runs, and where it finds it.

A change of the code, or of the libraries' versions, reruns the job.
"""

import ast
import functools
import hashlib
import importlib.util
import os
import sys
from pathlib import Path

from alignerf.io import machine, provenance
from alignerf.io.environment import extensions

ROOT, LOCK = provenance.ROOT, provenance.LOCK
PIPELINE = provenance.PIPELINE
# Of Snakemake: on its search path only where this project shows a run.
PLUGINS = PIPELINE / "workflow" / "plugins"
# Threads of a job that shares the machine with no other: Snakemake lowers them to its
# `--cores`, which it need not be given for a plan or a report.
WHOLE_MACHINE = machine.cores()
# A training or a rendering takes an accelerator, where there is one, or all of them,
# and all that feeds it.
ACCELERATORS = machine.accelerators()
# Without one it takes half of the cores: operations of small models are too short to
# share. Two trainings of the demo with a core each see 1.3 times as many rays a second
# as one with two. Over 4 cores one training gains little from more (see
# alignerf/processes/devices.py).
OF_TRAINING = WHOLE_MACHINE if ACCELERATORS else min(max(WHOLE_MACHINE // 2, 1), 4)

# {registry: group of entry points} of those whose every record runs where the registry
# is imported. Of the others a job runs a few, which its `Step` names.
RUN_WHOLE = {"alignerf.causes": "causes", "alignerf.testsets": "test_sets"}

# Compiled JAX programs.
CACHE = Path("results/.jax_cache")
# What commands read of their own package besides code.
DATA = (".html", ".css", ".js", ".yaml", ".cc", ".h")


def gpus(config) -> int:
    """Accelerators of this host that a training or a rendering takes."""
    return ACCELERATORS if config.gpus == "all" else min(ACCELERATORS, 1)


@functools.cache
def sources_of(*modules):
    """SHA-256 of all that the modules run, and of the pins of all libraries."""
    digest = hashlib.sha256()
    for path in sorted({path for module in modules for path in reached(module)}):
        digest.update(path.read_bytes())
        for beside in data_beside(path):
            digest.update(beside.read_bytes())
    if (ROOT / LOCK).is_file():
        digest.update((ROOT / LOCK).read_bytes())
    return digest.hexdigest()[:16]


def reached(module):
    """Files that a module imports, directly or not, and its own.

    Of this project, and of packages that add to it.
    """
    todo, seen = [module, f"{module}.__main__"], {}
    while todo:
        name = todo.pop()
        path = file_of(name)
        if path is None or name in seen:
            continue
        seen[name] = path
        own = name.removesuffix(".__init__")
        package = own.rpartition(".")[0]
        # Importing a module runs the packages that it lies in, but no records of these.
        todo += [f"{package}.__init__"] if package else []
        todo += imports(path, own if path.name == "__init__.py" else package)
        if name in RUN_WHOLE:
            todo += [f"{name}.{one.stem}" for one in path.parent.glob("*.py")]
            todo += [point.module for point in extensions.points(RUN_WHOLE[name])]
    return {*seen.values()}


def data_beside(path):
    """What a package holds besides modules, such as a page's template."""
    if path.name != "__init__.py":
        return []
    found = [*path.parent.glob("*"), *path.parent.glob("vendor/*")]
    return sorted(p for p in found if p.suffix in DATA)


def file_of(module):
    """The file of a module; None of one neither here nor of a package that adds."""
    parts = module.split(".")
    for root in filter(None, (ROOT, extensions.root_of(parts[0]))):
        path = root.joinpath(*parts)
        path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if path.is_file():
            return path
    return None


# Where a statement has others in it.
BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")


@functools.cache
def imports(path, package=""):
    """Names of the modules that a file imports; package: the one that it is in."""
    modules, todo = [], [ast.parse(path.read_bytes())]
    while todo:
        node = todo.pop()
        if getattr(getattr(node, "test", None), "id", "") == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            name = "." * node.level + (node.module or "")
            name = importlib.util.resolve_name(name, package)
            inside = [f"{name}.{alias.name}" for alias in node.names]
            modules += [full if file_of(full) else name for full in inside]
        # Of statements alone: expressions are most of a file, and import nothing.
        for name in BLOCKS:
            block = getattr(node, name, None)
            if isinstance(block, list):
                todo += block
    return modules


def set_environment(export=""):
    """Let jobs find these sources, wherever the results go, and our Python.

    That is the Python that runs Snakemake, also where its environment is not
    activated. Compiled JAX programs are kept between jobs and runs. export: as of
    `targets.export_command`.
    """
    os.environ[provenance.EXPORT] = export
    # Programs for one kind of processor can end the process on another: each kind has a
    # folder, also where the machine that submits jobs has named that of its own.
    if Path(os.environ.get("JAX_COMPILATION_CACHE_DIR", CACHE / "any")).parent == CACHE:
        os.environ["JAX_COMPILATION_CACHE_DIR"] = str(CACHE / machine.processor())
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.5")
    prepend("PYTHONPATH", ROOT)
    prepend("PATH", Path(sys.executable).parent)


def prepend(variable, folder):
    """Put a folder first in a search path; once, however often this is called."""
    rest = os.environ.get(variable, "").split(os.pathsep)
    kept = [part for part in rest if part and part != str(folder)]
    os.environ[variable] = os.pathsep.join([str(folder), *kept])
