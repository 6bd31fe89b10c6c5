"""Imports point downwards only: from the stages through the floors to the baseline."""

import ast
import functools
import graphlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): path
    for package in ("alignerf", "flow")
    for path in sorted((ROOT / package).rglob("*.py"))
}
# Lowest first. A folder imports itself and folders of lower floors, nothing else. A
# module that has a floor of its own is what a registry's records answer to.
FLOORS = [
    {"alignerf.io"},
    {"alignerf.kernels", "alignerf.keypoints", "alignerf.testsets"},
    {"alignerf.mipnerf360", "alignerf.splats"},
    {
        *("alignerf.experiment", "alignerf.methods", "alignerf.systems"),
        *("alignerf.captures.base", "alignerf.captures.crops"),
        "alignerf.captures.__init__",
        *("alignerf.processes", "alignerf.networks"),
    },
    {"alignerf.metrics"},
    {
        *("alignerf.fields", "alignerf.scenes", "alignerf.tables"),
        *("flow.warping", "flow.camera"),
    },
    {"alignerf.colmap", "alignerf.courtyard"},
    {"alignerf.readers"},
    {"alignerf.judged", "alignerf.sfm"},
    {"alignerf.captures"},
    {
        *("alignerf.contributions", "alignerf.rays", "alignerf.cameras"),
        "alignerf.causes",
        "alignerf.exports",
        *("flow.estimation", "flow.figures"),
    },
    {"alignerf.training", "alignerf.verdict", "alignerf.external"},
    {"alignerf.alignment", "alignerf.costs", "alignerf.page"},
    {"alignerf.cli"},
    {"alignerf.api"},
    {"alignerf", "flow"},  # the stages: files directly in a package
]
# What a config means: a registry's records and what reads them know each other.
TIED = {"alignerf.experiment", "alignerf.methods", "alignerf.systems"}
TIED |= {f"alignerf.captures.{name}" for name in ("__init__", "base", "crops")}
# Folders that hold commands besides the stages.
COMMANDS = ("alignerf.networks", "alignerf.tables", "flow.figures")
COMMANDS += ("alignerf.costs", "alignerf.verdict")
COMMANDS += ("alignerf.page", "alignerf.cli", "alignerf.external", "alignerf.scenes")
MAX_MODULES = 12
FORBIDDEN = {"snakemake", "pickle", "dill", "joblib", "marshal", "shelve"}
JAX = {"jax", "flax", "optax"}
MODULES = sorted(SOURCES)


@functools.cache
def tree_of(name):
    return ast.parse(SOURCES[name].read_text())


def without_types(tree):
    """A module without what it imports for a checker of types alone."""
    kept = [
        node
        for node in tree.body
        if getattr(getattr(node, "test", None), "id", "") != "TYPE_CHECKING"
    ]
    return ast.Module(kept, tree.type_ignores)


