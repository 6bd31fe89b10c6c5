"""The table and figure of costs, and the Pareto front, from hand-made scores."""

import itertools

import numpy as np
import pytest
from PIL import Image

from alignerf.tables import scores
from alignerf.tables.across import plots, tradeoff
from tests import table_cases
from tests.table_cases import made

VIEWS = 6
METHODS = ("plain", "large", "warped")


def make_scenes(rng, sets=("standard", "oracle"), lengths=(0.5, 1, 2), seeds=(0, 1)):
    """Scenes of one capture, for each length and seed."""
    scenes = []
    for length in lengths:
        for seed in seeds:
            rows = []
            for name in METHODS:
                db = {test_set: rng.uniform(15, 25, VIEWS) for test_set in sets}
                seconds = {"total_time_s": length * rng.uniform(1, 100)}
                base = rows[0] if rows else None
                rows.append(table_cases.row(db, name, base=base, costs=seconds))
            fields = {"alike": "yard", "share": length, "seed": seed}
            name = f"yard_seed{seed}_x{length}"
            scenes.append(table_cases.scored(name, rows, **fields))
    return scenes


@pytest.fixture
def scenes(rng):
    return make_scenes(rng)


def test_a_row_per_length_and_method_and_differences_to_the_whole(scenes):
    table = made(tradeoff.make_table, scenes)
    assert list(table["length"]) == [0.5] * 3 + [1] * 3 + [2] * 3
    assert list(table["method"]) == 3 * list(METHODS)
    assert set(table["condition"]) == {"yard_seed0_x0.5"}
    assert set(table["seeds"]) == {2}
    assert set(table["views"]) == {2 * VIEWS}
    for line in table.itertuples():
        group = [one for one in scenes if one["share"].iloc[0] == line.length]
        whole = [one for one in scenes if one["share"].iloc[0] == 1]
        own = [table_cases.psnr(one, "oracle", method=line.method) for one in group]
        base = [table_cases.psnr(one, "oracle", method="plain") for one in whole]
        gains = [(a - b).to_numpy() for a, b in zip(own, base, strict=True)]
        wanted = scores.pooled_mean_and_interval(gains, "difference_")
        assert {key: getattr(line, key) for key in wanted} == pytest.approx(wanted)
        assert line.psnr_db == pytest.approx(np.mean(own))
        took = [one[one["method"] == line.method]["total_time_s"] for one in group]
        assert line.total_time_s == pytest.approx(np.mean(took))
    front = tradeoff.pareto_front(table["total_time_s"], table["psnr_db"])
    assert table["pareto"].tolist() == front.tolist()
    cells = table_cases.cells(tradeoff.to_latex(table))
    assert len(cells) == len(table)
    assert ["textbf" in row[2] for row in cells] == table["pareto"].tolist()


def test_without_a_truth_the_photos_are_the_measure(rng):
    table = made(tradeoff.make_table, make_scenes(rng, sets=("standard",)))
    assert set(table["test_set"]) == {"standard"}


def test_a_view_without_a_metric_leaves_row_and_front(scenes, tmp_path):
    lost = {"method": "warped", "test_set": "oracle", "view": "v1"}
    scenes[-1] = table_cases.emptied(scenes[-1], **lost)
    table = made(tradeoff.make_table, scenes)
    row = table.iloc[-1]
    assert np.isnan(
        row[["psnr_db", "psnr_low_db", "difference_db"]].astype(float)
    ).all()
    assert not row["pareto"]
    assert row["total_time_s"] > 0
    assert table_cases.cells(tradeoff.to_latex(table))[-1][-2:] == ["--", "--"]


@pytest.mark.parametrize("lengths", [(1,), (0.25, 0.5, 1, 2)])
def test_one_length_makes_a_figure_and_many(rng, tmp_path, lengths):
    table = made(tradeoff.make_table, make_scenes(rng, lengths=lengths, seeds=(0,)))
    plots.costs(table, tmp_path / "figure.png")
    with Image.open(tmp_path / "figure.png") as image:
        assert min(image.size) > 500
        assert np.asarray(image.convert("L")).std() > 10


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
        seconds, psnr_db = rng.integers(0, 2 + case % 9, (2, n))
        wanted = [not dominated(i, seconds, psnr_db) for i in range(n)]
        on_it = tradeoff.pareto_front(seconds, psnr_db)
        assert on_it.tolist() == wanted
        assert on_it.any()
        # Along the front, more costs more.
        front = sorted(set(zip(seconds[on_it], psnr_db[on_it], strict=True)))
        assert all(a[1] < b[1] for a, b in itertools.pairwise(front))


def test_the_front_at_its_extremes():
    assert tradeoff.pareto_front([3.0], [20.0]).tolist() == [True]
    assert tradeoff.pareto_front([3.0, 3.0], [20.0, 20.0]).tolist() == [True, True]
    assert tradeoff.pareto_front([3.0, 4.0], [20.0, 20.0]).tolist() == [True, False]
    assert tradeoff.pareto_front([3.0, 3.0], [20.0, 21.0]).tolist() == [False, True]
    unknown = [np.nan, 1.0, np.nan], [99.0, 20.0, np.nan]
    assert tradeoff.pareto_front(*unknown).tolist() == [False, True, False]
    assert tradeoff.pareto_front([], []).tolist() == []
