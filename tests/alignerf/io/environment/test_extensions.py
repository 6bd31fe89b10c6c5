"""Entry points of other packages: what cannot be taken is one line."""

import os
import subprocess
import sys

import pytest

READ = "from alignerf.experiment import check"


TEST_SET = "name = pixels = meaning = needs = tables = ''; make = moved = None\n"
METHOD = "key = {!r}\nannotation = field = trainings = words = moves = None\n"
SYSTEM = """
from typing import Literal

from alignerf.experiment.keys.key import key
from alignerf.systems import base


class Keys(base.System):
    kind: Literal[{0!r}] = key({0!r})
    near: float = key(1.0)
    samples: list[int] = key([2])
    training: dict = base.changes()

    def made(self, parts, **options):
        return None
"""


def package(folder, name, group, point, code="VALUE = 3\n"):
    """Write a package of one module with one entry point."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n")
    (info / "entry_points.txt").write_text(f"[alignerf.{group}]\n{point}\n")
    (folder / f"{name}.py").write_text(code)


def run(root, folder, code=READ):
    """Its exit code, and the lines that it writes to stderr."""
    path = os.pathsep.join([str(folder), str(root)])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stderr.strip().splitlines()


@pytest.mark.parametrize(
    ("group", "point", "code", "reason"),
    [
        (
            "methods",
            "k = one:NONE",
            "",
            "k = one:NONE of alignerf.methods of one: AttributeError",
        ),
        (
            "methods",
            "k = nowhere",
            "",
            "alignerf.methods of one: ModuleNotFoundError: No module",
        ),
        (
            "methods",
            "k = one",
            "key = 'x'\n",
            "one: it has no annotation",
        ),
        (
            "methods",
            "k = one",
            METHOD.format("copy"),
            "alignerf.methods: copy is a name",
        ),
        ("systems", "s = one", "made = 1\n", "of one: it has no kind"),
        ("methods", "k = one", "1 / 0\n", "of one: ZeroDivisionError"),
        (
            "methods",
            "k = one",
            METHOD.format("align"),
            "alignerf.methods: align is a name that",
        ),
        (
            "systems",
            "s = one:Keys",
            SYSTEM.format("ngp"),
            "alignerf.systems: ngp is a name that is taken",
        ),
    ],
)
def test_what_cannot_be_taken_is_one_line(tmp_path, root, group, point, code, reason):
    package(tmp_path, "one", group, point, code)
    exit_code, lines = run(root, tmp_path)
    assert exit_code == 1
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    assert reason in lines[0]


def test_two_packages_with_one_name(tmp_path, root):
    for name in ("one", "two"):
        package(tmp_path, name, "test_sets", f"same = {name}", TEST_SET)
    read = "from alignerf import testsets; testsets.every()"
    exit_code, (line,) = run(root, tmp_path, read)
    assert exit_code == 1
    assert line.endswith("another package has the same name")


def test_an_estimator_of_the_programs_name(tmp_path, root):
    package(tmp_path, "one", "estimators", "deepflow = one:VALUE")
    exit_code, (line,) = run(root, tmp_path, "from flow.estimation import estimators")
    assert exit_code == 1
    assert line == "error: alignerf.estimators: deepflow is a name that is taken"
