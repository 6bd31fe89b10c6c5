"""What the paper's rows gain beside what ours do, and the word for it."""

import numpy as np
import pandas as pd
import pytest

from alignerf.experiment.tables import rows as table_rows
from alignerf.io import csv_files
from alignerf.tables import columns, effects
from tests import table_cases
from tests.table_cases import one

VIEWS_DB = np.array([20.0, 24.0, 22.0])
SETS = ("standard", "warped", "oracle")
PLAIN = ("plain", 0, "baseline")
CONVOLUTION = ("ours", 0, "+ convolution")


def scene_of(rows, *, seed=0, **fields):
    """A scene of {(method, round, what the paper calls it): dB above VIEWS_DB}.

    The dB are of each test set, or {test set: dB}; fields: of its `Scene`.
    """
    made = []
    for place, ((method, round, called), gains) in enumerate(rows.items()):
        if not isinstance(gains, dict):
            gains = dict.fromkeys(SETS, gains)
        db = {test_set: VIEWS_DB + gain for test_set, gain in gains.items()}
        costs = {"total_time_s": 10.0 + 5 * place, "params": 10**place}
        row = table_cases.row(db, method, round, costs=costs, published=called)
        # As a frame that is read has it.
        made.append(row.assign(base=f"{method}/round0"))
    fields = {"alike": "yard", "share": 1} | fields
    return table_cases.scored(f"yard_{seed}", made, seed=seed, **fields)


def of_table(scenes, number=4):
    """The effects of scenes, as the command finds them."""
    published = csv_files.read(table_rows.published_table())
    views = pd.concat(scenes, ignore_index=True)
    pixels = dict.fromkeys(views["scene"], 25)
    return effects.of_table(number, views, published, pixels)


def test_effects_are_found_by_what_the_paper_calls_methods():
    scenes = [
        scene_of({PLAIN: 0.0, CONVOLUTION: gain}, seed=seed, scene_steps=500)
        for seed, gain in enumerate((0.5, 1.0, 1.5))
    ]
    table = of_table(scenes)
    assert list(table.columns) == columns.names("effects")
    row = one(table, effect="+ convolution")
    assert (row["method"], row["over"], row["condition"]) == ("ours", "plain", "yard_0")
    assert row["standard_db"] == row["warped_db"] == row["truth_db"] == 1.0
    assert row["truth"] == "oracle"
    # Student's t is 4.3 for three seeds, half a decibel apart.
    assert row["truth_low_db"] == pytest.approx(1 - 4.303 * 0.5 / np.sqrt(3), abs=1e-3)
    # 10 s and 15 s; 100 rays for 25 pixels.
    assert (row["times"], row["params_times"], row["epochs"]) == (1.5, 10, 4)
    assert (row["seeds"], row["steps"], row["group"]) == (3, 500, "1x")
    assert row["ssim"] == 0
    others = table[table["effect"] != "+ convolution"]
    assert list(others["effect"]) == [
        "+ alignment",
        "+ high-frequency loss",
        "all three",
    ]
    assert set(others["reproduced"]) == {"not tested"}


def test_a_view_without_a_valid_flow_is_left_out():
    scenes = [scene_of({PLAIN: 0.0, CONVOLUTION: 1.0}, seed=k) for k in range(3)]
    for scene in scenes:
        lost = (scene["test_set"] == "warped") & (scene["view"] == "v1")
        scene.loc[lost, [*columns.METRICS]] = np.nan
    row = one(of_table(scenes), effect="+ convolution")
    assert row["warped_db"] == row["standard_db"] == 1.0


@pytest.mark.parametrize(
    ("gains", "seeds", "word"),
    [
        ([1.0], 3, "yes"),
        ([{"standard": -1.0, "warped": 1.0, "oracle": 1.0}], 3, "yes"),
        ([{"standard": 1.0, "warped": -1.0, "oracle": 1.0}], 3, "partly"),
        ([{"standard": 1.0, "warped": 0.0, "oracle": 1.0}], 3, "partly"),
        ([0.1, 2.0, 0.0], 3, "no"),
        ([-1.0], 3, "no: the opposite"),
        ([1.0], 1, "one seed"),
        ([-1.0], 2, "two seeds"),
        ([0.09], 3, "below the seeds' spread"),
        ([{"warped": 1.0, "oracle": np.nan}], 3, "not tested"),
        # Without the truth the paper's own test sets say it.
        ([{"standard": 1.0, "warped": 1.0}], 3, "yes"),
        ([{"standard": -1.0, "warped": 1.0}], 3, "partly"),
        ([{"standard": 1.0}], 3, "yes"),
        ([{"control": 1.0}], 3, "not tested"),
    ],
)
def test_the_word_for_an_effect_is_by_rule(gains, seeds, word):
    every = {test_set for gain in gains if isinstance(gain, dict) for test_set in gain}
    plain = dict.fromkeys(every or SETS, 0.0)
    scenes = [
        scene_of({PLAIN: plain, CONVOLUTION: gains[seed % len(gains)]}, seed=seed)
        for seed in range(seeds)
    ]
    assert one(of_table(scenes), effect="+ convolution")["reproduced"] == word


