"""Outputs are whole or not there."""

import os

import pytest

from alignerf.command import whole


def test_a_failure_leaves_the_old_folder_and_nothing_else(tmp_path):
    old = tmp_path / "out"
    old.mkdir()
    (old / "kept").write_text("old")

    def fail():
        with whole.replace_folder(old) as temporary:
            (temporary / "half").write_text("new")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert os.listdir(tmp_path) == ["out"]
    assert os.listdir(old) == ["kept"]
    with whole.replace_folder(old) as temporary:
        (temporary / "new").write_text("new")
    assert os.listdir(tmp_path) == ["out"]
    assert os.listdir(old) == ["new"]


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("old")

    def fail():
        with whole.replace_file(path) as temporary:
            assert temporary.suffix == ".csv"
            temporary.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert os.listdir(tmp_path) == ["a.csv"]
    assert path.read_text() == "old"
    with whole.replace_file(path) as temporary:
        temporary.write_text("new")
    assert os.listdir(tmp_path) == ["a.csv"]
    assert path.read_text() == "new"
