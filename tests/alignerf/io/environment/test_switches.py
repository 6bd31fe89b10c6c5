"""The environment changes no result: what would is left out, and said once."""

import os
import subprocess
import sys

import pytest

from alignerf.external import commands
from alignerf.io.environment import switches

# Each of them changed what a training learns, or ended it.
HOSTILE = {
    "JAX_ENABLE_X64": "1",
    "JAX_DEFAULT_DTYPE_BITS": "32",
    "JAX_DEFAULT_MATMUL_PRECISION": "bfloat16",
    "JAX_DEFAULT_PRNG_IMPL": "rbg",
    "JAX_RANDOM_SEED_OFFSET": "7",
    "JAX_THREEFRY_PARTITIONABLE": "0",
    "JAX_NUMPY_DTYPE_PROMOTION": "strict",
    "JAX_NUMPY_RANK_PROMOTION": "raise",
    "JAX_DISABLE_JIT": "1",
    "JAX_DEBUG_NANS": "1",
    "JAX_OPTIMIZATION_LEVEL": "O0",
}
# A command of ours, as a module that `python -m` finds.
CODE = """
import jax, jax.numpy as jnp
key = jax.random.key(3)
drawn = jax.random.normal(key, (5,))
print(jnp.asarray(1.5).dtype, jax.config.jax_debug_nans, drawn.tolist())
print(jax.jit(lambda x: x @ x.T)(drawn[:, None] + jnp.arange(8)).tolist())
"""


def run(root, *words, **more):
    mine = ("ALIGNERF", "GLOG")
    environ = {k: v for k, v in os.environ.items() if not k.startswith(mine)}
    return subprocess.run(
        [sys.executable, *words],
        cwd=root,
        capture_output=True,
        text=True,
        env=environ | more,
    )


@pytest.fixture
def command(root, tmp_path):
    """A package's copy with a command that says what JAX computes: (code) -> run it."""
    (tmp_path / "alignerf").mkdir()
    for name in ("io", "__init__.py"):
        (tmp_path / "alignerf" / name).symlink_to(root / "alignerf" / name)

    def of(code, **more):
        (tmp_path / "alignerf" / "said.py").write_text(code)
        return run(tmp_path, "-m", "alignerf.said", **more)

    return of


def test_numbers_are_the_same_under_every_environment(command):
    plain, hostile = command(CODE), command(CODE, **HOSTILE)
    assert (plain.stderr, hostile.returncode) == ("", 0), hostile.stderr
    assert hostile.stdout == plain.stdout
    said = hostile.stderr.splitlines()
    assert len(said) == len(HOSTILE)
    for name, line in zip(sorted(HOSTILE), said, strict=True):
        assert line.startswith(f"environment: {name}={HOSTILE[name]!r}")


def test_a_process_says_it_for_those_that_it_starts(command):
    code = """
import os, subprocess, sys
if "AGAIN" not in os.environ:
    again = os.environ | {"AGAIN": "1"}
    subprocess.run([sys.executable, "-m", "alignerf.said"], env=again, check=True)
"""
    done = command(code, JAX_ENABLE_X64="1")
    assert done.returncode == 0
    assert done.stderr.count("JAX_ENABLE_X64") == 1


def test_an_import_changes_nothing(root):
    """What a notebook has set is its own."""
    code = """
import os, sys, threading, signal, warnings, logging
# These set variables of their own.
import cv2, numpy, pandas, pycolmap, scipy
before = dict(os.environ), sys.excepthook, threading.excepthook
before += tuple(signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM))
before += list(warnings.filters), list(logging.root.handlers), list(sys.path)
import alignerf
alignerf.diagnose
after = dict(os.environ), sys.excepthook, threading.excepthook
after += tuple(signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM))
after += list(warnings.filters), list(logging.root.handlers), list(sys.path)
assert after == before, (before, after)
assert "jax" not in sys.modules
"""
    done = run(root, "-c", code, **HOSTILE)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("words", [["-m", "alignerf.show"], ["-c", "WHY"]])
def test_every_command_begins_with_it(root, tmp_path, words):
    """By its module, and as it is installed."""
    why = "import sys; from alignerf.cli import why_blurry; why_blurry.main(['show'])"
    words = [word.replace("WHY", why) for word in words]
    done = run(tmp_path, *words, JAX_ENABLE_X64="1", PYTHONPATH=str(root))
    assert "environment: JAX_ENABLE_X64='1' may change results" in done.stderr


@pytest.mark.parametrize(
    "name", ["JAX_PLATFORMS", "JAX_COMPILATION_CACHE_DIR", "JAX_NUM_PROCESSES"]
)
def test_where_and_with_whom_it_runs_is_the_user_s(name, capsys):
    environ = {name: "x", **switches.QUIET}
    switches.settle(environ)
    assert environ == {name: "x", **switches.QUIET}
    assert not capsys.readouterr().err


def test_who_looks_for_a_fault_may_ask_for_it():
    environ = {"ALIGNERF_DEBUG": "1", "JAX_DEBUG_NANS": "1", "JAX_ENABLE_X64": "1"}
    switches.settle(environ)
    assert "JAX_DEBUG_NANS" in environ
    assert "JAX_ENABLE_X64" not in environ


def test_programs_of_others_get_it_back(monkeypatch):
    monkeypatch.setenv(f"{switches.ASIDE}JAX_ENABLE_X64", "1")
    monkeypatch.delenv("JAX_ENABLE_X64", raising=False)
    found = commands.environment(1)
    assert found["JAX_ENABLE_X64"] == "1"
    assert not any(name.startswith(switches.ASIDE) for name in found)


COLMAP = """
import sys
from alignerf.cli import why_blurry
sys.argv = ["-m"]
why_blurry.switches.settle()
import pycolmap
pycolmap.logging.error("spoken")
"""


@pytest.mark.parametrize("asked", [{}, {"GLOG_minloglevel": "0"}])
def test_colmap_leaves_nothing_on_the_terminal_or_in_the_temporary_folder(
    root, tmp_path, asked
):
    done = run(root, "-c", COLMAP, TMPDIR=str(tmp_path), **asked)
    assert (done.returncode, "spoken" in done.stderr) == (0, bool(asked))
    assert not list(tmp_path.iterdir())
    given = {"GLOG_v": "1"}
    environ = dict(given)
    switches.settle(environ)
    assert switches.restored(environ) == given


@pytest.mark.parametrize("platform", ["cuda", "nonsense"])
def test_a_platform_that_is_not_there_is_one_line(root, platform):
    code = """
import jax
from alignerf.io import faults
faults.run(lambda: jax.jit(lambda x: x + 1)(1))
"""
    done = run(root, "-c", code, JAX_PLATFORMS=platform)
    if done.returncode == 0:
        pytest.skip(f"{platform} is here")
    said = f"error: environment: JAX_PLATFORMS={platform}: JAX cannot start on it here"
    (line,) = (x for x in done.stderr.splitlines() if x.startswith("error: "))
    assert line.startswith(said)
    assert "Traceback" not in done.stderr


def test_of_two_variables_the_one_that_is_wrong_is_named(root):
    """Found by the torture: the other one was."""
    code = """
import jax
from alignerf.io import faults
faults.run(lambda: jax.jit(lambda x: x + 1)(1))
"""
    done = run(root, "-c", code, JAX_PLATFORMS="cpu", JAX_PLATFORM_NAME="rbg")
    assert "error: environment: JAX_PLATFORM_NAME=rbg: JAX cannot" in done.stderr
