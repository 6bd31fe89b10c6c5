"""Copies of the tree with one new file, or several, in its registries."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
# Where toys go that are no patches.
PLACES = {"toy_method.py": "methods", "toy_loss.py": "methods"}
PLACES |= {"toy_system.py": "systems"}
ROOT = HERE.parents[1]


@pytest.fixture(scope="module")
def patched(tmp_path_factory):
    """(names of patches, or toys) -> (Python code) -> what it prints in such a copy."""

    def apply(*names):
        copy = tmp_path_factory.mktemp("patched")
        for part in ("alignerf", "flow", "workflow", "tests", "docs/measured"):
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / part, copy / part, ignore=ignored)
        shutil.copy(ROOT / "Snakefile", copy)
        for name in names:
            if name in PLACES:
                shutil.copy(HERE / name, copy / "alignerf" / PLACES[name])
                continue
            text = (HERE / name).read_text()
            assert text.count("\n--- ") == text.count("\n--- /dev/null") == 1
            subprocess.run(["git", "apply", HERE / name], cwd=copy, check=True)

        def run(code):
            done = subprocess.run(
                [sys.executable, "-c", code],
                cwd=copy,
                env=os.environ | {"PYTHONPATH": f"{copy}{os.pathsep}{copy / 'site'}"},
                capture_output=True,
                text=True,
            )
            assert done.returncode == 0, done.stderr
            return done.stdout

        run.folder = copy
        return run

    return apply
