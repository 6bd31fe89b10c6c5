"""Rounds end where the training views' flow no longer falls."""

import json

import numpy as np
import pytest

from flow import rounds


@pytest.mark.parametrize(
    ("before", "after", "goes_on"),
    [
        (None, [1.0, 2.0], True),
        (None, [0.0, 0.0], False),
        ([2.0, 1.0], [1.0, 1.0], True),
        # One view rises, the mean falls by a tenth.
        ([2.0, 1.0], [1.5, 1.2], True),
        ([2.0, 1.0], [2.0, 1.0], False),
        ([2.0, 1.0], [2.0, 0.95], False),
        ([2.0, 1.0], [3.0, 1.0], False),
        ([0.0, 0.0], [0.0, 0.0], False),
        ([0.0, 0.0], [1.0, 1.0], False),
    ],
)
def test_goes_on_while_the_mean_falls(before, after, goes_on):
    found, reason = rounds.decide(before, after)
    assert found == goes_on
    assert "px" in reason


def test_the_least_fall_is_a_share():
    before, after = [100.0], [98.0]
    assert rounds.decide(before, after, least_fall=0.02)[0]
    assert not rounds.decide(before, after, least_fall=0.0201)[0]
    scaled = np.array(before) / 1e6, np.array(after) / 1e6
    assert rounds.decide(*scaled, least_fall=0.0199)[0]


def write(path, medians):
    rows = "".join(f"{view},{median}\n" for view, median in medians.items())
    path.write_text("view,median_px\n" + rows)
    return path


def run(folder, after, before=None):
    arguments = ["--after", after, "--out", folder / "decision.json"]
    arguments += ["--before", before] if before else []
    return rounds.run([str(part) for part in arguments])


def test_writes_the_decision_with_its_reason(tmp_path):
    before = write(tmp_path / "before.csv", {"a": 2.0, "b": 1.0})
    # Rows are told apart by their names, not by their order.
    after = write(tmp_path / "after.csv", {"b": 0.9, "a": 1.8})
    assert run(tmp_path, after, before) == 0
    found = json.loads((tmp_path / "decision.json").read_text())
    assert found == {
        "go_on": True,
        "reason": "median flow 1.500 -> 1.350 px (-10.0%): a fall of 2% is reached",
    }


@pytest.mark.parametrize(
    ("after", "reason"),
    [
        ({"a": 1.0}, "after.csv: its views are not those of"),
        ({"a": 1.0, "b": "nan"}, "after.csv: no finite median_px in every view"),
        ({"a": 1.0, "b": "x"}, "after.csv: no columns view and median_px"),
        ({}, "after.csv: no finite median_px"),
    ],
)
def test_bad_files_are_named(tmp_path, capsys, after, reason):
    before = write(tmp_path / "before.csv", {"a": 2.0, "b": 1.0})
    assert run(tmp_path, write(tmp_path / "after.csv", after), before) == 1
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1
    assert not (tmp_path / "decision.json").exists()


def test_a_missing_file_is_named(tmp_path, capsys):
    assert run(tmp_path, tmp_path / "no.csv") == 1
    assert "no.csv" in capsys.readouterr().err
