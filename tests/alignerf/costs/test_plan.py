"""What there is to train and measured rates, to seconds, memory and disk."""

import json

import pytest

from alignerf.costs import __main__ as command
from alignerf.costs import plan, summary
from alignerf.experiment.steps import trainings

RATES = plan.Rates(start_s=5.0, compile_s=3.0, step_s=0.1, params=1000, peak_bytes=600)
FLOW = plan.Flow(start_s=0.5, view_s=0.2, view_bytes=990)
VIEWS = plan.Views(train=20, test=4, pixels=1000, image_bytes=100, side=30)
BEGIN_S = RATES.start_s + RATES.compile_s + plan.JOB_S


def planned(experiment, views=VIEWS):
    """(work, {training: its tasks}) of courtyard."""
    work = plan.of_scene(experiment, "courtyard")
    rates = {
        one["name"]: plan.Rates() if one["external"] else RATES
        for one in work["trainings"]
    }
    return work, plan.tasks_of(work, rates, FLOW, views, threads=1)


def by_file(tasks):
    return {task.file: task for own in tasks.values() for task in own}


def test_work_lists_what_is_trained_in_an_order_that_runs(demo, experiment_of):
    demo["methods"] = {
        "once": {"model": "base", "rounds": 1},
        "moved": {"model": "base", "rounds": 1, "changes": "cameras"},
        "warm": {"model": "base", "rounds": 1, "warm_start": {"from": "once"}},
        "alignerf": {"model": "base", "alignerf": {}},
        "corrected": {"model": "large", "alignerf": {}, "changes": "cameras"},
        "auto": {"model": "large", "rounds": "auto", "max_rounds": 3},
    }
    found = plan.of_scene(experiment_of(demo), "courtyard")["trainings"]
    after = {one["name"]: one["after"] for one in found}
    assert after == {
        "pretrain/base": [],
        "pretrain/large": [],
        "once/round0": [],
        "once/round1": ["once/round0"],
        "moved/round1": ["once/round0"],
        "warm/round1": ["once/round0"],
        "alignerf/round0": ["pretrain/base"],
        "corrected/round0": after["corrected/round0"],
        "auto/round0": [],
        **{f"auto/round{k}": [f"auto/round{k - 1}"] for k in (1, 2, 3)},
    }
    seen = set()
    for one in found:
        assert seen >= set(one["after"]), one["name"]
        seen.add(one["name"])
    splits = {one["name"]: one["splits"] for one in found}
    assert splits["pretrain/large"] == ["train"]
    assert splits["pretrain/base"] == []
    assert splits["once/round0"] == ["train", "test"]
    assert splits["once/round1"] == ["test"]


def test_a_training_takes_its_steps_or_its_minutes(demo, experiment_of):
    _, tasks = planned(experiment_of(demo))
    found = by_file(tasks)
    plain = found["mipnerf360/round0/timing.json"]
    assert plain.seconds == pytest.approx(BEGIN_S + 2000 * 0.1)
    assert plain.new_bytes >= 16 * RATES.params
    # A ray without gradients takes a third of one with them.
    rays = 24 * VIEWS.pixels
    render = found["mipnerf360/round0/render"]
    assert render.seconds == pytest.approx(BEGIN_S + rays * 0.1 / 512 / 3, abs=0.01)
    demo["training"] = {"budget_min": 3}
    _, tasks = planned(experiment_of(demo))
    found = by_file(tasks)
    minutes = BEGIN_S + 180
    assert found["mipnerf360/round0/timing.json"].seconds == pytest.approx(minutes)
    # Pre-training and fine-tuning share the minutes.
    stages = ("pretrain/base/timing.json", "alignerf/round0/timing.json")
    assert sum(found[name].seconds for name in stages) < 1.5 * minutes


