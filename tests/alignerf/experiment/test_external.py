"""External methods: their trainings beside ours, and without any of ours."""

import copy
import re

import pytest

from alignerf import methods
from alignerf.experiment import check, plan, targets, trainings
from alignerf.experiment.steps import scenes
from alignerf.experiment.tables import rows
from tests import step_cases as cases

COMMANDS = {
    "train": "env A=1 /opt/ns/bin/ns-train nerfacto --data {data} --output-dir {model}",
    "render": "ns-render --load {model} --output {renders}",
}
SCENE = {"source": "courtyard", "poses": "truth"}


def config_of(methods, **more):
    return {"scenes": {"yard": SCENE}, "methods": methods} | more


def one(rounds=0, **keys):
    external = COMMANDS | {k: keys.pop(k) for k in ("gpu", "mem_mb") if k in keys}
    return {"external": external, "rounds": rounds} | keys


@pytest.fixture
def alone(experiment_of):
    """Two methods by the same commands, and one by others; none of ours."""
    other = one()
    other["external"] = other["external"] | {
        "train": "bash -c 'train.sh \"$0\"' {data}"
    }
    methods = {
        "moved": one(2, changes="cameras"),
        "warped": one(1, gpu=2),
        "other": other,
    }
    return experiment_of(config_of(methods))


def test_trainings_are_as_those_of_a_plain_method(alone):
    assert alone.names("ours", False) == ["moved", "warped", "other"]
    folders = ["moved/round0", "moved/round1", "moved/round2", "warped/round1"]
    assert list(alone.trainings("yard")) == [*folders, "other/round0"]
    moved, warped = (alone.at("yard", name, 1) for name in ("moved", "warped"))
    first = alone.at("yard", "moved", 0)
    # What they ask for of the machine makes no other training.
    assert alone.at("yard", "warped", 0) is first
    assert moved.cameras == trainings.corrected(first)
    assert moved.photos == "results/yard/images"
    assert warped.photos == f"{first.path}/warped/train"
    assert warped.valid == f"{first.path}/flow/train"
    assert all(t.job.external.train for t in alone.trainings("yard").values())


def test_its_own_round_0_is_its_baseline(alone):
    found = {name: alone.baseline(name) for name in alone.methods}
    assert found == {"moved": "moved", "warped": "moved", "other": "other"}
    every = {row.folder: row for row in rows.of_scene(alone, "yard")}
    assert every["warped/round1"].base == "moved/round0"
    assert every["moved/round2"].way == ["moved/round0", "moved/round1", "moved/round2"]
    assert every["moved/round2"].corrected == ["moved/round0", "moved/round1"]
    assert every["moved/round0"].description == "ns-train, cameras corrected"
    assert every["other/round0"].description == "train.sh"
    # No model of ours can be asked for a view by another camera.
    assert not any("aligned_pose" in row.files for row in every.values())


def test_all_views_of_a_reference_are_judged(alone):
    assert alone.reference_folder("yard", 0) == "results/yard/moved/round0"
    assert alone.splits("yard", "moved/round0") == ["train", "test"]
    assert alone.splits("yard", "other/round0") == ["test"]
    assert "train_renders" in scenes.seen(alone, "yard")


def test_what_was_learnt_from_is_exported(alone):
    assert targets.exports(alone) == [
        f"results/yard/{path}"
        for path in ("moved/export/cameras", "warped/export/cameras")
    ] + ["results/yard/warped/export/photos"]
    wanted = {"method": "warped", "what": "photos"}
    needed = cases.inputs("export_folder", alone, "yard", **wanted)
    assert needed["photos"] == "results/yard/moved/round0/warped"


def test_ours_stays_the_reference(experiment_of):
    methods = {"plain": {"rounds": 1}, "theirs": one(1)}
    experiment = experiment_of(config_of(methods))
    assert experiment.config.reference.method == "plain"
    job = {"training": "theirs/round1"}
    found = cases.inputs("train", experiment, "yard", **job)
    assert found["photos"] == "results/yard/theirs/round0/warped"
    assert found["given"] == "results/yard/cameras.npz"


def test_the_number_of_steps_is_part_of_it_where_it_asks(experiment_of):
    theirs = one()
    theirs["external"] = theirs["external"] | {"train": "x {steps} {seed}"}
    for steps in (10, 20):
        config = config_of({"a": theirs, "b": one()}, training={"steps": steps})
        experiment = experiment_of(config)
        asked, other = (experiment.at("yard", name, 0) for name in "ab")
        assert (asked.job.external.steps, asked.job.external.seed) == (steps, 0)
        assert (other.job.external.steps, other.job.external.seed) == (None, None)


