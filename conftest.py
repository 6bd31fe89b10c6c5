"""Shape checks on every typed function, and what the tests share."""

import copy
import functools
import gc
import os
import pathlib
import pickle
import re
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent

# To rewrite the asserts of all tests takes five seconds a process: it is done once,
# also where a shell has asked for no bytecode.
sys.dont_write_bytecode = False

# Before JAX is imported: tests run on the CPU.
os.environ["JAX_PLATFORMS"] = "cpu"
# COLMAP's log is nothing to leave in the temporary folder.
os.environ |= {"GLOG_minloglevel": "3", "GLOG_logtostderr": "1"}
# Compiled programs are kept for the next run of the tests, and for the processes that
# these start: with them `make test` takes a quarter less. `make clean` removes them.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(ROOT / ".pytest_cache" / "jax"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
# Most of a test is compiling what runs for a moment. Without the optimisations of the
# machine code, and with the older of XLA's two ways to write it, that takes a third of
# the time; the program that it is made from is the same. Users' runs have both, and so
# has this:
#   ALIGNERF_OPTIMISED=1 make test
QUICKLY = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false"
given = os.environ.get("XLA_FLAGS", "")
# Workers inherit them. What is kept is of these flags to the letter.
if QUICKLY not in given and not os.environ.get("ALIGNERF_OPTIMISED"):
    os.environ["XLA_FLAGS"] = f"{given} {QUICKLY}".strip()

import jaxtyping

# Shapes are checked where arrays are computed with; elsewhere it only costs time.
NUMERIC = [f"alignerf.{name}" for name in ("mipnerf360", "fields", "contributions")]
NUMERIC += [f"alignerf.{name}" for name in ("cameras", "rays", "keypoints")]
NUMERIC += ["flow.camera", "flow.warping"]
jaxtyping.install_import_hook(NUMERIC, "beartype.beartype")

import filelock
import jax
import numpy as np
import pytest
import yaml

from alignerf.courtyard import scene as courtyard
from alignerf.kernels import calls
from tests import forks, ratchet

# One device in this process, whatever stage it calls first (see processes/devices.py).
jax.devices()
# Arrays of other ranks meet by name, [:, None], or not at all.
jax.config.update("jax_numpy_rank_promotion", "raise")

# A shell ignores Ctrl-C in the background; what tests start there would do so, too.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Files whose single tests or fixtures take minutes.
LONGEST = ("test_chain.py", "test_bench.py")
# `make check` begins no test after so many seconds.
STARTED, SECONDS = time.monotonic(), float(os.environ.get("ALIGNERF_SECONDS", "inf"))
# What CI's machine may lack. Any other skip is a test that nobody runs.
KNOWN_SKIPS = re.compile(
    "real data not found|no scene at|no checkout of|no chromium"
    "|make (cluster|site|torture)|not installed|import '(torch|properdocs|nbformat)'"
)


def pytest_collection_modifyitems(items):
    """The longest first: begun last, one of them keeps a core idle for minutes."""
    checking = bool(os.environ.get("ALIGNERF_SECONDS"))
    items.sort(key=lambda item: (item.path.name in LONGEST) == checking)


def pytest_collection_finish():
    """What is imported stays: to look for garbage in it takes a sixth of a trace."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 50)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item):
    return True if time.monotonic() - STARTED > SECONDS else None


def pytest_sessionfinish(session):
    """Tell whose tests took more than the seconds of tests/ratchet.yaml.

    A busy machine takes any time: only `ALIGNERF_TIME_BUDGETS=1 make test` fails.
    """
    # Only the process that reports has one; it has the reports of all workers.
    if reporter := session.config.pluginmanager.get_plugin("terminalreporter"):
        found = [
            f"slow: {one}" for one in ratchet.slow(ratchet.seconds(reporter.stats))
        ]
        fails = bool(found) and os.environ.get("ALIGNERF_TIME_BUDGETS") == "1"
        if os.environ.get("ALIGNERF_SKIPS") == "known":
            reasons = {str(one.longrepr) for one in reporter.stats.get("skipped", [])}
            unknown = [one for one in reasons if not KNOWN_SKIPS.search(one)]
            found += [f"skipped for no known reason: {one}" for one in unknown]
            fails |= bool(unknown)
        if time.monotonic() - STARTED > SECONDS:
            found.append(f"over {SECONDS:.0f} s: `make test` runs what was not begun")
        reporter.ensure_newline()
        for line in found:
            reporter.write_line(line, yellow=True)
        if fails:
            session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


@pytest.fixture(scope="session")
def root():
    """The project's top folder."""
    return ROOT


