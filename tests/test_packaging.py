"""What is installed is all that is here: every module of a wheel, from its place."""

import os
import shutil
import subprocess
import sys
import zipfile

import pytest

# Imports each name and prints where it came from, in an interpreter of its own.
IMPORT_ALL = """
import importlib, sys
for name in sys.argv[1:]:
    print(name, importlib.import_module(name).__file__)
"""


@pytest.fixture(scope="module")
def wheel(root, tmp_path_factory):
    """Built from a copy: building leaves folders beside the sources."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(root / name, source)
    # With the folders that are not to be installed.
    for name in ("alignerf", "flow", "tests", "docs", "workflow"):
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
    assert sorted(found) == sorted(ours)


def test_every_module_imports_from_where_the_wheel_is_installed(wheel, tmp_path):
    target = tmp_path / "installed"
    pip("install", "--target", target, wheel)
    with zipfile.ZipFile(wheel) as archive:
        names = modules(name for name in archive.namelist() if name.endswith(".py"))
    assert len(names) > 90
    done = subprocess.run(
        [sys.executable, "-c", IMPORT_ALL, *names],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(target), "PYTHONSAFEPATH": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lines = [line.split(" ", 1) for line in done.stdout.splitlines()]
    assert [name for name, _ in lines] == names
    assert all(path.startswith(f"{target}{os.sep}") for _, path in lines), lines
