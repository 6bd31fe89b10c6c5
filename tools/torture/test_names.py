"""Names as an input, and the oracle's own teeth."""

import random

import pandas as pd
import pytest

from alignerf.io import csv_files
from tools.torture import names

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
