"""Cores are those that this process may use, wherever they are counted."""

import concurrent.futures
import os

import numpy as np
import pytest
from PIL import Image

from alignerf.io import machine
from alignerf.scenes import cameras, prepared


@pytest.fixture
def three_of_many(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {1, 4, 5}, raising=False)


def test_a_share_of_the_machine(three_of_many, monkeypatch):
    assert machine.cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    assert machine.cores() == 64
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert machine.cores() == 1


def test_a_limit_bounds_cores_and_the_threads_of_jax(three_of_many, monkeypatch):
    monkeypatch.setattr(machine, "_limit", None)
    monkeypatch.setenv("PJRT_NPROC", "as it was")
    machine.limit(None)
    assert (machine.cores(), os.environ["PJRT_NPROC"]) == (3, "as it was")
    machine.limit(2)
    assert (machine.cores(), os.environ["PJRT_NPROC"]) == (2, "2")
    machine.limit(9)
    assert machine.cores() == 3
    with pytest.raises(ValueError, match="--threads: 0"):
        machine.limit(0)


@pytest.mark.parametrize(
    ("files", "found"),
    [
        ([], 0),
        (["nvidiactl", "null"], 0),
        (["nvidia0", "nvidia11", "nvidia-caps"], 2),
        (["kfd"], 1),
        (["accel3"], 1),
    ],
)
def test_an_accelerator_shows_in_its_device_file(tmp_path, files, found):
    for name in files:
        (tmp_path / name).touch()
    assert machine.accelerators(tmp_path) == found


def test_processors_of_other_abilities_have_other_names(tmp_path):
    info = tmp_path / "cpuinfo"
    names = []
    for text in (
        "processor : 0\nmodel name : A\nflags : sse avx\nflags : sse avx\n",
        "processor : 0\nmodel name : B\nflags : sse avx\n",
        "processor : 0\nmodel name : A\nflags : sse\n",
        "processor : 0\nFeatures : neon\n",
    ):
        info.write_text(text)
        names.append(machine.processor(info))
    assert names[0] == names[1]
    assert len({*names, machine.processor(tmp_path / "none")}) == 4
    assert all("/" not in name for name in names)


def test_photos_are_decoded_by_as_many_threads(three_of_many, tmp_path, monkeypatch):
    (tmp_path / "images").mkdir()
    Image.fromarray(np.zeros((3, 4, 3), np.uint8)).save(tmp_path / "images" / "a.png")
    np.savez(
        tmp_path / "cameras.npz",
        pixtocams=cameras.intrinsics(30.0, 4, 3)[None],
        camtoworlds=np.eye(4)[None, :3],
        names=["a"],
        width=4,
        height=3,
        split=["test"],
    )
    started = []
    executor = concurrent.futures.ThreadPoolExecutor

    def start(threads):
        started.append(threads)
        return executor(threads)

    monkeypatch.setattr(concurrent.futures, "ThreadPoolExecutor", start)
    prepared.read_images(prepared.load(tmp_path), [0], tmp_path / "images")
    assert started == [3]
