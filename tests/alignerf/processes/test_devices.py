"""Every core a device: in time, or said that it is too late."""

import os
import pathlib
import subprocess
import sys

import jax
import pytest

from alignerf.io import machine
from alignerf.processes import devices

EVERY_MODULE = """
import importlib, pkgutil
import alignerf, flow
for package in (alignerf, flow):
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
"""


def in_a_fresh_interpreter(root, code):
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done


def test_no_import_starts_jax(root):
    """What an import started would leave a training one device."""
    code = """
from alignerf.io import machine
from alignerf.processes import devices
import jax
machine.cores = lambda: 3
devices.use_as_devices()
print(len(jax.local_devices()))
"""
    done = in_a_fresh_interpreter(root, EVERY_MODULE + code)
    assert done.stdout.split() == ["3"]
    assert not done.stderr


def test_fewer_accelerators_than_none_are_refused():
    with pytest.raises(ValueError, match="--gpus: -1 is not a number of accel"):
        devices.begin(gpus=-1)


@pytest.mark.parametrize("named", [True, False])
def test_programs_are_kept_for_the_user_where_no_folder_is_named(
    tmp_path, monkeypatch, named
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
    if named:
        monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "elsewhere")
    set_to = {}
    monkeypatch.setattr(jax.config, "update", set_to.__setitem__)
    devices.keep_programs()
    folder = str(tmp_path / "alignerf" / machine.processor())
    assert set_to.get("jax_compilation_cache_dir") == (None if named else folder)


def test_a_limit_is_all_that_jax_takes(root):
    """One device, and one thread in JAX's pool, however many cores there are."""
    code = """
from pathlib import Path
from alignerf.io import machine
from alignerf.processes import devices
machine.limit(1)
devices.use_as_devices()
import jax
jax.jit(lambda x: x @ x)(jax.numpy.ones((64, 64))).block_until_ready()
tasks = [p.read_text().strip() for p in Path("/proc/self/task").glob("*/comm")]
print(len(jax.local_devices()), tasks.count("tf_XLAEigen"))
"""
    if not pathlib.Path("/proc/self/task").is_dir():
        pytest.skip("no list of threads")
    assert in_a_fresh_interpreter(root, code).stdout.split() == ["1", "1"]


def test_too_late_is_said(monkeypatch, caplog):
    there = len(jax.local_devices())
    monkeypatch.delenv("XLA_FLAGS", raising=False)
    monkeypatch.setattr(machine, "cores", lambda: there + 1)
    devices.use_as_devices()
    (record,) = caplog.records
    assert (record.name, record.levelname) == ("alignerf", "WARNING")
    said = f"too late for a device each of {there + 1} cores: JAX has started with "
    assert record.getMessage() == f"{said}{there}"
    assert len(jax.local_devices()) == there


@pytest.mark.parametrize("by_user", [True, False])
def test_nothing_is_said_where_nothing_is_lost(monkeypatch, caplog, by_user):
    flags = "--xla_force_host_platform_device_count=1" if by_user else ""
    monkeypatch.setenv("XLA_FLAGS", flags)
    there = len(jax.local_devices())
    monkeypatch.setattr(machine, "cores", lambda: there + by_user)
    devices.use_as_devices()
    assert not caplog.records


@pytest.fixture
def four(tmp_path, monkeypatch):
    """A host with four accelerators, as their device files and locks tell."""
    for name in ("nvidia0", "nvidia1", "nvidia2", "nvidia10", "nvidiactl"):
        (tmp_path / name).touch()
    monkeypatch.setattr(devices, "_held", [])
    for name in ("CUDA_VISIBLE_DEVICES", "CUDA_DEVICE_ORDER", *devices.MEMORY_SHARES):
        monkeypatch.delenv(name, raising=False)

    def take(wanted=1):
        monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
        devices.take_accelerators(wanted, tmp_path, tmp_path)
        return os.environ.get("CUDA_VISIBLE_DEVICES")

    yield take
    for lock in devices._held:
        lock.release()


def test_each_job_takes_an_accelerator_of_its_own(four):
    assert [four() for _ in range(4)] == ["0", "1", "2", "3"]
    with pytest.raises(ValueError, match=r"all 4 accelerators .* --resources gpu=4"):
        four()
    # One that has ended gives back what it had.
    devices._held.pop(1).release()
    assert four() == "1"


def test_jobs_share_accelerators_where_their_memory_says_so(four, monkeypatch):
    monkeypatch.setenv("XLA_PYTHON_CLIENT_MEM_FRACTION", ".45")
    assert [four() for _ in range(8)] == ["0", "1", "2", "3"] * 2


def test_a_job_takes_as_many_as_it_may_and_as_are_free(four):
    assert [four(3), four(8)] == ["0,1,2", "3"]


@pytest.mark.parametrize("text", ["abc", "nan", "0", "-1", "2"])
def test_a_share_of_memory_is_checked(four, monkeypatch, text):
    monkeypatch.setenv("XLA_CLIENT_MEM_FRACTION", text)
    with pytest.raises(ValueError, match="XLA_CLIENT_MEM_FRACTION='?" + text):
        four()


def test_what_a_cluster_has_given_is_taken(four, tmp_path, monkeypatch):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "7")
    devices.take_accelerators(2, tmp_path, tmp_path)
    assert os.environ["CUDA_VISIBLE_DEVICES"] == "7"
    assert not devices._held


def test_one_accelerator_or_none_is_left_to_jax(tmp_path, monkeypatch):
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    for _ in range(2):
        devices.take_accelerators(2, tmp_path, tmp_path)
        assert "CUDA_VISIBLE_DEVICES" not in os.environ
        (tmp_path / "nvidia0").touch()
