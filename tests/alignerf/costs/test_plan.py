"""What there is to train and measured rates, to minutes and memory."""

import pytest

from alignerf.costs import estimate

RATES = estimate.Rates(start_s=8.0, step_s=0.1, peak_bytes=600)
VIEWS = estimate.Views(train=20, test=4, pixels=1000)


def planned(experiment, views=VIEWS, cores=1):
    """(work, what is estimated) of courtyard."""
    work = estimate.of_scene(experiment, "courtyard")
    rates = {
        one["name"]: RATES if one["job"] else estimate.Rates()
        for one in work["trainings"]
    }
    return work, estimate.estimated(work, rates, views, cores, cores)


def seconds(work, name):
    (one,) = (one for one in work["trainings"] if one["name"] == name)
    return estimate.seconds_of(one, RATES, VIEWS)


def test_work_lists_what_is_trained_in_an_order_that_runs(demo, experiment_of):
    demo["methods"] = {
        "once": {"model": "base", "rounds": 1},
        "moved": {"model": "base", "rounds": 1, "changes": "cameras"},
        "alignerf": {"model": "base", "alignerf": {}},
    }
    found = estimate.of_scene(experiment_of(demo), "courtyard")["trainings"]
    after = {one["name"]: one["after"] for one in found}
    assert after == {
        "pretrain/base": [],
        "once/round0": [],
        "once/round1": ["once/round0"],
        "moved/round1": ["once/round0"],
        "alignerf/round0": ["pretrain/base"],
    }
    seen = set()
    for one in found:
        assert seen >= set(one["after"]), one["name"]
        seen.add(one["name"])
    splits = {one["name"]: one["splits"] for one in found}
    assert splits["pretrain/base"] == []
    assert splits["once/round0"] == ["train", "test"]
    assert splits["once/round1"] == ["test"]


def test_a_training_takes_its_steps_or_its_minutes(demo, experiment_of):
    """And its renders; a ray without gradients takes a third of one with them."""
    rendered_s = 24 * VIEWS.pixels * 0.1 / 512 / 3
    work, _ = planned(experiment_of(demo))
    assert seconds(work, "mipnerf360/round0") == pytest.approx(
        2 * 8 + 2000 * 0.1 + rendered_s
    )
    demo["training"] = {"budget_min": 3}
    work, _ = planned(experiment_of(demo))
    assert seconds(work, "mipnerf360/round0") == pytest.approx(16 + 180 + rendered_s)


def test_one_way_is_gone_whatever_cores_there_are(demo, experiment_of):
    work, one = planned(experiment_of(demo))
    every = sum(seconds(work, name["name"]) for name in work["trainings"])
    assert one["wall_s"] == pytest.approx(every, abs=0.1)
    two, many = (planned(experiment_of(demo), cores=n)[1] for n in (2, 64))
    assert every / 2 <= two["wall_s"] + 0.1 < every
    way_s = sum(seconds(work, f"mipnerf360/round{k}") for k in range(3))
    assert way_s <= many["wall_s"] + 0.1 < two["wall_s"]


def test_trainings_of_one_program_are_timed_once(demo, experiment_of):
    work, _ = planned(experiment_of(demo))
    programs = {
        one["name"]: estimate.program_of(estimate.job_of(one))
        for one in work["trainings"]
    }
    same = ("mipnerf360/round0", "mipnerf360/round2", "pretrain/base", "aligned/round0")
    assert len({programs[name] for name in same}) == 1
    assert len(set(programs.values())) == 3


def test_memory_is_that_of_what_runs_at_once(demo, experiment_of):
    for cores in (1, 2):
        found = planned(experiment_of(demo), cores=cores)[1]
        assert found["memory_bytes"] == cores * RATES.peak_bytes
    # Round upon round, nothing else trains meanwhile.
    demo["methods"] = {"mipnerf360": {"model": "base", "rounds": 2}}
    found = planned(experiment_of(demo), cores=2)[1]
    assert found["memory_bytes"] == RATES.peak_bytes


def test_crops_are_counted_with_the_scene_that_they_judge(demo, experiment_of):
    demo["methods"] = {"plain": {}, "aligned": {"align": {}}}
    # Crops have their own steps whatever the budget.
    demo["training"] = {"budget_min": 3}
    asked = {"crops": {"px": 64, "count": 2, "steps": 500}}
    experiment = experiment_of(demo | asked)
    names = experiment.crops("courtyard")
    work, _ = planned(experiment)
    without, _ = planned(experiment_of(demo))
    new = [f"../{name}/plain/round0" for name in names]
    trained = [one["name"] for one in work["trainings"]]
    assert trained == [one["name"] for one in without["trainings"]] + new
    # The second has the cameras that the aligned training has corrected.
    assert work["trainings"][-1]["after"] == ["aligned/round0"]
    rendered_s = 2 * 24 * 64**2 * 0.1 / 512 / 3
    assert seconds(work, new[0]) == pytest.approx(16 + 500 * 0.1 + rendered_s)


# A facade: 25 photos of 1536x1024, 0.1 s for 512 rays, and a budget of two minutes.
FACADE = estimate.Views(train=20, test=5, pixels=1536 * 1024)


def lengths(demo, experiment_of, **training):
    demo["training"] = training
    return planned(experiment_of(demo), FACADE)[1]


def test_the_least_budget_for_a_verdict_serves_and_less_does_not(demo, experiment_of):
    found = lengths(demo, experiment_of, budget_min=2)
    length = found["length"]
    assert length["epochs"] == pytest.approx(1200 * 512 / FACADE.pixels / 20, rel=0.01)
    with pytest.raises(ValueError, match=r"of 2 min .* --budget-min 31 .* 62 are enou"):
        estimate.check("yard", found, 1e12, 1)
    for key, epochs in (("least_min", 0.25), ("enough_min", 0.5)):
        again = lengths(demo, experiment_of, budget_min=length[key])
        assert epochs < again["length"]["epochs"] < 1.5 * epochs
        estimate.check("yard", again, 1e12, 1)
    # Steps are as a config has them.
    estimate.check("yard", lengths(demo, experiment_of, steps=300), 1e12, 1)


def test_a_plan_that_does_not_fit_is_refused_with_what_to_change(demo, experiment_of):
    found = planned(experiment_of(demo))[1] | {"memory_bytes": 14.5e9}
    estimate.check("yard", found, 17e9, 2)
    with pytest.raises(ValueError, match=r"yard: .*14\.5 GB.*15\.0 GB.*--cores 1"):
        estimate.check("yard", found, 15e9, 2)
    with pytest.raises(ValueError, match="smaller model"):
        estimate.check("yard", found, 15e9, 1)


def test_other_programs_are_left_out_which_is_said(demo, experiment_of):
    assert "other programs" not in planned(experiment_of(demo))[1]["said"]
    commands = {"train": "theirs {data}", "render": "theirs {renders}"}
    demo["methods"] = {"theirs": {"rounds": 1, "external": commands}}
    demo["reference"] = {"method": "theirs"}
    found = planned(experiment_of(demo))[1]
    assert (found["wall_s"], found["memory_bytes"]) == (0, 0)
    assert found["said"].endswith("without those of other programs")
