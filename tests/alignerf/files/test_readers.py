"""Tables and JSON of ours: what is wrong with a file is a line that names it."""

import os

import numpy as np
import pandas as pd
import pytest

from alignerf.files import archives, csv_files, json_files
from alignerf.tables import columns


def read_archive(path):
    return archives.read(path, ["valid"])


GOOD = "view,psnr_db,note\n0042,20.5,\nNA,,x\n"


def test_a_table_is_read_with_its_names_as_text(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(GOOD)
    table = csv_files.read(path, columns=["psnr_db"])
    assert table["view"].tolist() == ["0042", "NA"]
    assert table["psnr_db"][0] == 20.5
    assert np.isnan(table["psnr_db"][1])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (None, "not found"),
        ("", "no row"),
        ("view,psnr_db,note\n", "no row"),
        ("view,ssim\na,1\n", "no column psnr_db"),
        (GOOD + "b,1", "row 3 has 2 cells, the head 3"),
        (GOOD + "b,x,\n", "column psnr_db: not numbers"),
        (GOOD + "b,inf,\n", "column psnr_db: not finite"),
        (GOOD + f"b,{'9' * 400},\n", "column psnr_db: not"),
        (GOOD + "b,-1,\n", "column psnr_db: below 0"),
        (GOOD + "b,nan,\n", "column psnr_db: nan in row 3"),
        (GOOD + "b,20.5,whole but for the end", "its last line is cut off"),
        (GOOD + "0042,20.5,\n", "two equal rows of view 0042"),
        (GOOD + "\0", "a byte of zero"),
        ("view,view,psnr_db\na,b,1\n", "a column stands twice"),
        (GOOD + 'b,1,"open', "unexpected end of data"),
        (GOOD + f"b,1,{'x' * 200_000}\n", "field larger than"),
        (b"view,psnr_db\n\xe4,1\n", "utf-8"),
    ],
)
def test_a_table_that_is_none_is_named(tmp_path, text, reason):
    path = tmp_path / "a.csv"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=rf"a\.csv: .*{reason}"):
        csv_files.read(path, columns=["view", "psnr_db"])


# Columns without a unit that count something, or say yes or no.
COUNTS = {"round", "rows", "views", "scenes", "seeds", "pareto", "tau"}
COUNTS |= {"tau_low", "tau_high", "motion_m", "flow_mrad", "budget", "memory_mib"}
COUNTS |= {"moves_cameras", "moves_photos"}
TEXTS = sorted(
    {
        name
        for table in columns.TABLES.values()
        for name in table.columns
        if name not in COUNTS and not csv_files.NUMBERS.search(name)
    }
)
NAMES = ["007", "1e3", "1_000", "0x1f", "NA", "null", "nan", "inf", "True", "-1", "1.0"]


@pytest.mark.parametrize("column", TEXTS)
def test_names_are_read_back_as_they_were_written(tmp_path, column):
    path = tmp_path / "a.csv"
    pd.DataFrame({column: NAMES, "ssim": range(len(NAMES))}).to_csv(path, index=False)
    assert csv_files.read(path)[column].tolist() == NAMES
    # Of a column with one name, each may look like a number.
    for name in NAMES:
        path.write_text(f"{column},ssim\n{name},1\n,2\n")
        read, empty = csv_files.read(path)[column]
        assert (read, isinstance(empty, str)) == (name, False)


KINDS = {"steps": int, "time_s": json_files.NUMBER, "go_on": bool}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('{"steps": 3, "time_s": 1.5}', "no go_on"),
        ('{"steps": 3.5, "time_s": 1.5, "go_on": true}', "steps is 3.5"),
        ('{"steps": true, "time_s": 1.5, "go_on": true}', "steps is True"),
        ('{"steps": 3, "time_s": NaN, "go_on": true}', "time_s is nan"),
        ('{"steps": 3, "time_s": 1e999, "go_on": true}', "time_s is inf"),
        (f'{{"steps": 3, "time_s": {10**400}, "go_on": true}}', "time_s is 1000"),
        ('{"steps": 3, "time_s": 1, "go_on": 1}', "go_on is 1"),
        (f'{{"steps": {"9" * 5000}}}', "limit"),
        ("[1]", "not an object"),
        ("[" * 10**5, "nested too deeply"),
        (b'{"steps": "\xe4"}', "utf-8"),
    ],
)
def test_json_that_is_none_is_named(tmp_path, text, reason):
    path = tmp_path / "a.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=rf"a\.json: .*{reason}"):
        json_files.read(path, KINDS)


def test_json_that_is_as_it_should_be_is_read(tmp_path):
    path = tmp_path / "a.json"
    path.write_text('{"steps": 3, "time_s": 2, "go_on": false, "more": [1]}')
    assert json_files.read(path, KINDS)["more"] == [1]


@pytest.mark.parametrize("read", [csv_files.read, json_files.read, read_archive])
def test_a_pipe_is_not_waited_for(tmp_path, read):
    os.mkfifo(tmp_path / "a")
    with pytest.raises(ValueError, match=r"a: .*not a file"):
        read(tmp_path / "a")
