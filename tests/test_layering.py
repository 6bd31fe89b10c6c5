"""Imports point downwards only, from the entry points to the fields."""

import ast
import graphlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): ast.parse(path.read_text())
    for package in ("alignerf", "flow")
    for path in sorted((ROOT / package).rglob("*.py"))
}
# Lowest first; a module may import from its own layer and from those before it.
LAYERS = [
    r"alignerf\.mipnerf360\..*",
    r"alignerf\.fields\..*",
    r"alignerf\.(archives|state_dict_pickle|torch_files)",
    r"alignerf\.(cameras|wording|memory|cores|intervals|scores|search_radius|strips|(tradeoff|regimes)_figure)",
    r"alignerf\.(batches|convnet|patch_conv|align_loss|contextual_loss|frequency_loss|metrics|lpips)",
    r"alignerf\.(methods|scenes\..*)",
    r"alignerf\.(config|scene|gradients|train_step|diagnose|checkpoint|cli|progress|program|loop|table_files)",
]
STAGES = {"poses", "facts", "train", "render_views", "evaluate", "tables"}


def imports(name):
    """Full names of all modules that a module imports."""
    for node in ast.walk(SOURCES[name]):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: relative import"
            inside = [f"{node.module}.{alias.name}" for alias in node.names]
            ours = [full for full in inside if full in SOURCES or is_package(full)]
            yield from ours or [node.module]


def is_package(name):
    return f"{name}.__init__" in SOURCES


def own_imports(name):
    """The modules of this project among them; a package is its __init__."""
    return {
        f"{full}.__init__" if is_package(full) else full
        for full in imports(name)
        if full.split(".")[0] in ("alignerf", "flow")
    }


def is_entry(name):
    """Whether `python -m name` runs it."""
    return "__name__ == '__main__'" in ast.unparse(SOURCES[name])


def layer(name):
    if is_entry(name):
        return len(LAYERS)
    fits = [i for i, names in enumerate(LAYERS) if re.fullmatch(names, name)]
    assert len(fits) == 1, f"{name}: give it a layer"
    return fits[0]


MODULES = sorted(SOURCES)
ALIGNERF = [name for name in MODULES if name.startswith("alignerf.")]


def test_the_stages_are_entry_points():
    entries = {name for name in MODULES if is_entry(name)}
    assert {f"alignerf.{name}" for name in STAGES} <= entries
    assert {"flow.align", "flow.figures"} <= entries


@pytest.mark.parametrize("name", MODULES)
def test_imports_exist_and_keep_the_packages_apart(name):
    found = own_imports(name)
    assert found <= SOURCES.keys()
    other = {"alignerf": "flow", "flow": "alignerf"}[name.split(".")[0]]
    assert not {full for full in found if full.split(".")[0] == other}
    tops = {full.split(".")[0] for full in imports(name)}
    assert not tops & {"snakemake", "pickle", "dill", "joblib", "marshal", "shelve"}
    if name.startswith("flow."):
        assert not tops & {"jax", "flax", "optax"}
    # We import modules of ours, not names from them.
    assert not {full for full in found if is_entry(full)}


@pytest.mark.parametrize("name", [n for n in ALIGNERF if n != "alignerf.__init__"])
def test_imports_point_downwards(name):
    for found in own_imports(name):
        assert layer(found) <= layer(name), f"{name} imports {found}"


def test_the_baseline_and_the_fields_know_no_patches_and_no_files():
    for name in ALIGNERF:
        found = own_imports(name)
        if name.startswith("alignerf.mipnerf360."):
            assert all(full.startswith("alignerf.mipnerf360.") for full in found)
        if name.startswith("alignerf.fields."):
            fields = {full for full in found if full.startswith("alignerf.fields.")}
            assert found - fields <= {"alignerf.mipnerf360.coord"}


def test_there_are_no_cycles():
    graph = {name: own_imports(name) - {name} for name in MODULES}
    graphlib.TopologicalSorter(graph).prepare()


@pytest.mark.parametrize("name", MODULES)
def test_nothing_is_unpickled_evaluated_or_repaired_in_silence(name):
    for node in ast.walk(SOURCES[name]):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in ("eval", "exec", "compile", "__import__")
        if isinstance(node, ast.Attribute):
            assert node.attr != "nan_to_num"
        if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
            assert isinstance(node.value, ast.Constant)
            assert node.value.value is False
        if isinstance(node, ast.ExceptHandler):
            assert node.type is not None, "a bare except hides faults"


def test_the_workflow_calls_commands_only():
    for path in [ROOT / "Snakefile", *ROOT.glob("workflow/rules/*.smk")]:
        text = path.read_text()
        assert not re.search(r"^\s*(from|import) (alignerf|flow)\b", text, re.MULTILINE)
        assert not re.search(r"^\s*(script|run|notebook):", text, re.MULTILINE)
        for module in re.findall(r'"python -m (\S+)', text):
            assert is_entry(module)
