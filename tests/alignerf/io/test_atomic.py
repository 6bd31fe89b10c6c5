"""Outputs are whole or not there."""

import errno
import os
import resource
import signal
import subprocess
import sys

import numpy as np
import pytest

from alignerf.io import atomic, owned


def test_a_failure_leaves_the_old_folder_and_nothing_else(tmp_path):
    old = tmp_path / "out"
    old.mkdir()
    (old / "kept").write_text("old")
    owned.seal(old)

    def fail():
        with atomic.replace_folder(old) as temporary:
            (temporary / "half").write_text("new")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert os.listdir(tmp_path) == ["out"]
    assert sorted(os.listdir(old)) == [owned.MARK, "kept"]
    with atomic.replace_folder(old) as temporary:
        (temporary / "new").write_text("new")
    assert os.listdir(tmp_path) == ["out"]
    assert sorted(os.listdir(old)) == [owned.MARK, "new"]


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("old")

    def fail():
        with atomic.replace_file(path) as temporary:
            assert temporary.suffix == ".csv"
            temporary.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert os.listdir(tmp_path) == ["a.csv"]
    assert path.read_text() == "old"
    with atomic.replace_file(path) as temporary:
        temporary.write_text("new")
    assert os.listdir(tmp_path) == ["a.csv"]
    assert path.read_text() == "new"


WRITER = """
import sys, time
from alignerf.io import atomic
with (
    atomic.replace_file(sys.argv[1] + "/a.csv"),
    atomic.replace_folder(sys.argv[1] + "/out") as folder,
    atomic.scratch_folder(sys.argv[1] + "/work"),
):
    (folder / "half").write_text("half")
    print("ready", flush=True)
    time.sleep(600)
"""


def test_what_a_killed_process_left_is_swept_and_nothing_else(tmp_path, root):
    (tmp_path / ".kept").mkdir()
    (tmp_path / ".kept.~host~1~x").touch()
    command = [sys.executable, "-c", WRITER, str(tmp_path)]
    writer = subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE)
    try:
        assert writer.stdout.readline() == b"ready\n"
        # It lives: what it writes stays.
        assert atomic.sweep(tmp_path) == []
        assert len(os.listdir(tmp_path)) == 5
    finally:
        writer.send_signal(signal.SIGKILL)
        writer.communicate()
    assert len(atomic.sweep(tmp_path)) == 3
    assert sorted(os.listdir(tmp_path)) == [".kept", ".kept.~host~1~x", "work"]
    assert os.listdir(tmp_path / "work") == []


@pytest.mark.parametrize("how", [atomic.replace_file, atomic.replace_folder])
def test_a_full_disk_says_what_was_being_written(tmp_path, how):
    with (
        pytest.raises(OSError, match=r"No space left on device: .*a\.npz"),
        how(tmp_path / "a.npz"),
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("how", [atomic.replace_file, atomic.replace_folder])
def test_arrays_that_no_disk_holds_say_what_was_being_written(tmp_path, how):
    """NumPy tells how many numbers were written, and neither why nor where."""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limit[1]))
        with (
            pytest.raises(OSError, match=r"No space left on device: .*a\.npy"),
            how(tmp_path / "a.npy") as path,
        ):
            np.save(path / "a.npy" if path.is_dir() else path, np.zeros(6912))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert os.listdir(tmp_path) == []


def test_the_longest_name_of_a_photo_can_be_written(tmp_path):
    path = tmp_path / f"{'n' * 200}.png"
    with atomic.replace_file(path) as temporary:
        temporary.write_text("new")
    assert path.read_text() == "new"


def test_a_long_name_of_long_letters_can_be_written(tmp_path):
    with atomic.replace_file(tmp_path / f"{'写' * 60}.png") as temporary:
        temporary.write_text("new")
    assert os.listdir(tmp_path) == [f"{'写' * 60}.png"]


def test_a_folder_that_failed_leaves_no_empty_one_around_it(tmp_path):
    """Found by the torture: the folder that it was to lie in stayed."""
    with pytest.raises(OSError, match="gone"), atomic.replace_folder(tmp_path / "a/b"):
        raise OSError("gone")
    assert list(tmp_path.iterdir()) == []
