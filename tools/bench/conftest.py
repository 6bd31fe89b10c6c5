"""What the tests of the benchmarks share."""

import os
import subprocess
import sys

import pytest


@pytest.fixture(scope="session")
def run_quick(root):
    """A function that runs benchmarks with `--quick` and returns what they print.

    Their programs are not optimised: they are compiled for one call or a few.
    """

    def run(folder, names, *options):
        arguments = ["--quick", "--out", folder, *options, "--only", *names]
        done = subprocess.run(
            [sys.executable, "-m", "tools.bench", *arguments],
            cwd=root,
            env=os.environ | {"JAX_DISABLE_MAX_OPTIMIZATIONS": "1"},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run