def test_a_test_set_that_one_row_lacks_is_not_compared():
    scenes = [
        scene_of({PLAIN: {"standard": 0.0, "warped": 0.0}, CONVOLUTION: 1.0}, seed=seed)
        for seed in range(3)
    ]
    row = one(of_table(scenes), effect="+ convolution")
    assert (row["warped_db"], row["reproduced"]) == (1.0, "yes")
    assert pd.isna(row["truth"])
    assert pd.isna(row["truth_db"])


LARGE, SMALL = (f"mip-NeRF 360, c = {c}" for c in (4096, 1024))


@pytest.mark.parametrize(
    ("number", "keys", "paper"),
    [
        (1, {"effect": "large model, warped once"}, (0.40, 0.10, 3.272, 1.0)),
        (1, {"effect": "large over small model"}, (0.43, 0.40, 4.0, 14.06)),
        (1, {"effect": "AligNeRF over warped once"}, (0.01, 0.0, 0.306, 1.051)),
        (2, {"effect": "AligNeRF", "group": "1x"}, (0.19, 0.13, 1.035, 1.051)),
        (2, {"effect": "AligNeRF", "group": "4x"}, (0.39, 0.28, 1.033, np.nan)),
        # Of these it prints no warped test set.
        (2, {"effect": "NeRF", "group": "1x"}, (np.nan, -2.27, 0.605, 0.152)),
        (4, {"effect": "+ alignment"}, (0.25, 0.10, 1.007, 1.0)),
        (4, {"effect": "all three"}, (0.55, 0.38, 1.033, 1.051)),
    ],
)
def test_the_papers_gains_are_those_of_its_tables(number, keys, paper):
    row = one(of_table([scene_of({PLAIN: 0.0})], number), **keys)
    names = [f"paper_{name}" for name in ("warped_db", "standard_db")]
    names += ["paper_times", "paper_params_times"]
    found = [row[name] for name in names]
    np.testing.assert_allclose(found, paper, atol=1e-3)
    assert row["reproduced"] == "not tested"


def test_metrics_of_the_paper_are_of_its_warped_test_set_where_it_has_one():
    table = of_table([scene_of({PLAIN: 0.0})], 2)
    row = one(table, effect="AligNeRF", group="1x")
    assert row["paper_ssim"] == pytest.approx(0.700 - 0.693)
    assert row["paper_lpips"] == pytest.approx(0.340 - 0.349)
    row = one(table, effect="mip-NeRF", group="1x")
    assert row["paper_ssim"] == pytest.approx(0.484 - 0.644)


def test_rounds_and_lengths_are_rows_of_their_own():
    rows = {
        ("big", 0, LARGE): 2.0,
        ("small", 0, SMALL): 0.0,
        ("big", 1, LARGE): 2.5,
        # Two of ours stand for one of the paper's.
        ("printed", 0, "AligNeRF, c = 1024"): -1.0,
        ("aligned", 0, "AligNeRF, c = 1024"): 1.0,
    }
    scenes = [
        scene_of(rows, seed=seed, share=share) for seed in range(3) for share in (1, 4)
    ]
    for scene in scenes:
        scene["scene"] += "_x" + scene["share"].astype(str)
    table = of_table(scenes, 1)
    row = one(table, effect="large model, warped once", group="4x")
    assert (row["method"], row["over"]) == ("big, warped once", "big")
    assert row["truth_db"] == 0.5
    words = table[(table["effect"] == "AligNeRF") & (table["group"] == "1x")]
    assert dict(zip(words["method"], words["reproduced"], strict=True)) == {
        "printed": "no: the opposite",
        "aligned": "yes",
    }
    # A tenth of the parameters, where the paper's large model has 14 times as many.
    assert (
        one(table, effect="large over small model", group="1x")["params_times"] == 0.1
    )
    assert one(table, effect="AligNeRF over warped once")["reproduced"] == "not tested"


@pytest.mark.parametrize(
    ("gain", "word"), [(1.0, "yes: above"), (-0.09, "yes: level"), (-0.2, "no: below")]
)
def test_where_the_papers_rows_are_level_ours_are_unless_below(gain, word):
    rows = {("small", 1, SMALL): 0.0, ("ours", 0, "AligNeRF, c = 1024"): gain}
    table = of_table([scene_of(rows, seed=seed) for seed in range(3)], 1)
    assert one(table, effect="AligNeRF over warped once")["reproduced"] == word


def test_models_of_one_size_test_no_larger_model():
    scenes = [
        scene_of({("b", 0, LARGE): 1.0, ("s", 0, SMALL): 0.0}, seed=seed).assign(
            params=7
        )
        for seed in range(3)
    ]
    row = one(of_table(scenes, 1), effect="large over small model")
    assert row["reproduced"] == "not tested: models of one size"


def test_of_a_table_with_lengths_each_has_the_papers_of_its_own():
    rows = {("m", 0, "mip-NeRF 360"): 0.0, ("a", 0, "AligNeRF"): 1.0}
    table = of_table([scene_of(rows, seed=seed, share=4) for seed in range(3)], 2)
    assert one(table, effect="AligNeRF", group="4x")["reproduced"] == "yes"
    assert one(table, effect="AligNeRF", group="1x")["reproduced"] == "not tested"