@functools.cache
def imports(name):
    """Full names of all modules that a module imports, at once or when it is called."""
    found = set()
    for node in ast.walk(without_types(tree_of(name))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: relative import"
            inside = [f"{node.module}.{alias.name}" for alias in node.names]
            ours = [full for full in inside if full in SOURCES or is_package(full)]
            found |= {*(ours or [node.module])}
    return found


def is_package(name):
    return f"{name}.__init__" in SOURCES


def tops(name):
    """The packages that a module imports from."""
    return {full.split(".")[0] for full in imports(name)}


@functools.cache
def own_imports(name):
    """The modules of this project among them; a package is its __init__."""
    return {
        f"{full}.__init__" if is_package(full) else full
        for full in imports(name)
        if full.split(".")[0] in ("alignerf", "flow")
    }


def is_entry(name):
    """Whether `python -m name` runs it."""
    return "__name__ == '__main__'" in ast.unparse(tree_of(name))


def folder(name):
    """`alignerf.readers` of alignerf.readers.programs.tum; of a stage its package."""
    return ".".join(name.split(".")[:-1][:2])


def home(name):
    """What has a floor: a module of its own, or its folder."""
    return name if any(name in floor for floor in FLOORS) else folder(name)


def floor(name):
    (found,) = (i for i, floor in enumerate(FLOORS) if home(name) in floor)
    return found


def reached(name):
    """All modules of this project that importing a module imports."""
    todo, seen = [name], set()
    while todo:
        if (module := todo.pop()) not in seen:
            seen.add(module)
            packages = [".".join(module.split(".")[:n]) for n in (1, 2, 3)]
            todo += [f"{p}.__init__" for p in packages if is_package(p)]
            todo += own_imports(module)
    return seen


def test_imports_point_downwards():
    """Below a package's own folder; the stages may import all."""
    arrows = [
        (n, found) for n in MODULES if n.count(".") > 1 for found in own_imports(n)
    ]
    assert not {found for _, found in arrows} - SOURCES.keys()
    upwards = [
        f"{name} imports {found}"
        for name, found in arrows
        if home(found) != home(name)
        and floor(found) >= floor(name)
        and not {home(found), home(name)} <= TIED
    ]
    assert not upwards


def test_what_lies_directly_in_a_package_is_a_command():
    modules = [name for name in MODULES if not name.endswith("__init__")]
    entries = {name for name in modules if is_entry(name)}
    homeless = [n for n in modules if n.count(".") == 1 and n not in entries]
    assert not homeless, "give them a folder"
    assert not [n for n in entries if n.count(".") > 1 and folder(n) not in COMMANDS]
    # Commands are run, not imported.
    assert not [(n, found) for n in modules for found in own_imports(n) & entries]


def test_no_folder_holds_too_many_modules():
    packages = {name.rpartition(".")[0] for name in MODULES}
    for package in packages:
        inside = [m for m in MODULES if m.rpartition(".")[0] == package]
        inside = [m for m in inside if not m.endswith("__init__")]
        # A registry has as many as there are sources.
        assert len(inside) <= MAX_MODULES or package == "alignerf.captures", package


def test_the_flow_reaches_the_commands_tools_only_and_no_jax():
    flow = [name for name in MODULES if name.startswith("flow.")]
    below = set().union(*map(reached, flow)) - {"alignerf.__init__"}
    outside = {name for name in below if not name.startswith("flow.")}
    allowed = ("alignerf.io", "alignerf.testsets")
    assert not [name for name in outside if folder(name) not in allowed]
    assert not [name for name in below if tops(name) & JAX]


def test_the_packages_are_kept_apart():
    """Both meet in a process only where flow puts something right, and on the page."""
    meeting = ("alignerf.correct_poses", "alignerf.align_test_poses")
    meeting += ("alignerf.page.gallery",)
    for name in MODULES:
        met = name.startswith(("alignerf.alignment.", "alignerf.exports."))
        apart = not met and name not in meeting
        if name.startswith("alignerf.") and apart:
            assert not [f for f in own_imports(name) if f.startswith("flow.")], name


def test_the_embedded_scene_knows_no_other_source():
    for name in MODULES:
        if name.startswith("alignerf.courtyard."):
            siblings = {f for f in own_imports(name) if f.count(".") == 2}
            siblings = {f for f in siblings if f.startswith("alignerf.scenes.")}
            known = {"alignerf.scenes.cameras", "alignerf.scenes.prepare"}
            assert siblings <= known, name


def test_a_plan_waits_for_no_jax():
    """In a fresh interpreter: what the Snakefile imports, and what comes with it."""
    code = (
        "import sys, pkgutil, importlib, alignerf.experiment as e;"
        "[importlib.import_module(f'alignerf.experiment.{m.name}')"
        " for m in pkgutil.iter_modules(e.__path__)];"
        "print(*sorted({name.split('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    assert "alignerf" in loaded
    assert not loaded & {*JAX, "snakemake", "numpy", "pandas", "cv2"}


def test_nothing_reaches_the_tests_or_the_tools():
    """Of the product; tools and tests may import all of it."""
    for name in MODULES:
        tops = {full.split(".")[0] for full in imports(name)}
        assert not tops & {"tools", "tests"}, name


def test_the_experiment_reaches_plain_libraries_only():
    allowed = {*sys.stdlib_module_names, "pydantic", "yaml", "filelock", "alignerf"}
    for name in MODULES:
        if name.startswith("alignerf.experiment."):
            outside = set().union(*map(tops, reached(name))) - allowed
            # What the commands share may use more, where a plan does not import it.
            assert not outside, (name, outside)


def test_there_are_no_cycles():
    graph = {name: own_imports(name) - {name} for name in MODULES}
    graphlib.TopologicalSorter(graph).prepare()


def test_nothing_is_unpickled_evaluated_or_repaired_in_silence():
    assert not [name for name in MODULES if tops(name) & FORBIDDEN]
    found = [
        (name, node.lineno, fault)
        for name in MODULES
        for node in ast.walk(tree_of(name))
        if (fault := silent(node))
    ]
    assert not found


def silent(node):
    """The fault of a node, in words."""
    match node:
        case ast.Call(
            func=ast.Name("eval" | "exec" | "compile" | "__import__" as name)
        ):
            return name
        case ast.Attribute(attr="nan_to_num"):
            return "nan_to_num"
        case ast.keyword(arg="allow_pickle"):
            return ast.unparse(node.value) != "False" and "allow_pickle"
        case ast.ExceptHandler(type=None):
            return "a bare except hides faults"
        # With PYTHONOPTIMIZE=2 there is none: argparse takes that, its methods do not.
        case ast.Attribute(value=ast.Name("__doc__") | ast.Attribute(attr="__doc__")):
            return "a command needs no docstring"


@pytest.mark.parametrize(
    "text",
    [
        *("eval(text)", "compile(text, path, 'exec')", "np.nan_to_num(x)"),
        *("np.load(path, allow_pickle=True)", "np.load(path, allow_pickle=given)"),
        *("try:\n    run()\nexcept:\n    pass", "__doc__.splitlines()"),
    ],
)
def test_a_silent_repair_is_seen(text):
    assert [fault for node in ast.walk(ast.parse(text)) if (fault := silent(node))]


def test_the_workflow_imports_the_experiment_and_its_costs_only():
    """And the Snakefile alone: rules are forms, whose commands `test_plans` runs."""
    for path in [ROOT / "Snakefile", *ROOT.glob("workflow/rules/*.smk")]:
        words = [line.split() for line in path.read_text().splitlines()]
        heads = [
            line for line in words if line and line[0] in ("import", "from", "def")
        ]
        assert not heads or path.name == "Snakefile", path
        for line in heads:
            known = ("alignerf.experiment", "alignerf.costs", "snakemake", "gc", "sys")
            assert line[1].startswith(known), line


# What opens a file by itself, or takes all that it holds.
RAW = {"numpy.load", "numpy.fromfile", "numpy.loadtxt", "numpy.genfromtxt"}
RAW |= {"cv2.imread", "cv2.imreadmulti", "cv2.imdecode", "PIL.Image.open"}
RAW |= {"gzip.open", "zipfile.ZipFile", "json.load", "json.loads", "pandas.read_csv"}
RAW |= {"yaml.load", "yaml.safe_load", "yaml.compose", "pickle.load", "pickle.loads"}
# Methods of any path.
RAW_METHODS = {"read_text", "read_bytes"}
READERS = {
    "alignerf.io.archives": {"zipfile.ZipFile"},
    "alignerf.io.csv_files": {"pandas.read_csv"},
    "alignerf.io.images": {"PIL.Image.open"},
    "alignerf.io.json_files": {"json.loads"},
    "alignerf.io.yaml_files": {"yaml.load"},
    # Of a published archive, its hash checked.
    "alignerf.scenes.download": {"zipfile.ZipFile"},
    # PNGs of 16 bits, which Pillow has looked through and cuts to 8.
    "alignerf.scenes.photos": {"cv2.imdecode", "numpy.fromfile"},
}
# What ships with the program.
SHIPPED = {
    "alignerf.experiment.sources": {"read_bytes"},
    "alignerf.kernels.compiler": {"read_bytes"},
    "alignerf.cli.folders": {"read_text"},
    "alignerf.tables.columns": {"read_text", "yaml.safe_load"},
    "alignerf.testsets.own": {"read_text", "yaml.safe_load"},
}
# What the system tells of itself; of provenance also the pins of libraries.
SYSTEM = {
    "alignerf.io.machine": {"read_text"},
    "alignerf.io.provenance": {"read_bytes"},
    "alignerf.training.memory": {"read_text"},
}
# What Snakemake and its jobs have said, whatever its bytes are.
LOGS = {
    "alignerf.experiment.cluster": {"read_text"},
    "alignerf.experiment.targets": {"read_text"},
    "alignerf.cli.report": {"json.loads", "read_text"},
}
# No files: options of commands, and what processes of ours tell each other.
TOLD = (
    "alignerf.external.commands",
    *("alignerf.exports.written", "alignerf.verdict.__main__"),
    *("alignerf.costs.__main__", "alignerf.experiment.tables.rows"),
    "flow.figures.scene",
)
MAY_READ = READERS | SHIPPED | SYSTEM | LOGS | {name: {"json.loads"} for name in TOLD}


def raw_reads(tree):
    """What a module calls, or hands on, of the above."""
    known = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            of = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
            known |= {one.asname or one.name: of + one.name for one in node.names}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute | ast.Name):
            first, dot, rest = ast.unparse(node).partition(".")
            yield from {known.get(first, first) + dot + rest} & RAW
        if isinstance(node, ast.Attribute) and node.attr in RAW_METHODS:
            yield node.attr


def test_files_are_read_by_the_readers_alone():
    """They say what is wrong, in a line, before it takes memory or time."""
    reads = {name: set(raw_reads(tree_of(name))) for name in MODULES}
    assert {name: found for name, found in reads.items() if found} == MAY_READ


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("import numpy as np\nnp.load(path)", "numpy.load"),
        ("import numpy\nread = numpy.load", "numpy.load"),
        ("from json import loads as read\nread(text)", "json.loads"),
        ("from PIL import Image\nImage.open(path)", "PIL.Image.open"),
        ("Path(path).read_text()", "read_text"),
    ],
)
def test_a_read_is_seen_whatever_it_is_called(text, found):
    assert set(raw_reads(ast.parse(text))) == {found}
