"""Entry points of other packages: what cannot be taken is one line."""

import os
import subprocess
import sys

import pytest

from alignerf.io.environment import extensions

READ = "from alignerf.experiment import check"


TEST_SET = "name = pixels = meaning = needs = ''; tables = (); make = print\n"
METHOD = "key = {!r}\nannotation = field = None; trainings = words = moves = print\n"
SYSTEM = """
from typing import Literal

from alignerf.experiment.keys.key import key
from alignerf.systems import base


class Keys(base.System):
    kind: Literal[{0!r}] = key({0!r})
    near: float = key(1.0)
    samples: list[int] = key([2])

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
            "one: AttributeError: module 'one' has no attribute 'annotation'",
        ),
        (
            "methods",
            "k = one",
            METHOD.format("copy"),
            "alignerf.methods: copy is a name",
        ),
        ("systems", "s = one", "made = 1\n", "of one: TypeError: made is a int"),
        ("systems", "s = one", "made = print\n", "has no attribute 'kind'"),
        ("methods", "k = one:", "", "k = one: of alignerf.methods of one"),
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


# Objects that have whatever they are asked for.
MOCK = "from unittest.mock import {0}\nANY = {0}()\n"
WILD = "class Any:\n    def __getattr__(self, name): {}\nANY = Any()\n"
ENDS = ("import sys; sys.exit(0)\n", "raise SystemExit\n", "raise GeneratorExit\n")
ENDS += ("raise BaseExceptionGroup('x', [SystemExit()])\n",)
GROUPS = sorted(extensions.NEEDED)


@pytest.mark.parametrize(
    "code",
    [
        *ENDS,
        *map(MOCK.format, ("Mock", "MagicMock", "NonCallableMock")),
        *map(WILD.format, ("return self", "raise SystemExit(0)", "return 1")),
    ],
)
@pytest.mark.parametrize("group", GROUPS)
def test_no_object_of_others_ends_a_command_silently(
    tmp_path, monkeypatch, capsys, group, code
):
    """Its package is named, whatever it does, or says that it has."""
    package(tmp_path, "one", group, "k = one:ANY", code)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "one", raising=False)
    extensions.points.cache_clear()
    with pytest.raises(SystemExit) as ended:
        extensions.of_group.__wrapped__(group)
    extensions.points.cache_clear()
    sys.modules.pop("one", None)
    assert "k = one:ANY of alignerf" in str(ended.value)
    assert f"{group} of one: " in str(ended.value)
    assert "\n" not in str(ended.value)


@pytest.mark.parametrize(
    ("text", "metadata"),
    [(b"[alignerf.methods]\nk\n", "Name: one\n"), (b"\xff", ""), (b"[x]\nz", None)],
)
def test_entry_points_that_cannot_be_read_name_their_package(
    tmp_path, root, text, metadata
):
    package(tmp_path, "one", "methods", "k = one:NONE", "")
    info = tmp_path / "one-1.0.dist-info"
    (info / "entry_points.txt").write_bytes(text)
    (info / "METADATA").unlink()
    if metadata is not None:
        (info / "METADATA").write_text(metadata)
    exit_code, (line,) = run(root, tmp_path)
    assert exit_code == 1
    assert line.startswith("error: entry_points.txt of ")
    assert "one" in line


def test_an_interrupt_while_others_are_loaded_stays_one(tmp_path, root):
    package(tmp_path, "one", "methods", "k = one", "raise KeyboardInterrupt\n")
    code = "import importlib\nfrom alignerf.io import faults\n"
    code += "faults.run(lambda: importlib.import_module('alignerf.experiment.check'))"
    exit_code, (line,) = run(root, tmp_path, code)
    assert (exit_code, line) == (130, "stopped; nothing half-made is left")
