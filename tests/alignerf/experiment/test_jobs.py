"""A job's slice of the config: parsed strictly, complete, in its stages."""

import copy
import json

import jax
import pytest

from alignerf.experiment import jobs
from alignerf.training import compose

STAGES = ("full", "pretrain", "finetune")
GRID = {"kind": "grid", "levels": 2, "log2_hashmap_size": 8}
JOB = {
    "seed": 0,
    "stage": "finetune",
    "model": {
        "near": 0.2,
        "far": 1e6,
        "samples": [8, 4],
        "proposal": GRID,
        "field": {"kind": "mlp", "width": 16, "depth": 2},
    },
    "training": {
        "steps": 100,
        "batch_rays": 64,
        "learning_rates": [0.01, 0.001],
        "warmup_steps": 3,
        "hold_fraction": 0,
        "adam_betas": [0.9, 0.999],
        "adam_eps": 1e-15,
        "gradient_norm": None,
        "proposal_fraction": 1,
        "interlevel_weight": 1,
        "distortion_weight": 0.01,
    },
    "alignerf": {
        "pretrain_fraction": 0.6,
        "finetune_fraction": 0.2,
        "learning_rates": [0.003, 0.0003],
        "patches": 2,
        "patch_px": 16,
        "convolution": True,
        "features": 5,
        "radius_px": 2,
        "align_penalty": 0.01,
        "frequency_weight": 0.05,
        "frequency_weights": None,
    },
}


@pytest.fixture
def job():
    return copy.deepcopy(JOB)


def in_stage(job, stage):
    """The job as another stage has it: each has its own keys alone."""
    own = {"finetune": {"alignerf": job["alignerf"]}}
    own |= {"pretrain": {"pretrain_fraction": 0.6}}
    rest = {key: value for key, value in job.items() if key != "alignerf"}
    return rest | {"stage": stage} | own.get(stage, {})


def test_a_job_is_what_was_written(job):
    parsed = jobs.parse(job)
    found = parsed.model_dump()
    for field in ("proposal", "field"):
        given = job["model"].pop(field)
        assert found["model"].pop(field).items() >= given.items()
    assert found["training"].pop("budget_min") is None
    own = {"kind": "mipnerf360", "training": {}, "radius": 1.0}
    assert found["training"].pop("kernels") == "auto"
    assert (found.pop("decisions"), found.pop("scaled")) == (None, False)
    own["background"] = None
    assert found.pop("model") == job.pop("model") | own
    assert found == job
    assert jobs.parse(json.loads(json.dumps(parsed.model_dump()))) == parsed
    assert isinstance(parsed.training.interlevel_weight, float)


def test_a_number_is_one_job_however_it_is_written(job):
    again = copy.deepcopy(job)
    for section in ("training", "alignerf"):
        floats = {k: float(v) for k, v in job[section].items() if v in (0, 1)}
        again[section] |= {k: v for k, v in floats.items() if k != "convolution"}
    assert json.dumps(again) != json.dumps(job)
    one, other = jobs.parse(job), jobs.parse(again)
    assert one == other
    assert (one.text, hash(one)) == (other.text, hash(other))


def test_stages_share_the_steps_and_the_schedule(job):
    found = {stage: jobs.parse(in_stage(job, stage)) for stage in STAGES}
    steps = {stage: job.steps for stage, job in found.items()}
    assert steps == {"full": 100, "pretrain": 60, "finetune": 20}
    schedule = {stage: job.schedule_steps for stage, job in found.items()}
    assert schedule == {"full": 100, "pretrain": 100, "finetune": 20}
    rays = {stage: job.rays_per_step for stage, job in found.items()}
    assert rays == {"full": 64, "pretrain": 64, "finetune": 2 * 16**2}
    job["training"]["steps"] = 1
    assert jobs.parse(job).steps == 1


@pytest.fixture
def timed(job):
    """The job with two minutes instead of its steps."""
    del job["training"]["steps"]
    job["training"] |= {"budget_min": 2, "warmup_steps": None}
    return job


def test_a_budget_becomes_the_steps_of_every_stage(timed):
    """2400 steps of 0.05 s in two minutes, of which stages take their shares."""
    found = {}
    for stage in STAGES:
        job = jobs.parse(in_stage(timed, stage))
        assert job.training.steps is job.training.warmup_steps is None
        steps = jobs.steps_in(job, 0.05)
        known = jobs.with_steps(job, steps)
        assert steps == 2400
        assert known.budget_min == job.budget_min == 2.0 * job.share
        found[stage] = known.steps, known.schedule_steps, known.warmup_steps
    assert found == {
        "full": (2400, 2400, 240),
        "pretrain": (1440, 2400, 240),
        "finetune": (480, 480, 48),
    }


def test_a_budget_has_ten_steps_at_least(timed):
    for stage in STAGES:
        job = jobs.parse(in_stage(timed, stage))
        assert jobs.with_steps(job, jobs.steps_in(job, 1e6)).steps == 10
    assert jobs.steps_in(job, 1e-9) == 10**8


def test_a_given_warm_up_stays_within_a_budget(timed):
    timed["training"]["warmup_steps"] = 300
    job = jobs.parse(in_stage(timed, "full"))
    assert jobs.with_steps(job, 2400).warmup_steps == 300
    assert jobs.with_steps(job, 120).warmup_steps == 120


