"""What is installed is all that is here: modules, the workflow, and the command."""

import os
import shutil
import subprocess
import sys
import zipfile

import pytest

import alignerf
from alignerf.scenes import photos

# Imports each name and prints where it came from, in an interpreter of its own.
IMPORT_ALL = """
import importlib, sys
for name in sys.argv[1:]:
    print(name, importlib.import_module(name).__file__)
"""


# Of the workflow, besides its folders.
FOLDERS = ("workflow", "profiles")
BESIDE, PUBLISHED = ("Snakefile", "environment.yml"), "results/published"


@pytest.fixture(scope="module")
def wheel(root, tmp_path_factory):
    """Built from a copy: building leaves folders beside the sources."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE", *BESIDE):
        shutil.copy(root / name, source)
    # With the folders that are not to be installed.
    for name in ("alignerf", "flow", "tests", "tools", "docs", *FOLDERS, PUBLISHED):
        unwanted = shutil.ignore_patterns("__pycache__")
        shutil.copytree(root / name, source / name, ignore=unwanted)
    pip("wheel", "--no-build-isolation", "--wheel-dir", folder, source)
    (built,) = folder.glob("*.whl")
    return built


def pip(command, *arguments):
    done = subprocess.run(
        [sys.executable, "-m", "pip", command, "--no-deps", "--no-index", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def modules(paths):
    """Their names as imports have them, of paths from the top folder."""
    names = {path.removesuffix(".py").replace("/", ".") for path in paths}
    return sorted(name.removesuffix(".__init__") for name in names)


def test_a_wheel_holds_every_module_and_all_that_lies_beside(root, wheel):
    with zipfile.ZipFile(wheel) as archive:
        found = [name for name in archive.namelist() if ".dist-info/" not in name]
    ours = [
        path.relative_to(root).as_posix()
        for package in ("alignerf", "flow")
        for path in (root / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    ]
    beside = [*BESIDE, f"{PUBLISHED}/tables.csv"]
    beside += [
        path.relative_to(root).as_posix()
        for folder in FOLDERS
        for path in (root / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    ]
    assert sorted(found) == sorted(ours + [f"alignerf/pipeline/{x}" for x in beside])


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """The folder that it is installed in."""
    target = tmp_path_factory.mktemp("installed")
    pip("install", "--target", target, wheel)
    return target


def run(installed, folder, *words):
    """(exit code, output) of a process that has the installed packages alone."""
    done = subprocess.run(
        words,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(installed), "PYTHONSAFEPATH": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def test_the_command_finds_the_workflow_from_anywhere(installed, tmp_path):
    command = installed / "bin" / "why-blurry"
    (tmp_path / "my photos").mkdir()
    # As many as are posed: fewer are refused before Snakemake runs.
    for name in "abcdefgh"[: photos.LEAST]:
        (tmp_path / "my photos" / f"{name}.jpg").write_bytes(b"no photo")
    code, said = run(
        installed, tmp_path, command, "photos", "my photos", "--cores", "1"
    )
    assert code == 1
    lines = said.splitlines()
    (log,) = (tmp_path / "results" / "logs").glob("run-*.log")
    assert f"Snakefile: {installed}/alignerf/pipeline/Snakefile" in log.read_text()
    assert lines[0] == "config: results/my_photos.yaml"
    # By a job whose sources are those that are installed.
    assert lines[-4].startswith("error: cannot decode my photos/a.jpg")
    assert lines[-1] == f"all that the run said: {log.relative_to(tmp_path)}"
    code, said = run(installed, tmp_path, command, "export", "other")
    assert (code, said.count("\n")) == (1, 1)
    assert "run `why-blurry photos other` first" in said


def test_the_command_says_the_version_that_is_installed(installed, tmp_path):
    said = run(installed, tmp_path, installed / "bin" / "why-blurry", "--version")
    assert said == (0, f"why-blurry {alignerf.__version__}\n")


def test_every_module_imports_from_where_the_wheel_is_installed(
    wheel, installed, tmp_path
):
    with zipfile.ZipFile(wheel) as archive:
        names = modules(name for name in archive.namelist() if name.endswith(".py"))
    assert len(names) > 90
    # Snakemake alone imports what lies beside the workflow.
    names = [name for name in names if ".pipeline." not in name]
    words = (sys.executable, "-c", IMPORT_ALL, *names)
    code, said = run(installed, tmp_path, *words)
    assert code == 0, said
    lines = [line.split(" ", 1) for line in said.splitlines()]
    assert [name for name, _ in lines] == names
    assert all(path.startswith(f"{installed}{os.sep}") for _, path in lines), lines
