"""What `make` hands on to a command, told by a Python that only says its arguments."""

import os
import subprocess

import pytest

# Names that the command is told by, in the environment.
BY_NAME = ("PHOTOS_FOLDER", "EXPORT_OF")


@pytest.fixture
def handed_on(root, tmp_path):
    """A function of make's words: what the command was told, as text.

    The suite itself may be started by make, and an inner one says so.
    """

    def run(*words):
        (tmp_path / "venv" / "bin").mkdir(parents=True)
        (tmp_path / "requirements.lock").touch()
        (tmp_path / "venv" / ".installed").touch()
        told = "import sys; print(sys.argv[1:])"
        python = tmp_path / "venv" / "bin" / "python"
        python.write_text(f"#!/bin/sh\nexec /usr/bin/env python3 -c '{told}' \"$@\"\n")
        python.chmod(0o755)
        options = ["--no-print-directory", "VENV=venv", "CORES=2"]
        done = subprocess.run(
            ["make", *words, *options, "-f", str(root / "Makefile")],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            env={k: v for k, v in os.environ.items() if k not in BY_NAME},
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run
