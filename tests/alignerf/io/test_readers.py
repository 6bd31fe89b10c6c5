"""Tables and JSON of ours: what is wrong with a file is a line that names it."""

import os
import time

import numpy as np
import pandas as pd
import pytest

from alignerf.io import archives, csv_files, faults, images, json_files, yaml_files
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
        (GOOD + "b,x,\n", "column psnr_db: not numbers"),
        (GOOD + "b,1\n", "rows of different lengths"),
        (GOOD + "b,1,x,2\n", "rows of different lengths"),
        (GOOD + "b,inf,\n", "column psnr_db: not numbers"),
        (GOOD + 'b,1,"open', "EOF inside string"),
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
COUNTS = {"table", "round", "rows", "views", "scenes", "seeds", "pareto", "tau"}
COUNTS |= {"tau_low", "tau_high", "motion_m", "flow_mrad", "budget", "memory_mib"}
COUNTS |= {"moves_cameras", "moves_photos", "half", "pairs", "match_blur"}
COUNTS |= {"within_025", "within_050", "within_100"}
COUNTS |= {"centre", "centre_x", "centre_y", "centre_z"}
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


TEXTS_READ = [csv_files.read, json_files.read, yaml_files.read, faults.text]
BYTES_READ = [read_archive, archives.read_numbers, images.read]


@pytest.mark.usefixtures("ten_seconds")
@pytest.mark.parametrize("read", [*TEXTS_READ, *BYTES_READ, faults.content])
def test_a_pipe_is_not_waited_for(tmp_path, read):
    os.mkfifo(tmp_path / "a")
    with pytest.raises(ValueError, match=r"a: not a file"):
        read(tmp_path / "a")


@pytest.mark.parametrize("read", [*TEXTS_READ, *BYTES_READ, faults.content])
def test_a_file_that_is_missing_is_named(tmp_path, read):
    with pytest.raises(ValueError, match=r"a: not found"):
        read(tmp_path / "a")


@pytest.mark.parametrize("read", TEXTS_READ)
@pytest.mark.parametrize("content", [b"view\n\xe4\n", "ä".encode("utf-16")])
def test_a_text_that_is_not_utf_8_is_named(tmp_path, read, content):
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(ValueError, match=r"a: not UTF-8: ") as told:
        read(tmp_path / "a")
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("read", "text", "found"),
    [
        (json_files.read, '{"a": "ä"}', {"a": "ä"}),
        (yaml_files.read, "a: ä\r\n", {"a": "ä"}),
        (faults.text, "ä\r\n", "ä\n"),
        (lambda path: list(csv_files.read(path)), "view,ä\r\na,1\r\n", ["view", "ä"]),
    ],
)
def test_a_byte_order_mark_is_no_part_of_a_text(tmp_path, read, text, found):
    """As editors of Windows leave it."""
    (tmp_path / "a").write_bytes(text.encode("utf-8-sig"))
    assert read(tmp_path / "a") == found


@pytest.mark.parametrize("read", TEXTS_READ)
def test_a_large_text_is_refused_by_its_size(tmp_path, read):
    with open(tmp_path / "a", "wb") as file:
        file.truncate(2**36)
    with pytest.raises(ValueError, match=r"a: 68,719,476,736 bytes, over "):
        read(tmp_path / "a")


def test_a_config_of_a_mebibyte_is_the_largest(tmp_path):
    (tmp_path / "a").write_text("a: 1\n#" + (2**20 - 6) * "c")
    assert yaml_files.read(tmp_path / "a") == {"a": 1}
    (tmp_path / "a").write_text("a: 1\n#" + (2**20 - 5) * "c")
    with pytest.raises(ValueError, match=r"a: 1,048,577 bytes, over 1,048,576"):
        yaml_files.read(tmp_path / "a")


def lists(depth, width):
    """YAML of lists in lists, each written once: width ** depth values."""
    lines = [f"l0: &l0 [{', '.join(['x'] * width)}]"]
    for i in range(1, depth):
        lines.append(f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * width)}]")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("depth", [1, 3, 6, 9, 40])
def test_aliases_are_counted_before_they_are_followed(tmp_path, depth):
    """A config may use them; 540 bytes of them may stand for a billion values."""
    path, width = tmp_path / "a.yaml", 9
    path.write_text(lists(depth, width))
    began_s = time.process_time()
    if width**depth < yaml_files.MAX_VALUES / 2:
        assert len(yaml_files.read(path)) == depth
    else:
        with pytest.raises(ValueError, match=r"a\.yaml: over 100,000 values"):
            yaml_files.read(path)
    assert time.process_time() - began_s < 5


@pytest.mark.parametrize("text", ["a: &a [*a]", "&a {x: *a}", "&a {<<: *a}"])
def test_what_holds_itself_is_named(tmp_path, text):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(ValueError, match=r"a\.yaml: over 100,000 values"):
        yaml_files.read(tmp_path / "a.yaml")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('{"frames": [' + "0," * 100_000 + "0]}", "frames: 100,001 entries, over"),
        ('{"frames": [' + "{}," * 2_500_000 + "{}]}", "over 5,000,000 values"),
        ("[" * 5_000_001, "over 5,000,000 values"),
    ],
)
def test_json_of_too_many_values_is_named(tmp_path, text, reason):
    (tmp_path / "a").write_text(text)
    started = time.process_time()
    with pytest.raises(ValueError, match=rf"a: not the JSON.*{reason}"):
        json_files.read(tmp_path / "a", {"frames": list})
    assert time.process_time() - started < 2


def test_a_list_of_too_many_entries_is_named(tmp_path):
    (tmp_path / "a").write_text("[" + "0," * 100_000 + "0]")
    with pytest.raises(ValueError, match=r"a: .*100,001 entries, over 100,000"):
        json_files.read_list(tmp_path / "a")
