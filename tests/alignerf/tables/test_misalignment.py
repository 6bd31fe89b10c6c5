"""The misalignment table: means, costs, colours, from hand-made files."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from alignerf import show
from alignerf.tables import intervals, misalignment
from tests import table_cases


def psnr_of(path):
    return pd.read_csv(path).pivot(index="view", columns="test_set", values="psnr_db")


def test_a_row_per_test_set_with_means_and_all_costs_so_far(entry):
    rows = list(misalignment.lines_of(entry))
    assert [row["test_set"] for row in rows] == ["standard", "warped", "control"]
    scores = pd.read_csv(entry.metrics)
    for row in rows:
        assert set(row) == set(misalignment.COLUMNS) - {"lpips_published", "source"}
        assert (row["method"], row["field"]) == ("my_method", "grid 2^15")
        assert row["warping"] == "once"
        assert (row["train_time_s"], row["data_time_s"]) == (30.0, 3.75)
        assert row["total_time_s"] == 33.75
        assert (row["steps"], row["rays_seen"], row["params"]) == (10, 100, 1)
        views = scores[scores["test_set"] == row["test_set"]]
        for key in misalignment.METRICS:
            assert row[key] == pytest.approx(np.mean(views[key]))


def test_renders_cost_what_their_views_do(entry, tmp_path):
    """Compiling counts no more than a training's does; here 2 s of 3."""
    path = tmp_path / "render/train.json"
    path.parent.mkdir()
    path.write_text(json.dumps({"time_s": 3.0, "views": 4, "view_time_s": 0.25}))
    entry = entry._replace(data=[str(path)])
    assert {row["data_time_s"] for row in misalignment.lines_of(entry)} == {1.0}


def test_a_view_in_which_nothing_moves_has_no_part_in_what_moves(entry):
    """A view that lacks another metric still empties its mean."""
    for path, psnr_db in ((entry.metrics, 21.0), (entry.base_metrics, 20.0)):
        scores = pd.read_csv(path)
        moving = scores[scores["test_set"] == "standard"].iloc[1:].copy()
        moving["test_set"], moving["psnr_db"] = "oracle_moving", psnr_db
        still = moving.assign(test_set="oracle_still")
        pd.concat([scores, moving, still]).to_csv(path, index=False)
    found = {row["test_set"]: row for row in misalignment.lines_of(entry)}
    assert found["oracle_moving"]["psnr_db"] == 21.0
    assert found["oracle_moving"]["difference_db"] == 1.0
    assert np.isnan(found["oracle_still"]["psnr_db"])


def test_differences_to_the_base_are_paired_by_view(entry):
    psnr, base = (psnr_of(getattr(entry, key)) for key in ("metrics", "base_metrics"))
    for row in misalignment.lines_of(entry):
        each = psnr[row["test_set"]] - base[row["test_set"]]
        assert row["difference_to"] == "plain"
        assert row["difference_db"] == pytest.approx(each.mean())
        low, high = intervals.mean_interval(each)
        assert (row["difference_low_db"], row["difference_high_db"]) == (low, high)
        # What a view is hard for both does not widen it.
        assert high - low < np.ptp(each) + 1e-9
    own = entry._replace(base_metrics=entry.metrics)
    keys = ("difference_db", "difference_low_db", "difference_high_db")
    for row in misalignment.lines_of(own):
        assert [row[key] for key in keys] == [0, 0, 0]


def test_a_base_of_other_views_is_named(entry):
    scores = pd.read_csv(entry.base_metrics)
    scores[scores["view"] != "b"].to_csv(entry.base_metrics, index=False)
    with pytest.raises(ValueError, match=r"metrics\.csv: not the views of plain"):
        list(misalignment.lines_of(entry))


def test_warpings_have_the_names_of_the_paper(entry):
    names = {
        number: next(misalignment.lines_of(entry._replace(round=number)))["warping"]
        for number in (0, 1, 2, 5)
    }
    assert names == {0: "none", 1: "once", 2: "twice", 5: "5 times"}


def test_a_view_without_a_metric_leaves_the_mean_empty(entry):
    scores = pd.read_csv(entry.metrics)
    missing = (scores["view"] == "b") & (scores["test_set"] == "warped")
    scores.loc[missing, "psnr_db"] = np.nan
    scores.to_csv(entry.metrics, index=False)
    rows = {row["test_set"]: row for row in misalignment.lines_of(entry)}
    assert np.isnan(rows["warped"]["psnr_db"])
    assert np.isnan(rows["warped"]["difference_db"])
    assert np.isnan(rows["warped"]["difference_low_db"])
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
            "difference_to": "method_0",
            "difference_db": db - psnr[0],
            "difference_low_db": db - psnr[0] - 0.5,
            "difference_high_db": db - psnr[0] + 0.5,
            "train_time_s": 60.0,
            "data_time_s": 30.0,
            "total_time_s": 90.0,
            "params": 2_500_000,
            "steps": 1,
            "rays_seen": 1,
        }
        for number, (db, distance) in enumerate(zip(psnr, lpips, strict=True))
    ]
    return pd.DataFrame(rows, columns=misalignment.COLUMNS)


def cells(tex):
    """The body's cells, row by row."""
    body = tex.split(r"\midrule")[1].split(r"\bottomrule")[0]
    lines = [line for line in body.splitlines() if "&" in line]
    rows = [line.strip().removesuffix(r"\\").split("&") for line in lines]
    return [[cell.strip() for cell in row] for row in rows]


def places(tex, column):
    """1, 2 or 3 for the coloured cells of a column, 0 for the others."""
    colours = [""] + [colour.lstrip("#") for colour in misalignment.COLOURS]
    marks = [re.search(r"HTML\]\{(\w+)\}", row[column]) for row in cells(tex)]
    return [colours.index(mark[1]) if mark else 0 for mark in marks]