def test_one_way_is_gone_whatever_cores_there_are(demo, experiment_of):
    work, tasks = planned(experiment_of(demo))
    every = [task.seconds for own in tasks.values() for task in own]
    assert len(by_file(tasks)) == len(every)
    one, two, many = (plan.wall_s(work, tasks, cores) for cores in (1, 2, 64))
    assert one == pytest.approx(sum(every))
    assert one / 2 <= two < one
    rounds = [f"mipnerf360/round{k}" for k in range(3)]
    way_s = sum(task.seconds for name in [*rounds, ""] for task in tasks[name])
    assert way_s <= many < two


def test_rules_ask_for_what_a_plan_names(demo, experiment_of):
    """Memory and minutes of a job are those of the task with its output."""
    asked = {trainings.TIMING, trainings.RENDERED, trainings.MOVED}
    files = by_file(planned(experiment_of(demo))[1]).keys()
    for training in ("mipnerf360/round0", "aligned/round0", "alignerf/round0"):
        assert {name.format(training=training) for name in asked} <= files


def test_trainings_of_one_program_are_timed_once(demo, experiment_of):
    work, _ = planned(experiment_of(demo))
    programs = {
        one["name"]: plan.program_of(plan.job_of(one)) for one in work["trainings"]
    }
    same = ("mipnerf360/round0", "mipnerf360/round2", "pretrain/base", "aligned/round0")
    assert len({programs[name] for name in same}) == 1
    assert len(set(programs.values())) == 3


def test_memory_is_that_of_what_runs_at_once(demo, experiment_of):
    # Photos as taken beside others, and small images, of the one that aligns itself.
    more = (3 + plan.ALIGNED_BYTES) * VIEWS.train * VIEWS.pixels + plan.ALIGNER_BYTES
    work, tasks = planned(experiment_of(demo))
    assert plan.peak_bytes(work, tasks, 1) == RATES.peak_bytes + more
    assert plan.peak_bytes(work, tasks, 2) == 2 * RATES.peak_bytes + more
    # Round upon round, nothing else trains meanwhile.
    demo["methods"] = {"mipnerf360": {"model": "base", "rounds": 2}}
    assert plan.peak_bytes(*planned(experiment_of(demo)), 2) == RATES.peak_bytes


def test_alignments_cost_what_their_looks_at_small_renders_cost(demo, experiment_of):
    """Twice as small, a quarter; no smaller than a flow can be taken of."""

    def seconds(side, **changes):
        demo["methods"]["aligned"]["align"] = changes
        views = VIEWS._replace(side=side, pixels=10**6)
        found = by_file(planned(experiment_of(demo), views)[1])
        names = ("aligned/round0/timing.json", "mipnerf360/round0/timing.json")
        aligned, plain = (found[name].seconds for name in names)
        return aligned - plain - RATES.compile_s

    looks = [seconds(1000, shrink=k) for k in (1, 2)]
    assert looks[0] == pytest.approx(4 * looks[1], abs=0.1)
    assert seconds(100, shrink=8) == seconds(100, shrink=2)
    places = {"cameras_at": [0.2, 0.4, 0.6, 0.8], "photos_at": [0.8]}
    assert seconds(1000, shrink=2, **places) == pytest.approx(2 * looks[1], abs=0.1)


def test_crops_are_counted_with_the_scene_that_they_judge(demo, experiment_of):
    demo["methods"] = {"plain": {}, "aligned": {"align": {}}}
    without = by_file(planned(experiment_of(demo))[1])
    asked = {"crops": {"px": 64, "count": 2, "steps": 500}}
    experiment = experiment_of(demo | asked)
    names = experiment.crops("courtyard")
    work, tasks = planned(experiment)
    found = by_file(tasks)
    places = [f"../{name}/plain/round0" for name in names]
    outputs = ("timing.json", "render", "displacement")
    new = {f"{place}/{output}" for place in places for output in outputs}
    assert found.keys() - without.keys() == new
    train = found[f"{places[0]}/timing.json"]
    assert train.seconds == pytest.approx(BEGIN_S + 500 * RATES.step_s)
    # The second has the cameras that the aligned training has corrected.
    assert work["trainings"][-1]["after"] == ["aligned/round0"]
    rays = 2 * 24 * 64**2
    rendered_s = BEGIN_S + rays * RATES.step_s / 512 / 3
    assert found[f"{places[0]}/render"].seconds == pytest.approx(rendered_s, abs=0.01)