@pytest.fixture(scope="session", autouse=True)
def worlds(tmp_path_factory):
    """Each world of the courtyard is built once for all workers: that takes seconds."""
    base, build = tmp_path_factory.getbasetemp(), courtyard.build_world
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    @functools.cache
    def kept(seed, place):
        path = shared / f"{place}_{seed}.world"
        with filelock.FileLock(f"{path}.lock"):
            if not path.is_file():
                path.write_bytes(pickle.dumps(build(seed=seed, place=place)))
        return pickle.loads(path.read_bytes())

    courtyard.build_world = lambda *, seed=0, place="courtyard": kept(seed, place)
    yield
    courtyard.build_world = build


@pytest.fixture
def ten_seconds():
    """A test that takes longer, as one that waits for a pipe, fails."""

    def stop(*_):
        raise TimeoutError("over ten seconds")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(10)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="session")
def shared_data():
    """Real scenes, flow ground truth and weights; ALIGNERF_DATA says where."""
    folder = pathlib.Path(os.environ.get("ALIGNERF_DATA", ROOT / "../shared/data"))
    if not folder.is_dir():
        pytest.skip(f"real data not found at {folder} (set ALIGNERF_DATA)")
    return folder.resolve()


@pytest.fixture
def photos_of_tables(tmp_path, monkeypatch):
    """What the shipped configs read, as far as a plan looks at it: empty files."""
    data = tmp_path / "data"
    for name in ("scenes/flower", "scenes/treehill/images", "scenes/fox", "weights"):
        (data / name).mkdir(parents=True)
    for name in ("vgg19_block1", "lpips_alex_v0.1"):
        (data / "weights" / f"{name}.npz").touch()
    monkeypatch.setenv("ALIGNERF_DATA", str(data))


@pytest.fixture(scope="session")
def peer():
    """The modules of google-research/multinerf; ALIGNERF_MULTINERF says where."""
    if not (path := os.environ.get("ALIGNERF_MULTINERF")):
        pytest.skip("no checkout of multinerf (set ALIGNERF_MULTINERF)")
    from tools.bench import multinerf

    return multinerf.load(path)


@pytest.fixture
def both_ways(monkeypatch):
    """(function, *arrays) -> what it gives by code for a CPU, and for accelerators."""

    def run(function, *given):
        for cpu in (True, False):
            monkeypatch.setattr(calls, "on_cpu", lambda cpu=cpu: cpu)
            # What is traced is kept by the function: a new one.
            yield jax.jit(lambda *arrays: function(*arrays))(*given)

    return run


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def demo():
    """A config with two models, rounds and every fix."""
    return yaml.safe_load((ROOT / "tests/config.yaml").read_text())


@pytest.fixture(scope="session")
def experiment_of():
    """config -> the experiment that it means."""
    from alignerf.experiment import check, plan

    def make(config):
        return plan.Experiment(check.checked(copy.deepcopy(config)))

    return make


@pytest.fixture(scope="session")
def snakemake():
    """Run Snakemake: (folder, *arguments) -> (exit code, all that it printed).

    root: of the project; more: variables of its environment.
    """
    here = str(pathlib.Path(sys.executable).parent)
    environment = os.environ | {"PATH": os.pathsep.join([here, os.environ["PATH"]])}

    def run(folder, *arguments, root=ROOT, more=None):
        command = [sys.executable, "-m", "snakemake", *forks.PLAIN]
        command += ["--directory", folder, "--snakefile", root / "Snakefile"]
        done = subprocess.run(
            [*command, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment | (more or {}),
        )
        return done.returncode, done.stdout

    return run


@pytest.fixture(scope="session")
def forked(tmp_path_factory):
    """`forked.snakemake` is the same in half the time: see tests/forks.py."""
    started = forks.Forks(tmp_path_factory.mktemp("forks"))
    yield started
    started.close()


@pytest.fixture(scope="session")
def dry_run(forked):
    """Plan, as `snakemake` with -n does, by which no job can run."""

    def plan(folder, *arguments, **more):
        assert "-n" in arguments
        return forked.snakemake(folder, *arguments, **more)

    return plan
