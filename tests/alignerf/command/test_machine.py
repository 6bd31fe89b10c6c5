"""Cores are those that this process may use, wherever they are counted."""

import concurrent.futures
import os

import numpy as np
import pytest
from PIL import Image

from alignerf.command import machine
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
