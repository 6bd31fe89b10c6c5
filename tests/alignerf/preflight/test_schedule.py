"""Work and measured rates to seconds, memory and disk; and what is left of it."""

import json
import os
import re

import pytest

from alignerf.experiment import layout
from alignerf.experiment.cluster import work as work_of
from alignerf.preflight import __main__ as command
from alignerf.preflight import eta, fit, schedule, simulate

RATES = schedule.Rates(
    start_s=5.0,
    compile_s=3.0,
    step_s=0.1,
    params=1000,
    peak_bytes=600,
    render_start_s=4.0,
    render_compile_s=2.0,
    pixel_s=1e-4,
    render_peak_bytes=400,
)
FLOW = schedule.Flow(start_s=0.5, view_s=0.2, flow_bytes=900, warped_bytes=90)
VIEWS = schedule.Views(train=20, test=4, pixels=1000, image_bytes=100)


@pytest.fixture
def demo(demo):
    """The default config, its cost asked for."""
    return demo | {"preflight": True}


def task(name, seconds, *after, threads=1):
    return simulate.Task(name, "train", seconds, threads, list(after), f"{name}.json")


def tasks_of(experiment, scene="courtyard", rates=RATES):
    work = work_of.of_scene(experiment, scene)
    rates = [rates] * len(work["trainings"])
    return schedule.tasks_of(work, rates, FLOW, VIEWS, threads=1)


def named(tasks):
    return {task.name: task for task in tasks}


@pytest.mark.parametrize(
    ("cores", "wanted_s"), [(1, 60.0), (2, 40.0), (3, 30.0), (64, 30.0)]
)
def test_tasks_wait_for_each_other_and_for_cores(cores, wanted_s):
    chain = [task("a", 10.0), task("b", 10.0, "a"), task("c", 10.0, "b")]
    others = [task(name, 10.0) for name in "def"]
    wanted_s = {2: 30.0}.get(cores, wanted_s)
    assert simulate.wall_s([*chain, *others], cores) == wanted_s


def test_a_task_of_many_threads_takes_all_that_there_are():
    tasks = [task("a", 3.0, threads=4), task("b", 3.0, threads=4)]
    assert simulate.wall_s(tasks, 8) == 3.0
    assert simulate.wall_s(tasks, 4) == simulate.wall_s(tasks, 2) == 6.0
    # What is not among the tasks is done.
    assert simulate.wall_s([task("a", 3.0, "before")], 1) == 3.0
    assert simulate.wall_s([], 1) == 0.0
    with pytest.raises(ValueError, match="wait for each other"):
        simulate.wall_s([task("a", 1.0, "b"), task("b", 1.0, "a")], 1)


def test_work_lists_what_is_trained_in_an_order_that_runs(demo, experiment_of):
    demo["methods"] = {
        "once": {"model": "base", "rounds": 1},
        "moved": {"model": "base", "rounds": 1, "changes": "cameras"},
        "warm": {"model": "base", "rounds": 1, "warm_start": {"from": "once"}},
        "alignerf": {"model": "base", "alignerf": {"radius_px": "auto"}},
        "corrected": {"model": "large", "alignerf": {}, "changes": "cameras"},
        "auto": {"model": "large", "rounds": "auto", "most_rounds": 3},
    }
    demo["methods"]["alignerf"]["alignerf"]["radius_px"] = "auto"
    found = work_of.of_scene(experiment_of(demo), "courtyard")["trainings"]
    after = {one["name"]: one["after"] for one in found}
    assert after == {
        "pretrain/base": [],
        "pretrain/large": [],
        "once/round0": [],
        "once/round1": ["once/round0"],
        "moved/round1": ["once/round0"],
        "warm/round1": ["once/round0"],
        "alignerf/round0": ["pretrain/base", "once/round0"],
        "corrected/round0": after["corrected/round0"],
        "auto/round0": [],
        **{f"auto/round{k}": [f"auto/round{k - 1}"] for k in (1, 2, 3)},
    }
    seen = set()
    for one in found:
        assert seen >= set(one["after"]), one["name"]
        seen.add(one["name"])
    of = {one["name"]: one for one in found}
    assert of["pretrain/large"]["renders"] == ["train"]
    assert of["pretrain/base"]["renders"] == []
    assert of["once/round0"]["renders"] == ["train", "test"]
    assert of["once/round1"]["renders"] == ["test"]
    assert of["moved/round1"]["corrects"]
    assert of["corrected/round0"]["corrects"]
    assert not of["once/round1"]["corrects"]


