"""The sweep's table and figure, and the Pareto front, from hand-made files."""

import itertools
import json
import pathlib
import re

import matplotlib.figure
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from alignerf.experiment import sweep
from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import intervals, tradeoff
from alignerf.tables.plots import tradeoff as tradeoff_plot

VIEWS = ["a", "b", "c", "d", "e", "f"]
CHANGES = {
    "base": {},
    "steps_9": {"steps": 9},
    "table_4": {"field": {"log2_entries": 4}},
    "other_seed": {"seed": 1},
    "mlp": {"field": {"kind": "mlp", "width": 8}, "steps": 9},
    "fast": {"samples": [8, 4], "steps": 9},
}
SETS = ("standard", "oracle")


def make_entry(folder, name, changes, rng, sets=SETS):
    """A variant's row, with its files."""
    paths = {key: str(folder / f"{name}_{key}") for key in ("metrics", "training")}
    paths["rendering"] = str(folder / f"{name}_rendering")
    rows = [
        {
            "view": view,
            "test_set": test_set,
            "psnr_db": rng.uniform(15, 25),
            "ssim": 0.5,
        }
        for view in VIEWS
        for test_set in sets
    ]
    pd.DataFrame(rows).to_csv(paths["metrics"], index=False)
    timing = {"params": 10, "steps": 5, "rays_seen": 500, "device": "cpu"}
    timing |= {"train_time_s": float(rng.uniform(1, 100)), "compile_time_s": 2.5}
    (folder / f"{name}_training").write_text(json.dumps(timing))
    rendering = {"time_s": 9.0, "views": 6, "view_time_s": 0.25}
    (folder / f"{name}_rendering").write_text(json.dumps(rendering))
    return sweep.Point(variant=name, changes=changes, **paths)


@pytest.fixture
def entries(tmp_path, rng):
    return [make_entry(tmp_path, name, CHANGES[name], rng) for name in CHANGES]


def read_json(path):
    return json.loads(pathlib.Path(path).read_text())


def scores(entry, test_set):
    rows = pd.read_csv(entry.metrics).set_index("view")
    return rows[rows["test_set"] == test_set]["psnr_db"]


def test_a_row_per_variant_with_its_costs_and_paired_differences(entries):
    table = tradeoff.make_table(entries)
    assert tuple(table.columns) == tradeoff.COLUMNS
    assert list(table["variant"]) == list(CHANGES)
    for entry, row in zip(entries, table.itertuples(), strict=True):
        timing = read_json(entry.training)
        assert row.train_time_s == timing["train_time_s"]
        assert row.rays_per_s == pytest.approx(500 / row.train_time_s)
        assert (row.compile_time_s, row.render_time_s) == (2.5, 0.25)
        assert (row.params, row.steps, row.rays_seen) == (10, 5, 500)
        assert (row.test_set, row.device) == ("oracle", "cpu")
        oracle, base = scores(entry, "oracle"), scores(entries[0], "oracle")
        assert row.psnr_db == pytest.approx(oracle.mean())
        bounds = (row.psnr_low_db, row.psnr_high_db)
        assert bounds == pytest.approx(intervals.mean_interval(oracle))
        assert row.difference_db == pytest.approx((oracle - base).mean())
        bounds = (row.difference_low_db, row.difference_high_db)
        assert bounds == pytest.approx(intervals.mean_interval(oracle - base))
        assert row.standard_psnr_db == pytest.approx(scores(entry, "standard").mean())
        assert row.ssim == 0.5


def test_changes_in_words(entries):
    table = tradeoff.make_table(entries).set_index("variant")["changes"]
    assert table["base"] == ""
    assert table["steps_9"] == "steps 9"
    assert table["mlp"] == "field.kind mlp, field.width 8, steps 9"
    assert table["fast"] == "samples [8, 4], steps 9"


def test_what_a_variant_turns(entries):
    found = dict(zip(CHANGES, tradeoff.kinds_of(entries), strict=True))
    assert found.pop("base") == "base"
    assert found.pop("steps_9") == "steps"
    assert found.pop("table_4") == "log2_entries"
    assert found.pop("other_seed") == "seed"
    assert found.pop("mlp") == "kind"
    assert found == {"fast": "several"}
    both = {"proposal": {"precision": "bfloat16"}, "field": {"precision": "bfloat16"}}
    assert tradeoff.kind_of(both) == "precision"


