"""Curves are read rightly, and `old` stays what it was."""

import csv
import json

import numpy as np
import pytest
from PIL import Image

from alignerf.experiment import jobs
from tests.bench import cases, curves, sooner, sooner_settings

# 20 dB after 1 s, 4 dB more with each factor of ten, then 1.
CURVE = [(1.0, 20.0), (10.0, 24.0), (100.0, 25.0)]


def point(setting, budget, seconds, psnr_db, *, scene="courtyard", seed=0):
    """A training of which only these matter."""
    return curves.Point(
        *(scene, setting, seed, budget, 10, 1000),
        *(seconds, 5.0, 2, "oracle", psnr_db),
    )


def budgets(setting, curve, **place):
    """The points of a curve, with the budgets of the benchmark."""
    return [
        point(setting, budget, *found, **place)
        for budget, found in zip((0.25, 1, 4), curve, strict=True)
    ]


@pytest.fixture(scope="module")
def quick(run_quick, tmp_path_factory):
    """Folder of all that `--quick` writes, and what it prints."""
    folder = tmp_path_factory.mktemp("sooner")
    return folder, run_quick(folder, ["sooner"])


def test_quality_is_linear_in_the_logarithm_of_the_seconds():
    assert curves.psnr_at(CURVE, 10**0.5) == pytest.approx(22)
    assert curves.psnr_at(CURVE, 10**1.5) == pytest.approx(24.5)
    assert [curves.psnr_at(CURVE, s) for s, _ in CURVE] == [20, 24, 25]
    assert curves.psnr_at(CURVE, 0.99) is curves.psnr_at(CURVE, 101) is None


def test_seconds_to_a_quality_are_those_of_the_first_crossing():
    assert curves.seconds_to(CURVE, 23) == pytest.approx(10**0.75)
    assert curves.seconds_to(CURVE, 25) == pytest.approx(100)
    assert curves.seconds_to(CURVE, 25.1) is None
    # A curve that begins above is no shorter than its shortest training.
    assert curves.seconds_to(CURVE, 19) == 1
    falling = [(1.0, 20.0), (10.0, 22.0), (100.0, 21.0), (1000.0, 23.0)]
    assert curves.seconds_to(falling, 21.5) == pytest.approx(10**0.75)
    assert curves.seconds_to(falling, 22.5) == pytest.approx(10**2.75)


def test_a_curve_goes_by_seconds_whatever_the_order_of_its_trainings():
    points = budgets("new", CURVE)
    assert curves.curve_of(reversed(points)) == CURVE


def test_new_is_held_to_old_with_medians_over_seeds_that_are_paired():
    points = []
    for seed, more_db in {0: 2.0, 2: 1.0, 3: 5.0}.items():
        # Every machine is as fast as it was in the same seed.
        slow = 1.0 + seed
        old = [(slow * s, db) for s, db in CURVE]
        new = [(0.5 * s, db + more_db) for s, db in old]
        points += budgets("old", old, seed=seed) + budgets("new", new, seed=seed)
    rows = {row.what: row for row in sooner.comparisons(points)}
    gain, same, best = rows.values()
    # Its own 1 x takes fewer seconds: no interpolation.
    assert (gain.ours.median, gain.ours.low, gain.ours.high) == (2, 1, 5)
    assert gain.goal.met(gain) is True
    # 22 to 26 dB: 24 dB after 10^0.5 s of 10, with 1 dB more after 10^0.75.
    assert same.ours.median == pytest.approx(0.5 * 10**-0.5)
    assert same.ours.high == pytest.approx(0.5 * 10**-0.25)
    assert same.ours.low == pytest.approx(0.5 * 10**-1)
    assert same.note == "seed 3: at most"
    assert best.ours.median == pytest.approx(0.5 * 10**-1.25)
    assert best.goal.met(best) is True


def test_a_slower_new_is_read_off_its_curve_at_the_seconds_of_old():
    slower = [(1.2 * s, db + 1) for s, db in CURVE]
    rows = sooner.comparisons(budgets("old", CURVE) + budgets("new", slower))
    gain, same, best = rows
    assert gain.ours.median == pytest.approx(curves.psnr_at(slower, 10) - 24)
    assert 0 < gain.ours.median < 1
    assert gain.goal.met(gain) is False
    assert same.ours.median == pytest.approx(1.2 * 10**-0.25)
    assert best.ours.median == pytest.approx(1.2 * 10**-1)