def test_a_training_takes_its_steps_or_its_minutes(demo, experiment_of):
    found = named(tasks_of(experiment_of(demo)))
    plain = found["mipnerf360/round0/train"]
    assert plain.seconds == pytest.approx(8.0 + 2000 * 0.1 + schedule.JOB_S)
    assert plain.new_bytes >= 16 * RATES.params
    assert found["mipnerf360/round1/train"].after == ["mipnerf360/round0/flow"]
    pixels = 24 * VIEWS.pixels
    render = found["mipnerf360/round0/render"]
    assert render.seconds == pytest.approx(6.0 + pixels * 1e-4 + schedule.JOB_S)
    assert render.after == [plain.name]
    demo["training"] = {"budget_min": 3}
    found = named(tasks_of(experiment_of(demo)))
    assert found["mipnerf360/round0/train"].seconds == pytest.approx(
        188.0 + schedule.JOB_S
    )
    # Pre-training and fine-tuning share the minutes.
    stages = ("pretrain/base/flow", "alignerf/round0/train")
    assert sum(found[name].seconds for name in stages) < 1.5 * 188.0


def test_every_task_waits_for_tasks_and_ends(demo, experiment_of):
    tasks = tasks_of(experiment_of(demo))
    names = set(named(tasks))
    assert len(names) == len(tasks)
    assert all(names >= set(task.after) for task in tasks)
    assert len({task.file for task in tasks}) == len(tasks)
    one, two = (simulate.wall_s(tasks, cores) for cores in (1, 2))
    assert one == pytest.approx(sum(task.seconds for task in tasks))
    assert one / 2 <= two < one


def test_rules_ask_for_what_a_plan_names(demo, experiment_of, root):
    """Memory and minutes of a job are those of the task that ends with its file."""
    text = "".join(p.read_text() for p in (root / "workflow/rules").glob("*.smk"))
    asked = set(re.findall(r'needs\.\w+\(costs, "(.+)"\)', text))
    assert len(asked) == 3
    files = [task.file for task in tasks_of(experiment_of(demo))]
    # A rule names the folder of what it writes for each split.
    outputs = {layout.output_of(f"results/{file}") for file in files}
    for training in ("mipnerf360/round0", "aligned/round0", "alignerf/round0"):
        names = {f"results/{name.format(training=training)}" for name in asked}
        assert names <= outputs


def test_trainings_of_one_program_are_timed_once(demo, experiment_of):
    work = work_of.of_scene(experiment_of(demo), "courtyard")
    programs = {
        one["name"]: json.dumps(schedule.program_of(one["job"]), sort_keys=True)
        for one in work["trainings"]
    }
    same = ("mipnerf360/round0", "mipnerf360/round2", "pretrain/base")
    assert len({programs[name] for name in same}) == 1
    assert len(set(programs.values())) == 3


def test_memory_is_that_of_what_runs_at_once(demo, experiment_of):
    # Photos as taken beside others, and small images, of the one that aligns itself.
    more = int((3 + schedule.ALIGNED_BYTES) * VIEWS.train * VIEWS.pixels)
    tasks = tasks_of(experiment_of(demo))
    assert simulate.peak_bytes(tasks, 1) == RATES.peak_bytes + more
    assert simulate.peak_bytes(tasks, 2) == 2 * RATES.peak_bytes + more
    del demo["methods"]["aligned"]
    tasks = tasks_of(experiment_of(demo))
    assert simulate.peak_bytes(tasks, 1) == RATES.peak_bytes
    assert simulate.peak_bytes(tasks, 2) == 2 * RATES.peak_bytes
    # Round upon round, nothing else trains meanwhile.
    demo["methods"] = {"mipnerf360": {"model": "base", "rounds": 2}}
    tasks = tasks_of(experiment_of(demo))
    assert simulate.peak_bytes(tasks, 2) <= RATES.peak_bytes + RATES.render_peak_bytes
    assert simulate.peak_bytes([], 2) == 0