def test_crops_have_their_own_steps_whatever_the_budget(demo, experiment_of):
    demo["methods"], demo["crops"] = {"plain": {}}, {"steps": 500}
    demo["training"] = {"budget_min": 3}
    work, tasks = planned(experiment_of(demo))
    train = by_file(tasks)[f"{work['trainings'][-1]['name']}/timing.json"]
    assert train.seconds == pytest.approx(BEGIN_S + 500 * RATES.step_s)


def content(**changes):
    tasks = [
        plan.Task("train", "a", 900.0, threads=2),
        plan.Task("flow", "b", 900.0),
        plan.Task("rest", "c", 900.0),
    ]
    return {
        "scene": "yard",
        "cores": 2,
        "parallel_jobs": 2,
        "external": [],
        "wall_s": 1800.0,
        "memory_bytes": 1.4e9,
        "memory_free_bytes": 15e9,
        "disk_bytes": 0.6e9,
        "disk_free_bytes": 20e9,
        "tasks": [task._asdict() for task in tasks],
    } | changes


@pytest.fixture
def read(tmp_path):
    """A function that reads a plan with changes."""

    def read(**changes):
        (tmp_path / "preflight.json").write_text(json.dumps(content(**changes)))
        return summary.read(tmp_path / "preflight.json")

    return read


# A facade: 25 photos of 1536x1024, 0.1 s for 512 rays, and a budget of two minutes.
FACADE = VIEWS._replace(train=20, test=5, pixels=1536 * 1024)


def lengths(demo, experiment_of, **training):
    demo["training"] = training
    experiment = experiment_of(demo)
    work = plan.of_scene(experiment, "courtyard")
    rates = dict.fromkeys([one["name"] for one in work["trainings"]], RATES)
    return plan.length_of(work, rates, FACADE)


def test_the_least_budget_for_a_verdict_serves_and_less_does_not(demo, experiment_of):
    found = lengths(demo, experiment_of, budget_min=2)
    assert found["epochs"] == pytest.approx(1200 * 512 / FACADE.pixels / 20, rel=0.01)
    assert found["budget_min"] == 2
    for key, epochs in (("least_min", 0.25), ("enough_min", 0.5)):
        again = lengths(demo, experiment_of, budget_min=found[key])
        assert epochs < again["epochs"] < 1.5 * epochs
    by_steps = lengths(demo, experiment_of, steps=1200)
    assert by_steps["epochs"] == pytest.approx(found["epochs"], rel=0.01)


def test_a_budget_without_a_verdict_is_refused_with_the_least_that_serves(
    demo, experiment_of, read
):
    short = read(length=lengths(demo, experiment_of, budget_min=2))
    with pytest.raises(ValueError, match=r"of 2 min .* --budget-min 31 .* 62 are enou"):
        summary.check(short)
    assert "too short a training" in "".join(summary.lines(short))
    enough = read(length=lengths(demo, experiment_of, budget_min=62))
    summary.check(enough)
    said = "".join(summary.lines(enough))
    assert "62 min are of each training; all else comes on top" in said
    # Steps are as a config has them; it is said.
    by_steps = read(length=lengths(demo, experiment_of, steps=300))
    summary.check(by_steps)
    assert "too short a training" in "".join(summary.lines(by_steps))