def test_a_quality_that_one_seed_does_not_reach_leaves_the_row_empty():
    points = [
        *(budgets("old", CURVE) + budgets("new", CURVE)),
        *(budgets("old", CURVE, seed=2)),
        *(budgets("new", [(s, db - 1) for s, db in CURVE], seed=2)),
    ]
    best = list(sooner.comparisons(points))[2]
    assert best.ours is None
    assert best.goal.met(best) is None
    assert best.note == "seed 2: not reached: 24.00 of 25.00 dB"


def test_each_goal_stands_beside_the_row_it_is_of():
    points = []
    for scene, case in sooner_settings.CASES.items():
        for setting in ("new", *case.frozen):
            points += budgets(setting, [(s, db + 1) for s, db in CURVE], scene=scene)
    rows = [row for row in sooner.comparisons(points) if row.goal]
    assert sorted(row.what for row in rows) == [
        "courtyard, mlp_new: seconds to the dB of mlp_old's 1 x, of mlp_old's",
        "courtyard, new: dB above old in the seconds of its 1 x",
        "courtyard, new: seconds to the dB of old's 4 x, of old's",
        "fox, new: seconds to 25.2 dB, of old's 1 x",
    ]
    assert {row.what: row.goal.met(row) for row in rows} == {
        rows[0].what: False,
        rows[1].what: False,
        rows[2].what: True,
        rows[3].what: False,
    }


@pytest.mark.parametrize(
    "job",
    [job for case in sooner_settings.CASES.values() for job in case.frozen.values()],
)
def test_frozen_settings_leave_nothing_to_the_defaults(job):
    # A new key has to be frozen here at what the old code did.
    assert jobs.as_dict(jobs.parse(job)) == job


@pytest.mark.parametrize(("name", "config"), [("courtyard", "demo"), ("fox", None)])
def test_new_is_what_the_configs_say(name, config, demo, tmp_path):
    (tmp_path / "scenes/fox/images").mkdir(parents=True)
    experiment = sooner_settings.experiment_of(name, 3, tmp_path)
    found = sooner_settings.jobs_of(name, experiment, 3)
    assert next(iter(found)) == "old"
    assert {job["seed"] for job in found.values()} == {3}
    new = found["new"]
    jobs.parse(new)
    assert new["model"] == experiment.config["models"]["base"]
    assert new["training"] == experiment.config["training"]
    # The courtyard is another one by seed, fox is not.
    assert experiment.scenes[name]["seed"] == (3 if config else 0)
    if config:
        given = demo["models"]["base"]["field"]
        assert new["model"]["field"].items() >= given.items()


def test_a_budget_ends_the_schedule_with_the_steps():
    job = sooner_settings.with_budget(sooner_settings.PHOTOS_OLD, 0.25)
    assert job["training"]["steps"] == 500
    assert job["training"]["warmup_steps"] == 25
    assert jobs.parse(job).schedule_steps == 500


def test_the_command_knows_all_scenes():
    assert tuple(sooner_settings.CASES) == cases.SCENES


def test_quick_writes_rows_curves_and_a_figure(quick):
    folder, printed = quick
    found = json.loads((folder / "sooner.json").read_text())
    whats = [row["what"] for row in found["rows"]]
    assert whats == [
        "tiny, old, 1 x",
        "tiny, new, 1 x",
        "tiny, new: dB above old in the seconds of its 1 x",
        "tiny, new: seconds to the dB of old's 1 x, of old's",
    ]
    assert all(what in printed for what in whats)
    text = (folder / "sooner_curves.csv").read_text()
    trained = {row["setting"]: row for row in csv.DictReader(text.splitlines())}
    assert {name: row["steps"] for name, row in trained.items()} == {
        "old": "4",
        "new": "2",
    }
    for row in trained.values():
        assert int(row["rays_seen"]) == 16 * int(row["steps"])
        assert float(row["train_time_s"]) > 0
        assert float(row["compile_time_s"]) > 0
        assert 0 < float(row["psnr_db"]) < 30
    with Image.open(folder / "sooner.png") as figure:
        assert np.std(figure.convert("L")) > 1
