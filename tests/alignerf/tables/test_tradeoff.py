"""The sweep's table and figure, and the Pareto front, from hand-made scores."""

import itertools
import re

import matplotlib.figure
import numpy as np
import pytest
from PIL import Image

from alignerf.tables import intervals
from alignerf.tables.across import tradeoff
from alignerf.tables.plots import tradeoff as tradeoff_plot
from tests import table_cases

VIEWS = 6
CHANGES = {
    "base": {},
    "steps_9": {"steps": 9},
    "table_4": {"field": {"log2_entries": 4}},
    "other_seed": {"seed": 1},
    "mlp": {"field": {"kind": "mlp", "width": 8}, "steps": 9},
    "fast": {"samples": [8, 4], "steps": 9},
}


def make_rows(rng, sets=("standard", "oracle")):
    """A row per variant, the base first."""
    rows = []
    for name in CHANGES:
        db = {test_set: rng.uniform(15, 25, VIEWS) for test_set in sets}
        own = {"train_time_s": rng.uniform(1, 100), "view_time_s": 0.25}
        base = rows[0] if rows else None
        rows.append(table_cases.row(db, name, base=base, own=own))
    return rows


@pytest.fixture
def rows(rng):
    return make_rows(rng)


@pytest.fixture
def table(rows):
    return tradeoff.make_table(rows, CHANGES)


def test_a_row_per_variant_with_its_costs_and_paired_differences(rows, table):
    assert list(table["variant"]) == list(CHANGES)
    for row, line in zip(rows, table.itertuples(), strict=True):
        assert line.train_time_s == row.own["train_time_s"]
        assert line.rays_per_s == pytest.approx(50 / line.train_time_s)
        assert (line.compile_time_s, line.render_time_s) == (5.0, 0.25)
        assert (line.params, line.steps, line.rays_seen) == (7, 5, 50)
        assert (line.test_set, line.device) == ("oracle", "cpu")
        oracle, base = row.psnr_db()["oracle"], rows[0].psnr_db()["oracle"]
        assert line.psnr_db == pytest.approx(oracle.mean())
        bounds = (line.psnr_low_db, line.psnr_high_db)
        assert bounds == pytest.approx(intervals.mean_interval(oracle))
        assert line.difference_db == pytest.approx((oracle - base).mean())
        bounds = (line.difference_low_db, line.difference_high_db)
        assert bounds == pytest.approx(intervals.mean_interval(oracle - base))
        standard = row.psnr_db()["standard"].mean()
        assert line.standard_psnr_db == pytest.approx(standard)
        assert line.ssim == 0.5


def test_changes_in_words(table):
    assert dict(zip(table["variant"], table["changes"], strict=True)) == {
        "base": "",
        "steps_9": "steps 9",
        "table_4": "field.log2_entries 4",
        "other_seed": "seed 1",
        "mlp": "field.kind mlp, field.width 8, steps 9",
        "fast": "samples [8, 4], steps 9",
    }


def test_what_a_variant_turns():
    assert {name: tradeoff.kind_of(keys) for name, keys in CHANGES.items()} == {
        "base": "base",
        "steps_9": "steps",
        "table_4": "log2_entries",
        "other_seed": "seed",
        "mlp": "kind",
        "fast": "several",
    }
    both = {"proposal": {"precision": "bfloat16"}, "field": {"precision": "bfloat16"}}
    assert tradeoff.kind_of(both) == "precision"


def test_without_a_truth_the_photos_are_the_measure(rng):
    table = tradeoff.make_table(make_rows(rng, sets=("standard",)), CHANGES)
    assert set(table["test_set"]) == {"standard"}
    assert list(table["psnr_db"]) == list(table["standard_psnr_db"])
    assert r"standard test set" in tradeoff.to_latex(table)


def test_a_view_without_a_metric_leaves_row_and_front(rows, tmp_path):
    rows[1].views.loc["v1", ("oracle", "psnr_db")] = np.nan
    table = tradeoff.make_table(rows, CHANGES)
    row = table.iloc[1]
    empty = ["psnr_db", "psnr_low_db", "difference_db"]
    assert np.isnan(row[empty].astype(float)).all()
    assert not row["pareto"]
    assert row["train_time_s"] > 0
    assert table_cases.cells(tradeoff.to_latex(table))[1][6:8] == ["--", "--"]
    tradeoff_plot.draw(table.assign(kind="steps"), tmp_path / "figure.png")


def test_without_any_score_there_is_no_figure(table, tmp_path):
    nothing = table.assign(psnr_db=np.nan, kind="steps")
    with pytest.raises(ValueError, match="figure: no variant has a PSNR"):
        tradeoff_plot.draw(nothing, tmp_path / "figure.png")


@pytest.mark.parametrize("count", [1, 2, len(CHANGES)])
def test_few_variants_make_a_figure_and_many(rows, tmp_path, count):
    table = tradeoff.make_table(rows[:count], CHANGES)
    tradeoff_plot.draw(table.assign(kind="base"), tmp_path / "figure.png")
    with Image.open(tmp_path / "figure.png") as image:
        assert min(image.size) > 500
        assert np.asarray(image.convert("L")).std() > 10


def test_another_seed_is_nothing_to_choose(rows):
    rows[3].own["train_time_s"] = 1e-3
    table = tradeoff.make_table(rows, CHANGES).set_index("variant")
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
        on_it = tradeoff.pareto_front(costs, scores)
        assert on_it.tolist() == wanted
        assert on_it.any()
        # Along the front, more costs more.
        front = sorted(set(zip(costs[on_it], scores[on_it], strict=True)))
        assert all(a[1] < b[1] for a, b in itertools.pairwise(front))


def test_the_front_at_its_extremes():
    assert tradeoff.pareto_front([3.0], [20.0]).tolist() == [True]
    assert tradeoff.pareto_front([3.0, 3.0], [20.0, 20.0]).tolist() == [True, True]
    assert tradeoff.pareto_front([3.0, 4.0], [20.0, 20.0]).tolist() == [True, False]
    assert tradeoff.pareto_front([3.0, 3.0], [20.0, 21.0]).tolist() == [False, True]
    unknown = [np.nan, 1.0, np.nan], [99.0, 20.0, np.nan]
    assert tradeoff.pareto_front(*unknown).tolist() == [False, True, False]
    assert tradeoff.pareto_front([], []).tolist() == []


def test_the_table_of_latex_is_whole(table):
    tex = tradeoff.to_latex(table)
    body = table_cases.cells(tex)
    assert len(body) == len(CHANGES)
    align = re.search(r"begin\{tabular\}\{(.+)\}\n", tex)[1]
    assert {len(row) for row in body} == {len(re.sub(r"\{\w+\}", "", align))}
    for row, line in zip(body, table.itertuples(), strict=True):
        assert line.variant.replace("_", r"\_") in row[0]
        assert ("textbf" in row[0]) == line.pareto
        start = f"{line.psnr_db:.2f} [{line.psnr_low_db:.2f}, "
        assert row[6].startswith(start)
    assert body[0][7] == "+0.00 [+0.00, +0.00]"
    assert body[2][1] == r"field.log2\_entries 4"


def test_each_number_stands_at_its_point_and_at_its_name(table):
    table = table.assign(kind="steps").sort_values("psnr_db", ascending=False)
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