def change(job, where, value=None):
    *parents, last = where.split(".")
    for key in parents:
        job = job[key]
    if value is None:
        del job[last]
    else:
        job[last] = value


@pytest.mark.parametrize(
    ("where", "value", "reason"),
    [
        ("seed", None, "config: top level: 'seed' is missing"),
        ("seed", -1, "seed: -1 should be greater than or equal to 0"),
        ("seed", 2**32, "seed: 4294967296 should be less than or equal to"),
        ("training.stpes", 1, "config: training: 'stpes' is no key .*'steps'"),
        ("training.steps", "100", "steps: '100' should be .* integer .*out quotes"),
        ("training.steps", 1.5, "training.steps: 1.5 should be a valid integer"),
        ("training.steps", 2.0, "training.steps: 2.0 should be a valid integer"),
        ("training.steps", True, "training.steps: True should be a valid integer"),
        ("training.steps", 0, "training.steps: 0 should be greater"),
        ("training.steps", 10**30, "training.steps: 1000.* should be less"),
        ("training.budget_min", 2.0, "training.budget_min: not beside steps"),
        ("training.batch_rays", 0, "training.batch_rays: 0 should be greater"),
        ("training.adam_eps", "1e-6", "adam_eps: '1e-6' .*write 1.0e-06"),
        (
            "training.adam_eps",
            float("inf"),
            "training.adam_eps: inf should be a finite",
        ),
        (
            "training.learning_rates",
            [0.1, float("nan")],
            "learning_rates.1: nan should be a finite",
        ),
        ("model.samples", 8, "model.samples: 8 should be a valid list"),
        ("model.samples", [], r"model.samples: \[\] "),
        ("model.samples", [0, 4], "model.samples.0: 0 should be greater"),
        ("model.proposal.levels", 0, "model.proposal.levels: 0 should be greater"),
        ("model", [1], r"config: model: \[1\] should be a mapping"),
        ("alignerf.frequency_weights", 3, "frequency_weights: 3 should be .* string"),
        ("stage", "half", "config: stage: 'half' is none of .'full', 'pretrain'"),
        (
            "alignerf.convolution",
            1,
            "alignerf.convolution: 1 should be a valid boolean",
        ),
        ("alignerf.patches", 0, "alignerf.patches: 0 should be greater"),
        ("alignerf.patch_px", 0, "alignerf.patch_px: 0 should be .* equal to 8"),
        (
            "alignerf.finetune_fraction",
            0,
            "finetune_fraction: 0 should be greater than 0",
        ),
        (
            "alignerf.learning_rates",
            [0, 0],
            "learning_rates.0: 0 should be greater than 0",
        ),
        ("model.near", -1.0, "model.near: -1.0 should be greater than 0"),
        ("model.far", float("inf"), "model.far: inf should be a finite"),
        ("model.field", {"kind": "gird"}, "model.field.kind: 'gird' should be one of"),
        ("model.field", {"kind": "grid", "levles": 3}, "model.field: .*'levles'"),
        ("model.field", {"kind": "mlp", "levels": 3}, "model.field: .*'levels'"),
    ],
)
def test_faults_are_named(job, where, value, reason):
    change(job, where, value)
    with pytest.raises(ValueError, match=reason):
        jobs.parse(job)


@pytest.mark.parametrize(
    ("stage", "key"), [("finetune", "alignerf"), ("pretrain", "pretrain_fraction")]
)
def test_a_stage_needs_its_settings_and_no_other_has_them(job, stage, key):
    has = in_stage(job, stage)
    jobs.parse(has)
    for missing in (has | {key: None}, {k: v for k, v in has.items() if k != key}):
        with pytest.raises(ValueError, match=f"config: .*{key}"):
            jobs.parse(missing)
    for other in {*STAGES} - {stage}:
        beside = in_stage(job, other) | {key: has[key]}
        with pytest.raises(ValueError, match=f"'{key}' is no key of this section"):
            jobs.parse(beside)


@pytest.mark.parametrize(
    ("share", "reason"),
    [
        (0, "pretrain_fraction: 0 should be greater than 0"),
        (1.5, "pretrain_fraction: 1.5 should be .* equal to 1"),
        ("half", "pretrain_fraction: 'half' should be a valid number"),
    ],
)
def test_a_pre_training_is_a_share_of_the_length(job, share, reason):
    with pytest.raises(ValueError, match=reason):
        jobs.parse(in_stage(job, "pretrain") | {"pretrain_fraction": share})


def test_what_a_slice_leaves_out_has_its_default(job):
    del job["training"]["adam_eps"], job["model"]["far"], job["alignerf"]["patches"]
    del job["training"]["warmup_steps"]
    parsed = jobs.parse(job)
    assert (parsed.training.adam_eps, parsed.model.far) == (1e-15, 1e6)
    assert parsed.alignerf.patches == 4
    assert parsed.training.warmup_steps == 10


def test_only_fine_tuning_has_the_patch_convolution(job):
    for stage in STAGES:
        method = compose.make_method(jobs.parse(in_stage(job, stage)))
        params = jax.eval_shape(method.init, jax.random.key(0))
        assert params.keys() == (
            {"model", "head"} if stage == "finetune" else {"model"}
        )
        assert params["model"].keys() == {"field", "proposal"}