def test_finished_renders(tmp_path, experiment_of):
    (tmp_path / "of yard").mkdir()
    method = {"external": {"renders": f"{tmp_path}/of {{scene}}"}}
    experiment = experiment_of(config_of({"ours": {}, "theirs": method}))
    job = {"training": "theirs/round0"}
    read = cases.inputs("render", experiment, "yard", **job)
    assert read["finished"] == [f"{tmp_path}/of yard"]
    assert methods.label(experiment, "theirs") == "finished renders"
    # Of a method beside others the test views are enough: it is scored.
    assert experiment.splits("yard", "theirs/round0") == ["test"]
    assert experiment.baseline("theirs") == "ours"


EXTERNAL = "config: methods.theirs.external"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"external": {}}, f"{EXTERNAL}: train is missing; both commands, or renders"),
        ({"external": {"train": "x"}}, f"{EXTERNAL}: render is missing"),
        (
            {"external": COMMANDS | {"trian": "x"}},
            f"{EXTERNAL}: 'trian' is no key of this section, perhaps 'train'",
        ),
        (
            {"external": COMMANDS | {"render": "x {model}"}},
            f"{EXTERNAL}.render: {{renders}} is missing",
        ),
        (
            {"external": COMMANDS | {"train": "x {dta}"}},
            f"{EXTERNAL}.train: {{dta}} means nothing; in braces only data, ",
        ),
        (
            {"external": COMMANDS | {"train": "x {renders}"}},
            f"{EXTERNAL}.train: {{renders}} means nothing",
        ),
        (
            {"external": COMMANDS | {"train": "x {data.__class__}"}},
            f"{EXTERNAL}.train: {{ means nothing",
        ),
        (
            {"external": COMMANDS | {"train": "x 'a"}},
            f"{EXTERNAL}.train: No closing quotation",
        ),
        (
            {"external": COMMANDS | {"train": "'' x"}},
            f"{EXTERNAL}.train: no program in it",
        ),
        (
            {"external": COMMANDS | {"depth": "x"}},
            f"{EXTERNAL}.depth: only beside renders",
        ),
        (
            {"external": {"renders": "nowhere/{scene}"}},
            f"{EXTERNAL}.renders: nowhere/yard does not exist",
        ),
        (
            {"external": {"renders": ".", "train": "x"}},
            f"{EXTERNAL}.train: not beside renders",
        ),
        (
            {"external": {"renders": "."}, "rounds": 1},
            "config: methods.theirs.rounds: 0 was expected",
        ),
        ({"model": "base"}, "config: methods.theirs.model: not beside external"),
        ({"align": {}}, "config: methods.theirs.align: not beside external"),
        (
            {"pose_optimization": {}},
            "config: methods.theirs.pose_optimization: not beside external",
        ),
        ({"renders": "."}, "config: methods.theirs: 'renders' is no key of this "),
        (
            {"changes": "cameras"},
            "config: methods.theirs.changes: cameras need a round",
        ),
        ({"external": COMMANDS | {"gpu": -1}}, f"{EXTERNAL}.gpu: -1 should"),
    ],
)
def test_a_fault_is_one_line_with_its_key(change, message):
    config = config_of({"theirs": one() | change})
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        check.checked(config)


@pytest.mark.parametrize(
    "more", [{"decide": True}, {"training": {"budget_min": 3}}], ids=str
)
def test_steps_that_nobody_knows(more):
    theirs = one()
    theirs["external"] = theirs["external"] | {"train": "x {steps}"}
    with pytest.raises(ValueError, match=r"\.train: \{steps\} needs training\.steps"):
        check.checked(config_of({"theirs": theirs}, **more))


def test_it_trains_no_crops():
    config = config_of({"theirs": one()}, crops={})
    with pytest.raises(ValueError, match=r"^config: crops: not with an external"):
        check.checked(copy.deepcopy(config))
    config["methods"]["plain"] = {}
    check.checked(config)


def test_two_methods_with_the_same_trainings_are_refused(experiment_of):
    experiment = experiment_of(config_of({"one": one(1), "two": one(1, gpu=1)}))
    with pytest.raises(ValueError, match=r"methods\.two: the same as methods\.one"):
        plan.check_equal(experiment)
