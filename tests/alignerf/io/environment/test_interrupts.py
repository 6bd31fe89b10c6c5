"""Ctrl-C while a command is imported: one line, wherever it comes."""

import os
import subprocess
import sys

import pytest

from alignerf.io.environment import interrupts

# Interrupts the process when it looks for a module.
SITE = """
import os, signal, sys
class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == os.environ["AT"]:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupt())
"""
INSTALLED = "import sys; sys.argv[:1] = ['/x/why-blurry']; from alignerf.cli "
INSTALLED += "import why_blurry; why_blurry.main(['show'])"


@pytest.mark.parametrize("at", ["alignerf.io.faults", "numpy", "pandas._libs"])
@pytest.mark.parametrize(
    "words",
    [["-m", "alignerf.show"], ["-m", "alignerf", "judge"], ["-c", INSTALLED]],
    ids=["stage", "package", "installed"],
)
def test_an_interrupted_import_is_one_line(tmp_path, root, words, at):
    (tmp_path / "sitecustomize.py").write_text(SITE)
    done = subprocess.run(
        [sys.executable, *words],
        env=os.environ | {"AT": at, "PYTHONPATH": f"{tmp_path}{os.pathsep}{root}"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (interrupts.CODE, "")
    assert done.stderr == f"{interrupts.SAID}\n"