def test_the_best_three_are_coloured_each_in_its_sense():
    psnr, lpips = [20.0, 23.0, 21.0, 22.0], [0.4, 0.1, 0.3, 0.2]
    tex = misalignment.to_latex(make_table(psnr, lpips))
    assert places(tex, 2) == [0, 1, 3, 2]
    assert places(tex, 4) == [0, 1, 3, 2]
    assert places(tex, 6) == [0, 0, 0, 0]
    # A tie is one rank; costs are not ranked.
    assert places(misalignment.to_latex(make_table([20.0, 20.0, 19.0])), 2) == [1, 1, 3]
    assert places(tex, 5) == [0, 0, 0, 0]


def test_the_table_of_latex_is_whole():
    tex = misalignment.to_latex(make_table([20.123, np.nan]))
    assert cells(tex)[0][0] == r"method\_0"
    assert cells(tex)[0][2].endswith("20.12")
    assert cells(tex)[1][2] == "--"
    costs = [cell.split()[-1] for cell in cells(tex)[0][-4:]]
    assert costs == ["1.00", "0.50", "1.50", "2.50"]
    for name in ("toprule", "midrule", "bottomrule", "begin{tabular}", "end{tabular}"):
        assert tex.count("\\" + name) == 1
    # Without weights there is no column of LPIPS.
    assert "LPIPS" not in tex
    tex = misalignment.to_latex(make_table([20.0], [0.5]))
    assert "LPIPS (Alex)" in tex
    assert "No lpips_vgg column" in tex
    table = make_table([20.0], [0.5]).assign(lpips_squeeze=0.3, lpips_vgg=0.4)
    tex = misalignment.to_latex(table)
    assert [cell.split()[-1] for cell in cells(tex)[0][4:7]] == [
        "0.500",
        "0.300",
        "0.400",
    ]


def test_what_is_beyond_chance_is_bold_and_the_base_has_no_difference():
    column = [
        row[4] for row in cells(misalignment.to_latex(make_table([20, 20.3, 21, 19])))
    ]
    assert column[0] == ""
    assert column[1] == r"+0.30 {\tiny [-0.20, +0.80]}"
    assert column[2] == r"\textbf{+1.00} {\tiny [+0.50, +1.50]}"
    assert column[3] == r"\textbf{-1.00} {\tiny [-1.50, -0.50]}"


def test_on_the_screen(capsys, tmp_path):
    folder = tmp_path / "my_scene" / "tables"
    folder.mkdir(parents=True)
    make_table([20, 20.3, 21]).to_csv(folder / "misalignment.csv", index=False)
    show.main([str(tmp_path)])
    lines = capsys.readouterr().out.splitlines()
    found = {line.split()[0]: line.split() for line in lines if "method_" in line}
    assert found["method_0"][2:4] == ["20.00", "60"]
    assert found["method_1"][2:5] == ["20.30", "+0.30", "60"]
    assert found["method_2"][2:5] == ["21.00", "+1.00*", "60"]
    # Training and data together.
    assert found["method_2"][5] == "90"


def test_who_stays_below_the_baseline_is_told_why(tmp_path):
    table = make_table([20, 19.7, 21, 18])
    staged = ["method_1", "method_2", "method_3"]
    lines = list(show.below_baseline(table, staged))
    # Only beyond chance: method_1 is 0.30 dB below, give or take 0.50.
    assert len(lines) == 1
    assert lines[0].startswith("method_3 is 2.00 dB below method_0 (standard): ")
    assert not list(show.below_baseline(table, staged[:2]))
    config = {"methods": {"a": {"alignerf": None}, "b": {"alignerf": {"patches": 4}}}}
    assert show.staged_of(tmp_path) == []
    (tmp_path / "config.yaml").write_text(json.dumps(config))
    assert show.staged_of(tmp_path) == ["b"]


def test_one_row():
    assert len(cells(misalignment.to_latex(make_table([20.0])))) == 1


def test_as_a_command(entry, tmp_path):
    rows = [entry._replace(method=name) for name in ("z_first", "a")]
    out = table_cases.make("misalignment", rows, tmp_path / "tables")
    table = pd.read_csv(out[0])
    assert tuple(table.columns) == misalignment.COLUMNS
    # In the order of the config, not of the alphabet.
    assert list(table["method"]) == ["z_first"] * 3 + ["a"] * 3
    assert [row[0] for row in cells(out[1].read_text())] == [r"z\_first", "a"]
    found = sorted(path.name for path in out[0].parent.iterdir())
    kinds = ("csv", "provenance.json", "tex")
    assert found == [f"misalignment.{kind}" for kind in kinds]
    # Whole numbers, however large.
    assert out[0].read_text().splitlines()[1].endswith(",1,10,100,")


def test_a_view_without_seconds_leaves_the_costs_empty(entry, tmp_path):
    (tmp_path / "flow.csv").write_text("view,time_s\na,0.5\nb,\n")
    table = misalignment.make_table([entry])
    assert table[["data_time_s", "total_time_s"]].isna().all(axis=None)
    assert table["train_time_s"].tolist() == [30.0] * 3
    costs = [cell.split()[-1] for cell in cells(misalignment.to_latex(table))[0][-4:]]
    assert costs[:3] == ["0.50", "--", "--"]


def test_a_table_fits_into_a_narrow_terminal(monkeypatch):
    table = pd.DataFrame({f"column {n}": [1.5, 2.5] for n in range(12)})
    assert len(show.fitting(table).splitlines()) == 3
    monkeypatch.setattr(show.sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "72")
    found = show.fitting(table).splitlines()
    assert max(map(len, found)) <= 72
    assert len(found) > 6
