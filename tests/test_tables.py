"""The misalignment table: means, costs, colours, from hand-made files."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from alignerf import tables

VIEWS = ["a", "b", "c"]


@pytest.fixture
def entry(tmp_path, rng):
    """One method's entry after one warping round, with its files."""
    rows = [
        {
            "view": view,
            "test_set": test_set,
            "psnr_db": rng.uniform(15, 25),
            "ssim": rng.uniform(),
            "lpips_alex": rng.uniform(),
        }
        for view in VIEWS
        for test_set in ("standard", "standard_valid", "warped", "control")
    ]
    pd.DataFrame(rows).to_csv(tmp_path / "metrics.csv", index=False)
    for number, seconds in enumerate((10.0, 20.0)):
        timing = {
            "train_time_s": seconds,
            "steps": 5,
            "rays_seen": 50,
            "params": number,
        }
        (tmp_path / f"train{number}.json").write_text(json.dumps(timing))
    (tmp_path / "render.json").write_text(json.dumps({"time_s": 3.0, "views": 7}))
    (tmp_path / "flow.csv").write_text("view,time_s\na,0.5\nb,0.25\n")
    return {
        "method": "my_method",
        "field": "grid 2^15",
        "round": 1,
        "metrics": str(tmp_path / "metrics.csv"),
        "trainings": [str(tmp_path / f"train{number}.json") for number in (0, 1)],
        "data": [str(tmp_path / "render.json"), str(tmp_path / "flow.csv")],
    }


def test_a_row_per_test_set_with_means_and_all_costs_so_far(entry):
    rows = list(tables.rows_of(entry))
    assert [row["test_set"] for row in rows] == ["standard", "warped", "control"]
    scores = pd.read_csv(entry["metrics"])
    for row in rows:
        assert set(row) == set(tables.COLUMNS)
        assert (row["method"], row["field"]) == ("my_method", "grid 2^15")
        assert row["warping"] == "once"
        assert (row["train_time_s"], row["data_time_s"]) == (30.0, 3.75)
        assert (row["steps"], row["rays_seen"], row["params"]) == (10, 100, 1)
        views = scores[scores["test_set"] == row["test_set"]]
        for key in tables.METRICS:
            assert row[key] == pytest.approx(np.mean(views[key]))


def test_warpings_have_the_names_of_the_paper(entry):
    names = {
        number: next(tables.rows_of(entry | {"round": number}))["warping"]
        for number in (0, 1, 2, 5)
    }
    assert names == {0: "none", 1: "once", 2: "twice", 5: "5 times"}


def test_a_view_without_a_metric_leaves_the_mean_empty(entry):
    scores = pd.read_csv(entry["metrics"])
    missing = (scores["view"] == "b") & (scores["test_set"] == "warped")
    scores.loc[missing, "psnr_db"] = np.nan
    scores.to_csv(entry["metrics"], index=False)
    rows = {row["test_set"]: row for row in tables.rows_of(entry)}
    assert np.isnan(rows["warped"]["psnr_db"])
    assert np.isfinite(rows["warped"]["ssim"])
    assert np.isfinite(rows["standard"]["psnr_db"])


def make_table(psnr, lpips=None):
    """A table of len(psnr) methods on the standard test set."""
    lpips = [np.nan] * len(psnr) if lpips is None else lpips
    rows = [
        {
            "method": f"method_{number}",
            "field": "mlp 8",
            "warping": "none",
            "test_set": "standard",
            "psnr_db": db,
            "ssim": 0.5,
            "lpips_alex": distance,
            "train_time_s": 60.0,
            "data_time_s": 30.0,
            "params": 2_500_000,
            "steps": 1,
            "rays_seen": 1,
        }
        for number, (db, distance) in enumerate(zip(psnr, lpips, strict=True))
    ]
    return pd.DataFrame(rows, columns=tables.COLUMNS)


def cells(tex):
    """The body's cells, row by row."""
    body = tex.split(r"\midrule")[1].split(r"\bottomrule")[0]
    lines = [line for line in body.splitlines() if "&" in line]
    return [[cell.strip(" \\") for cell in line.split("&")] for line in lines]


def places(tex, column):
    """1, 2 or 3 for the coloured cells of a column, 0 for the others."""
    colours = [""] + [colour.lstrip("#") for colour in tables.COLOURS]
    marks = [re.search(r"HTML\]\{(\w+)\}", row[column]) for row in cells(tex)]
    return [colours.index(mark[1]) if mark else 0 for mark in marks]


def test_the_best_three_are_coloured_each_in_its_sense():
    psnr, lpips = [20.0, 23.0, 21.0, 22.0], [0.4, 0.1, 0.3, 0.2]
    tex = tables.to_latex(make_table(psnr, lpips))
    assert places(tex, 2) == [0, 1, 3, 2]
    assert places(tex, 4) == [0, 1, 3, 2]
    # A tie is one rank; costs are not ranked.
    assert places(tables.to_latex(make_table([20.0, 20.0, 19.0])), 2) == [1, 1, 3]
    assert places(tex, 5) == [0, 0, 0, 0]


def test_the_table_of_latex_is_whole():
    tex = tables.to_latex(make_table([20.123, np.nan]))
    assert cells(tex)[0][0] == r"method\_0"
    assert cells(tex)[0][2].endswith("20.12")
    assert cells(tex)[1][2] == "--"
    assert [cell.split()[-1] for cell in cells(tex)[0][-3:]] == ["1.00", "0.50", "2.50"]
    for name in ("toprule", "midrule", "bottomrule", "begin{tabular}", "end{tabular}"):
        assert tex.count("\\" + name) == 1
    # Without weights there is no column of LPIPS.
    assert "LPIPS" not in tex
    assert "LPIPS" in tables.to_latex(make_table([20.0], [0.5]))


def test_one_row():
    assert len(cells(tables.to_latex(make_table([20.0])))) == 1


def test_as_a_command(entry, tmp_path):
    out = [tmp_path / "tables" / name for name in ("t.csv", "t.tex")]
    rows = json.dumps([entry | {"method": name} for name in ("z_first", "a")])
    tables.main(["--rows", rows, "--csv", str(out[0]), "--tex", str(out[1])])
    table = pd.read_csv(out[0])
    assert tuple(table.columns) == tables.COLUMNS
    # In the order of the config, not of the alphabet.
    assert list(table["method"]) == ["z_first"] * 3 + ["a"] * 3
    assert [row[0] for row in cells(out[1].read_text())] == [r"z\_first", "a"]
    assert sorted(path.name for path in out[0].parent.iterdir()) == ["t.csv", "t.tex"]