def test_of_another_program_only_what_we_do_ourselves_is_counted(demo, experiment_of):
    commands = {"train": "theirs {data}", "render": "theirs {renders}"}
    demo["methods"] = {
        "theirs": {"rounds": 1, "changes": "cameras", "external": commands},
        "ours": {"model": "base"},
    }
    demo["reference"] = {"method": "theirs"}
    _, tasks = planned(experiment_of(demo))
    found = by_file(tasks)
    assert found["theirs/round0/timing.json"].seconds == plan.JOB_S
    assert found["theirs/round0/timing.json"].peak_bytes == 0
    assert found["theirs/round0/displacement"].seconds > FLOW.view_s
    moved = {file for file in found if "aligned_pose" in file}
    assert moved == {"ours/round0/metrics_aligned_pose.csv"}


def test_a_plan_that_does_not_fit_is_refused_with_what_to_change(read):
    summary.check(read())
    with pytest.raises(ValueError, match=r"14\.5 GB of memory.*15\.0 GB.*--cores 1"):
        summary.check(read(memory_bytes=14.5e9))
    with pytest.raises(ValueError, match="smaller model"):
        summary.check(read(memory_bytes=14.5e9, parallel_jobs=1))
    with pytest.raises(ValueError, match=r"30\.0 GB of disk.*downscale.*rounds"):
        summary.check(read(disk_bytes=30e9))


def test_what_is_said_of_a_plan(read):
    first, second = summary.lines(read())
    assert first.startswith("yard: about 30 min on 2 cores: trainings 15 min")
    assert second.endswith("memory 1.4 GB of 15.0 GB free; disk 0.6 GB of 20.0 GB free")
    assert "budget_min" in summary.lines(read(wall_s=9e4))[-1]
    names = [f"theirs/round{k}" for k in range(5)]
    line = summary.lines(read(external=names))[2]
    assert "theirs/round0, theirs/round1, theirs/round2 and 2 more" in line


def test_what_is_left_of_all_scenes(tmp_path, monkeypatch):
    yard, other = tmp_path / "yard", tmp_path / "other"
    monkeypatch.delenv(summary.SCENES, raising=False)

    def left(share=0.0):
        return summary.Left(yard, yard / "a").words(share)

    assert left() == ""
    yard.mkdir()
    (yard / "preflight.json").write_text(json.dumps(content()))
    assert left() == "all: 30 min left of 30 min"
    assert left(share=0.5) == "all: 22 min left of 30 min"
    # Another plan's job.
    assert summary.Left(yard, yard / "other" / "a").words() == ""
    (yard / "a").touch()
    (yard / "c").touch()
    assert left(share=1.0) == "all: 8 min left of 30 min"
    other.mkdir()
    (other / "preflight.json").write_text(json.dumps(content(scene="other")))
    assert left(share=1.0) == "all: 8 min left of 30 min"
    monkeypatch.setenv(summary.SCENES, "yard\nother\nlater")
    assert left(share=1.0) == "all: 38 min left of 60 min"
    nonsense = json.dumps(content()).replace("900", "NaN")
    for damaged in ("{}", "[", '{"tasks": 3}', "[1]", "[" * 10**5, nonsense):
        (other / "preflight.json").write_text(damaged)
        (yard / "preflight.json").write_text(damaged)
        assert left() == ""


def test_plans_are_asked_for_rarely(tmp_path, monkeypatch):
    clock, calls = [0.0], []
    monkeypatch.setattr(summary.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(summary, "seconds_left", lambda *args: calls.append(args))
    left = summary.Left(tmp_path, tmp_path / "a.json")
    for clock[0] in (0.0, 20.0, 50.0, 70.0):
        assert left.words() == ""
    assert len(calls) == 2


@pytest.mark.parametrize("damaged", ["", "[1]", '{"a": 1}', '{"scene": "s"}'])
def test_a_file_that_is_no_preflight_is_named(tmp_path, damaged):
    path = tmp_path / "preflight.json"
    path.write_text(damaged)
    with pytest.raises(ValueError, match=r"preflight\.json: not "):
        command.main(["--show", str(path)])