def test_alignments_cost_what_their_looks_at_small_renders_cost(demo, experiment_of):
    """Twice as small, a quarter; no smaller than a flow can be taken of."""

    def seconds(side, **changes):
        demo["methods"]["aligned"]["align"] = changes
        work = work_of.of_scene(experiment_of(demo), "courtyard")
        rates = [RATES] * len(work["trainings"])
        views = VIEWS._replace(side=side, pixels=10**6)
        tasks = schedule.tasks_of(work, rates, FLOW, views, threads=1)
        found = named(tasks)
        plain = found["mipnerf360/round0/train"]
        return found["aligned/round0/train"].seconds - plain.seconds

    looks = [seconds(1000, shrink=k) - RATES.render_compile_s for k in (1, 2)]
    assert looks[0] == pytest.approx(4 * looks[1])
    assert seconds(100, shrink=8) == seconds(100, shrink=2)
    places = {"cameras_at": [0.2, 0.4, 0.6, 0.8], "photos_at": [0.8]}
    four = seconds(1000, shrink=2, **places) - RATES.render_compile_s
    assert four == pytest.approx(2 * looks[1])


def plan(**changes):
    found = {
        "scene": "yard",
        "cores": 2,
        "lanes": 2,
        "wall_s": 1980.0,
        "memory_bytes": 1.4e9,
        "memory_free_bytes": 15e9,
        "disk_bytes": 0.6e9,
        "disk_free_bytes": 20e9,
        "tasks": [
            task("a", 900.0)._asdict(),
            task("b", 900.0, "a")._asdict() | {"kind": "flow"},
            task("c", 1080.0)._asdict() | {"kind": "rest"},
        ],
    }
    return found | changes


def test_a_plan_that_does_not_fit_is_refused_with_what_to_change():
    fit.check(plan())
    with pytest.raises(ValueError, match=r"14\.5 GB of memory.*15\.0 GB.*--cores 1"):
        fit.check(plan(memory_bytes=14.5e9))
    with pytest.raises(ValueError, match="smaller model"):
        fit.check(plan(memory_bytes=14.5e9, lanes=1))
    with pytest.raises(ValueError, match=r"30\.0 GB of disk.*downscale.*rounds"):
        fit.check(plan(disk_bytes=30e9))


def test_what_is_said_of_a_plan():
    first, second = fit.lines(plan(), "yard")
    assert first == (
        "yard: about 33 min on 2 cores: 1 training 15 min, flow 15 min, the rest 18 min"
    )
    assert second.endswith("memory 1.4 GB of 15.0 GB free; disk 0.6 GB of 20.0 GB free")
    assert "budget_min" in fit.lines(plan(wall_s=9e4), "yard")[-1]


def test_what_is_left_of_all_scenes(tmp_path, monkeypatch):
    yard, other = tmp_path / "yard", tmp_path / "other"
    monkeypatch.delenv(eta.SCENES, raising=False)

    def left(share=0.0):
        return eta.Left(yard, yard / "a.json").words(share)

    assert left() == ""
    yard.mkdir()
    (yard / "preflight.json").write_text(json.dumps(plan()))
    # a then b on one core, c on the other.
    assert left() == "all: 30 min left of 30 min"
    assert left(share=0.5) == "all: 22 min left of 30 min"
    # Another plan's job.
    assert eta.Left(yard, yard / "other" / "a.json").words() == ""
    (yard / "a.json").touch()
    (yard / "c.json").touch()
    assert left(share=1.0) == "all: 15 min left of 30 min"
    other.mkdir()
    (other / "preflight.json").write_text(json.dumps(plan(scene="other")))
    assert left(share=1.0) == "all: 15 min left of 30 min"
    monkeypatch.setenv(eta.SCENES, "yard\nother\nlater")
    assert left(share=1.0) == "all: 33 min left of 48 min"
    nonsense = json.dumps(plan()).replace("900", "NaN")
    for content in ("{}", "[", '{"tasks": 3}', "[1]", "[" * 10**5, nonsense):
        (other / "preflight.json").write_text(content)
        (yard / "preflight.json").write_text(content)
        assert left() == ""
    assert os.environ[eta.SCENES]


