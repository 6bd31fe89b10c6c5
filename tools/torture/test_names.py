"""Names as an input, and the oracle's own teeth."""

import random

import pandas as pd
import pytest

from alignerf.io import csv_files
from tools.torture import environments, names

CASES = 60


@pytest.mark.parametrize("way", [names.of_table, names.of_folder])
def test_names_are_read_back_as_they_were_written(way, tmp_path):
    choice, found = random.Random(1), []
    for number in range(CASES):
        folder = tmp_path / str(number)
        folder.mkdir()
        if fault := way(names.drawn(choice), folder, choice):
            found.append(fault)
    assert found == []


def test_a_reader_of_numbers_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_files, "read", pd.read_csv)
    assert "'007' is read as np" in names.of_table("007", tmp_path, random.Random(0))


def test_every_switch_of_jax_is_tried():
    known = environments.variables()
    assert {"JAX_ENABLE_X64", "JAX_DEFAULT_MATMUL_PRECISION", "XLA_FLAGS"} <= set(known)
    assert known["JAX_ENABLE_X64"] == ("1", "x")
    assert len(known) > 100


def test_a_finding_is_made_small():
    case = {"A": "1", "B": "2", "C": "3"}
    assert environments.smallest(case, lambda v: "B" in v) == {"B": "2"}
    assert environments.smallest(case, lambda v: {"A", "C"} <= set(v)) == {
        "A": "1",
        "C": "3",
    }