def test_without_a_truth_the_photos_are_the_measure(tmp_path, rng):
    names = ["base", "fast"]
    entries = [
        make_entry(tmp_path, n, CHANGES[n], rng, sets=("standard",)) for n in names
    ]
    table = tradeoff.make_table(entries)
    assert set(table["test_set"]) == {"standard"}
    assert list(table["psnr_db"]) == list(table["standard_psnr_db"])
    assert r"standard test set" in tradeoff.to_latex(table)


def test_views_that_are_not_the_base_s_are_named(entries):
    rows = pd.read_csv(entries[2].metrics)
    rows[rows["view"] != "c"].to_csv(entries[2].metrics, index=False)
    with pytest.raises(ValueError, match="table_4_metrics: not the views of the base"):
        tradeoff.make_table(entries)


def test_a_view_without_a_metric_leaves_row_and_front(entries, tmp_path):
    rows = pd.read_csv(entries[1].metrics)
    rows.loc[rows["view"] == "b", "psnr_db"] = np.nan
    rows.to_csv(entries[1].metrics, index=False)
    table = tradeoff.make_table(entries)
    row = table.iloc[1]
    assert np.isnan(
        row[["psnr_db", "psnr_low_db", "difference_db"]].astype(float)
    ).all()
    assert not row["pareto"]
    assert row["train_time_s"] > 0
    tex = tradeoff.to_latex(table)
    assert [cell.strip() for cell in cells(tex)[1][6:8]] == ["--", "--"]
    tradeoff_plot.draw(table.assign(kind="steps"), tmp_path / "figure.png")


def test_without_any_score_there_is_no_figure(entries, tmp_path):
    table = tradeoff.make_table(entries).assign(psnr_db=np.nan, kind="steps")
    with pytest.raises(ValueError, match="figure: no variant has a PSNR"):
        tradeoff_plot.draw(table, tmp_path / "figure.png")


@pytest.mark.parametrize("count", [1, 2])
def test_few_variants_make_a_figure(entries, tmp_path, count):
    table = tradeoff.make_table(entries[:count])
    tradeoff_plot.draw(table.assign(kind="base"), tmp_path / "figure.png")
    with Image.open(tmp_path / "figure.png") as image:
        assert min(image.size) > 500


def test_another_seed_is_nothing_to_choose(entries):
    timing = read_json(entries[3].training) | {"train_time_s": 1e-3}
    pathlib.Path(entries[3].training).write_text(json.dumps(timing))
    table = tradeoff.make_table(entries).set_index("variant")
    assert not table["pareto"]["other_seed"]
    assert table["pareto"][table["train_time_s"].drop("other_seed").idxmin()]


def dominated(i, costs, scores):
    """Whether another point is as cheap and as good, and better in one of the two."""
    return any(
        costs[j] <= costs[i]
        and scores[j] >= scores[i]
        and (costs[j], scores[j]) != (costs[i], scores[i])
        for j in range(len(costs))
    )


def test_the_front_is_what_nothing_dominates(rng):
    for case in range(500):
        n = rng.integers(1, 12)
        # Few distinct values, so that ties of every sort occur.
        costs, scores = rng.integers(0, 2 + case % 9, (2, n))
        wanted = [not dominated(i, costs, scores) for i in range(n)]
        found = tradeoff.pareto_front(costs, scores)
        assert found.tolist() == wanted
        assert found.any()
        # Along the front, more costs more.
        front = sorted(set(zip(costs[found], scores[found], strict=True)))
        assert all(a[1] < b[1] for a, b in itertools.pairwise(front))


def test_the_front_at_its_extremes():
    assert tradeoff.pareto_front([3.0], [20.0]).tolist() == [True]
    assert tradeoff.pareto_front([3.0, 3.0], [20.0, 20.0]).tolist() == [True, True]
    assert tradeoff.pareto_front([3.0, 4.0], [20.0, 20.0]).tolist() == [True, False]
    assert tradeoff.pareto_front([3.0, 3.0], [20.0, 21.0]).tolist() == [False, True]
    unknown = [np.nan, 1.0, np.nan], [99.0, 20.0, np.nan]
    assert tradeoff.pareto_front(*unknown).tolist() == [False, True, False]
    assert tradeoff.pareto_front([], []).tolist() == []


