"""Copies of the tree to which a patch of one new file has been applied."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


@pytest.fixture(scope="module")
def patched(tmp_path_factory):
    """(name of a patch) -> (Python code) -> what it prints within such a copy."""

    def apply(*names):
        copy = tmp_path_factory.mktemp("patched")
        for part in ("alignerf", "flow", "workflow", "tests", "docs/measured"):
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / part, copy / part, ignore=ignored)
        shutil.copy(ROOT / "Snakefile", copy)
        for name in names:
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