def test_plans_of_many_scenes_are_asked_for_rarely(tmp_path, monkeypatch):
    clock, calls = [0.0], []

    def slow(*args):
        clock[0] += 3.0
        calls.append(args)
        return "all: soon"

    monkeypatch.setattr(eta.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(eta, "text_of", slow)
    left = eta.Left(tmp_path, tmp_path / "a.json")
    for clock[0] in (0.0, 20.0, 250.0, 310.0):
        assert left.words() == "all: soon"
    assert len(calls) == 2


@pytest.mark.parametrize("content", ["", "[1]", '{"a": 1}', '{"scene": "s"}'])
def test_a_file_that_is_no_preflight_is_named(tmp_path, content):
    path = tmp_path / "preflight.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=r"preflight\.json: not "):
        command.main(["--show", str(path)])


def test_windows_are_counted_with_the_scene_that_they_judge(demo, experiment_of):
    demo["methods"] = {"plain": {}, "aligned": {"align": {}}}
    without = tasks_of(experiment_of(demo))
    asked = {"windows": {"px": 64, "count": 2, "steps": 500}}
    experiment = experiment_of(demo | asked)
    names = experiment.windows("courtyard")
    assert [work_of.of_scene(experiment, name) for name in names] == [None, None]
    tasks = named(tasks_of(experiment))
    new = tasks.keys() - named(without).keys()
    places = [f"../{name}/plain/round0" for name in names]
    assert new == {
        f"{p}/{kind}" for p in places for kind in ("train", "render", "flow")
    }
    train = tasks[f"{places[0]}/train"]
    length_s = RATES.start_s + RATES.compile_s + 500 * RATES.step_s
    assert train.seconds == pytest.approx(length_s + schedule.JOB_S)
    # The second has the cameras that the aligned training has put right.
    assert tasks[f"{places[1]}/train"].after == ["aligned/round0/flow"]
    render = tasks[f"{places[0]}/render"]
    pixels = 2 * (VIEWS.train + VIEWS.test) * 64**2
    rendered_s = schedule.render_s(RATES, pixels)
    assert render.seconds == pytest.approx(rendered_s + schedule.JOB_S)
    assert train.file == f"../{names[0]}/plain/round0/timing.json"


def test_of_another_program_only_what_we_do_ourselves_is_counted(demo, experiment_of):
    commands = {"train": "theirs {data}", "render": "theirs {renders}"}
    demo["methods"] = {
        "theirs": {"rounds": 1, "changes": "cameras", "external": commands},
        "ours": {"model": "base"},
    }
    demo["reference"] = {"method": "theirs"}
    experiment = experiment_of(demo)
    work = work_of.of_scene(experiment, "courtyard")
    # They are not parsed as a job of ours.
    assert command.decided(work)["trainings"][0] == work["trainings"][0]
    # In the order of the work.
    rates = [
        schedule.UNKNOWN if one.get("external") else RATES for one in work["trainings"]
    ]
    found = named(schedule.tasks_of(work, rates, FLOW, VIEWS, threads=1))
    alone, after = (found[f"theirs/round{k}/train"] for k in (0, 1))
    assert alone.seconds == schedule.JOB_S
    assert after.seconds > schedule.JOB_S + FLOW.start_s
    assert after.after == ["theirs/round0/flow"]
    assert alone.peak_bytes == 0
    assert alone.new_bytes >= (VIEWS.train + VIEWS.test) * VIEWS.image_bytes
    assert found["theirs/round0/flow"].seconds > FLOW.view_s
    # Nothing waits for what is never made.
    assert {name for name in found if "aligned_pose" in name} == {
        "ours/round0/aligned_pose"
    }


def test_a_plan_says_what_it_does_not_count():
    names = [f"theirs/round{k}" for k in range(5)]
    (line,) = fit.unknown({"external": names})
    assert "theirs/round0, theirs/round1, theirs/round2 and 2 more" in line
    assert fit.unknown({"external": []}) == fit.unknown({}) == []
