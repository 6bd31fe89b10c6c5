"""Jobs take what was decided, and nothing that a config says itself."""

import json

import pytest

from alignerf.experiment import check, decisions, jobs, plan, trainings
from alignerf.systems import base, nerf

DECISIONS = [
    decisions.Decision("model.near", 0.2, 3.0, "", {}),
    decisions.Decision("model.radius", 1.0, 4.0, "", {}),
    decisions.Decision("model.field.max_resolution", 2048, 512, "", {}),
    decisions.Decision("training.steps", 4000, 6000, "", {}),
]
SCENE = {"s": {"source": "courtyard"}}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Results of a scene s with decisions, in the current folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results" / "s").mkdir(parents=True)
    write(tmp_path / "results/s/decisions.json", DECISIONS)
    return tmp_path


def write(path, found):
    content = {"decisions": [decision._asdict() for decision in found]}
    path.write_text(json.dumps(content))


def job_of(config, method="mipnerf360"):
    config = check.checked({"scenes": SCENE} | config)
    return plan.Experiment(config).at("s", method, 0).job.text


def test_without_decide_no_file_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    job = jobs.read(job_of({}))
    assert (job.model.near, job.training.steps) == (0.2, 4000)
    assert job.decisions is None


def test_all_that_the_config_leaves_out_is_decided(folder):
    job = jobs.read(job_of({"decide": True}))
    assert (job.model.near, job.model.field.max_resolution) == (3.0, 512)
    assert (job.steps, job.warmup_steps, job.model.radius) == (6000, 600, 4.0)
    assert (job.decisions, job.scaled) == (None, False)


def test_what_the_config_says_stays(folder):
    for model, found in (
        ({"near": 0.1}, (0.1, 512)),
        ({"field": {"max_resolution": 64}}, (3.0, 64)),
    ):
        config = {"decide": True, "models": {"m": model}, "training": {"steps": 100}}
        job = jobs.read(job_of(config))
        assert (job.model.near, job.model.field.max_resolution) == found
        assert job.steps == 100


@pytest.mark.parametrize("length", [{"steps": 300}, {"budget_min": 2}])
def test_a_scenes_own_length_stays(folder, length):
    config = {"decide": True, "scenes": {"s": {"source": "courtyard", **length}}}
    training = jobs.read(job_of(config)).training
    assert {"steps": training.steps, "budget_min": training.budget_min} == {
        "steps": None,
        "budget_min": None,
        **length,
    }


def test_stages_and_lengths_keep_their_shares(folder):
    methods = {
        "mipnerf360": {"rounds": 1},
        "alignerf": {"alignerf": {"finetune_fraction": 0.2}},
    }
    config = {"decide": True, "methods": methods, "vary": {"lengths": [0.5]}}
    experiment = plan.Experiment(check.checked({"scenes": SCENE} | config))
    folder.joinpath("results/s").rename(folder / "results/s_x0.5")
    found = {
        folder: jobs.read(training.job.text).steps
        for folder, training in experiment.trainings("s_x0.5").items()
    }
    assert found == {
        "mipnerf360/round0": 3000,
        "mipnerf360/round1": 3000,
        "pretrain/base": 1800,
        "alignerf/round0": 600,
    }


def test_other_systems_take_their_steps_alone(folder):
    config = {"models": {"n": {"kind": "nerf"}}, "methods": {"mipnerf360": {}}}
    job = jobs.read(job_of({"decide": True} | config))
    assert (job.model.near, job.steps) == (nerf.SYSTEM().near, 6000)


def of(**changes):
    """A decisions.json of one entry, the change of near's."""
    entry = decisions.Decision("model.near", 0.2, 3.0, "", {})._asdict() | changes
    return json.dumps({"decisions": [entry]})


@pytest.mark.parametrize(
    "text",
    [
        *("", "{}", '{"decisions": [{"key": 1}]}', "[]", "[" * 10**5),
        *(of(value=value) for value in ("x", None, 0, -1, float("nan"))),
        *(of(key=5), of(default=0)),
    ],
)
def test_a_file_without_decisions_is_named(folder, text):
    (folder / "results/s/decisions.json").write_text(text)
    with pytest.raises(ValueError, match=r"decisions\.json: (not|nested)"):
        jobs.read(job_of({"decide": True}))


def test_a_missing_file_or_decision_is_named(folder):
    path = folder / "results/s/decisions.json"
    write(path, DECISIONS[:1])
    with pytest.raises(ValueError, match="nothing on radius"):
        jobs.read(job_of({"decide": True}))
    path.unlink()
    with pytest.raises(ValueError, match=r"decisions\.json: not found"):
        jobs.read(job_of({"decide": True}))


def test_a_complete_config_decides_the_same_again():
    config = check.checked({"decide": True, "scenes": SCENE})
    assert config.models["base"].open == [*base.USUAL]
    assert config.training.steps is None
    assert check.checked(json.loads(json.dumps(config.model_dump()))) == config


def test_photos_are_made_as_small_as_their_number_asks(tmp_path):
    scenes = {
        "court": {"source": "courtyard"},
        "given": {"source": "photos", "path": str(tmp_path), "downscale": 3},
        "open": {"source": "photos", "path": str(tmp_path)},
    }
    found = check.checked({"decide": True, "scenes": scenes}).scenes
    assert [scene.downscale for scene in found.values()] == [1, 3, "auto"]


EDITS = {
    "near": lambda c: c["models"]["base"].update(near=0.1),
    "max_resolution": lambda c: c["models"]["base"]["field"].update(max_resolution=99),
    "steps": lambda c: c["training"].update(steps=8000),
    "budget": lambda c: c["training"].update(steps=None, budget_min=2),
    "scene": lambda c: c["scenes"]["s"].update(steps=8000),
    "decide": lambda c: c.update(decide=False),
    "nothing": lambda c: None,
}


@pytest.mark.parametrize(
    ("edit", "left"),
    [
        ("near", ["radius", "max_resolution", "steps"]),
        ("max_resolution", ["near", "radius", "steps"]),
        ("steps", ["near", "radius", "max_resolution"]),
        ("budget", ["near", "radius", "max_resolution"]),
        ("scene", ["near", "radius", "max_resolution"]),
        ("decide", []),
        ("nothing", ["near", "radius", "max_resolution", "steps"]),
    ],
)
def test_what_is_changed_in_a_complete_config_is_said(edit, left):
    config = check.checked({"decide": True, "scenes": SCENE}).model_dump()
    EDITS[edit](config)
    found = check.checked(config)
    steps = ["steps"] * trainings.is_open(found.training)
    assert found.models["base"].open + steps == left


def test_a_field_of_points_has_neither_cells_nor_contraction():
    model = {"field": {"kind": "nerf"}, "far": 10}
    config = {"decide": True, "models": {"m": model}, "scenes": SCENE}
    assert check.checked(config).models["m"].open == ["near"]


def test_near_stays_before_a_far_that_the_config_says(folder):
    config = {"decide": True, "models": {"m": {"far": 4.0}}}
    assert jobs.read(job_of(config)).model.near == 2.0


def test_a_warm_up_keeps_its_fraction(folder):
    config = {"decide": True, "training": {"warmup_steps": 400}}
    assert jobs.read(job_of(config)).warmup_steps == 600