def cells(tex):
    """The body's cells, row by row."""
    body = tex.split(r"\midrule")[1].split(r"\bottomrule")[0].strip()
    return [line.rstrip("\\ ").split("&") for line in body.splitlines()]


def test_the_table_of_latex_is_whole(entries):
    table = tradeoff.make_table(entries)
    body = cells(tradeoff.to_latex(table))
    assert len(body) == len(CHANGES)
    columns = re.search(r"begin\{tabular\}\{(.+)\}\n", tradeoff.to_latex(table))[1]
    assert {len(row) for row in body} == {len(re.sub(r"\{\w+\}", "", columns))}
    for row, line in zip(body, table.itertuples(), strict=True):
        assert line.variant.replace("_", r"\_") in row[0]
        assert ("bfseries" in row[0]) == line.pareto
        assert (
            row[6].strip().startswith(f"{line.psnr_db:.2f} [{line.psnr_low_db:.2f}, ")
        )
    assert body[0][7].strip() == "+0.00 [+0.00, +0.00]"
    assert r"field.log2\_entries 4" in body[2][1]


def test_as_a_command(entries, tmp_path):
    out = {key: tmp_path / "out" / f"t.{key}" for key in ("csv", "tex", "png")}
    options = {"--csv": "csv", "--tex": "tex", "--figure": "png"}
    paths = [str(part) for key, end in options.items() for part in (key, out[end])]
    tradeoff.main(["--rows", table_rows.as_json(entries), *paths])
    table = pd.read_csv(out["csv"])
    assert tuple(table.columns) == tradeoff.COLUMNS
    assert list(table["variant"]) == list(CHANGES)
    with Image.open(out["png"]) as image:
        assert min(image.size) > 500
        assert np.asarray(image.convert("L")).std() > 10
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "t.csv",
        "t.png",
        "t.provenance.json",
        "t.tex",
    ]


def test_the_seed_of_a_variant_is_told_too(entries, tmp_path):
    config = tmp_path / "config.yaml"
    config.write_text("scenes: {yard: {seed: 7}}\n")
    outputs = [f"--{key}={tmp_path / name}" for key, name in NAMES.items()]
    rows = ["--rows", table_rows.as_json(entries)]
    tradeoff.main([*rows, "--configs", str(config), *outputs])
    found = read_json(tmp_path / "t.provenance.json")
    assert found["seeds"] == [1, 7]
    assert found["device"] == ["cpu"]
    assert [row["variant"] for row in found["rows"]] == list(CHANGES)
    paths = [[one["path"] for one in row["trainings"]] for row in found["rows"]]
    assert paths == [[entry.training] for entry in entries]


NAMES = {"csv": "t.csv", "tex": "t.tex", "figure": "t.png"}


def test_without_a_base_there_is_nothing_to_compare_with(entries):
    with pytest.raises(ValueError, match="no variant 'base'"):
        tradeoff.make_table(entries[1:])


def test_each_number_stands_at_its_point_and_at_its_name(entries):
    table = tradeoff.make_table(entries).assign(kind="steps")
    table = table.sort_values("psnr_db", ascending=False)
    table = table.assign(number=range(1, len(table) + 1))
    left, right = matplotlib.figure.Figure().subplots(1, 2)
    tradeoff_plot.number_points(left, table)
    places = {text.get_text(): tuple(text.xy) for text in left.texts}
    styles = {"steps": ("black", "o")}
    tradeoff_plot.draw_differences(right, table, styles)
    names = [label.get_text() for label in right.get_yticklabels()]
    # The best on top.
    assert [int(name.split()[-1]) for name in names] == list(range(len(table), 0, -1))
    for row in table.itertuples():
        assert places[str(row.number)] == (row.train_time_s, row.psnr_db)
        name = row.variant.replace("_", " ")
        assert f"{name}   {row.number:2d}" in names
