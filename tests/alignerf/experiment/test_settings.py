"""A job's config: parsed strictly, and the same keys in schema and code."""

import copy
import json

import jax
import jsonschema
import pytest
import yaml

from alignerf import fields, poses
from alignerf.experiment import jobs
from alignerf.scenes.courtyard import scene as courtyard
from alignerf.training import compose
from flow.estimation import estimate, given
from flow.warping import warp

GRID = {"kind": "grid", "levels": 2, "log2_entries": 8}
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
        "adam_eps": 1e-15,
        "gradient_norm": None,
        "interlevel_weight": 1,
        "distortion_weight": 0.01,
    },
    "alignerf": {
        "pretrain_share": 0.6,
        "finetune_share": 0.2,
        "learning_rates": [0.003, 0.0003],
        "patches": 2,
        "patch_px": 16,
        "convolution": True,
        "features": 5,
        "matching": "patch",
        "error": "squared",
        "radius_px": 2,
        "align_penalty": 0.01,
        "frequency_weight": 0.05,
        "frequency_weights": None,
    },
}


@pytest.fixture
def job():
    return copy.deepcopy(JOB)


@pytest.fixture(scope="module")
def schema(root):
    text = (root / "workflow" / "schemas" / "config.schema.yaml").read_text()
    return yaml.safe_load(text)


def test_a_job_is_what_was_written(job):
    parsed = jobs.parse(job)
    assert jobs.as_dict(parsed) == job
    assert jobs.parse(json.loads(json.dumps(jobs.as_dict(parsed)))) == parsed
    assert isinstance(parsed.training.interlevel_weight, float)


def test_stages_share_the_steps_and_the_schedule(job):
    found = {stage: jobs.parse(job | {"stage": stage}) for stage in jobs.STAGES}
    steps = {stage: job.steps for stage, job in found.items()}
    assert steps == {"full": 100, "warm": 100, "pretrain": 60, "finetune": 20}
    schedule = {stage: job.schedule_steps for stage, job in found.items()}
    assert schedule == {"full": 100, "warm": 100, "pretrain": 100, "finetune": 20}
    rays = {stage: job.rays_per_step for stage, job in found.items()}
    assert rays == {"full": 64, "warm": 64, "pretrain": 64, "finetune": 2 * 16**2}
    job["training"]["steps"] = 1
    assert jobs.parse(job).steps == 1


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
        ("seed", None, "config: key 'seed' is missing"),
        ("model.near", None, "config.model: key 'near' is missing"),
        ("training.stpes", 1, "config.training: unknown key 'stpes'"),
        ("training.steps", "100", "config.training.steps: must be int, not '100'"),
        ("training.steps", 1.5, "config.training.steps: must be int"),
        ("training.steps", True, "config.training.steps: must be int"),
        ("training.adam_eps", "1e-6", "config.training.adam_eps: must be float"),
        ("model.samples", 8, "config.model.samples: must be list"),
        ("model", [1], "config.model: must be a mapping"),
        ("alignerf.frequency_weights", 3, "frequency_weights: must be str"),
        ("stage", "half", "config.stage: 'half'"),
        ("alignerf", {}, "config.alignerf: key"),
        ("alignerf.convolution", 1, "config.alignerf.convolution: must be bool"),
        ("alignerf.matching", "ray", "config.alignerf.matching: 'ray' is not one of"),
        ("alignerf.error", "L1", "config.alignerf.error: 'L1' is not one of"),
        ("model.far", 0.1, "near 0.2 and far 0.1"),
        ("model.near", -1.0, "near -1.0"),
        ("model.far", float("inf"), "far inf"),
        ("model.far", float("nan"), "far nan"),
    ],
)
def test_faults_are_named(job, where, value, reason):
    change(job, where, value)
    with pytest.raises(ValueError, match=reason.replace(".", r"\.")):
        jobs.parse(job)


def test_a_stage_needs_its_settings(job):
    job["alignerf"] = None
    with pytest.raises(ValueError, match=r"config\.alignerf: a staged training"):
        jobs.parse(job)
    assert jobs.parse(job | {"stage": "full"}).alignerf is None


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"kind": "gird"}, "config.model.field: field kind 'gird'"),
        ({"kind": "grid", "levles": 3}, "config.model.field: .*levles"),
        ({"kind": "mlp", "levels": 3}, "config.model.field: .*levels"),
        ({"width": 3}, "config.model.field: .*kind"),
    ],
)
def test_faults_of_a_field_are_named(job, options, reason):
    job["model"]["field"] = options
    with pytest.raises(ValueError, match=reason):
        compose.make_method(jobs.parse(job))


def test_only_fine_tuning_has_the_patch_convolution(job):
    for stage in jobs.STAGES:
        method = compose.make_method(jobs.parse(job | {"stage": stage}))
        params = jax.eval_shape(method.init, jax.random.key(0))
        assert params.keys() == (
            {"model", "head"} if stage == "finetune" else {"model"}
        )
        assert params["model"].keys() == {"field", "proposal"}


def keys(schema, name):
    found = schema["$defs"][name]
    assert found["additionalProperties"] is False
    return set(found["properties"])


@pytest.mark.parametrize(
    ("name", "kind"), [("model", settings.Model), ("training", settings.Training)]
)
def test_schema_and_dataclasses_have_the_same_keys(schema, name, kind):
    assert keys(schema, name) == set(kind.__dataclass_fields__)
    assert set(schema["$defs"][name]["required"]) == keys(schema, name)


def test_schema_and_alignerf_have_the_same_keys(schema):
    wanted = set(jobs.Finetuning.__dataclass_fields__)
    # One file of weights serves all methods: it stands at the top of a config.
    assert keys(schema, "alignerf") | {"frequency_weights"} == wanted
    assert "frequency_weights" in schema["properties"]
    assert set(schema["$defs"]["alignerf"]["required"]) == keys(schema, "alignerf")


def test_schema_and_fields_have_the_same_keys(schema):
    kinds = schema["$defs"]["field"]["properties"]["kind"]["enum"]
    assert set(kinds) == set(fields.KINDS)
    inherited = {"parent", "name", "outputs"}
    for kind, module in fields.KINDS.items():
        wanted = set(module.__dataclass_fields__) - inherited
        assert keys(schema, kind) == wanted | {"kind"}


def test_a_variant_changes_keys_of_models_and_trainings(schema):
    known = set(settings.Model.__dataclass_fields__)
    known |= set(settings.Training.__dataclass_fields__)
    assert keys(schema, "variant") <= known | {"seed", "downscale"}
    # What a user can turn of a model; near and far are the scene's.
    model = set(settings.Model.__dataclass_fields__) - {"near", "far"}
    assert model <= keys(schema, "variant")


def test_schema_and_poses_have_the_same_keys_and_defaults(schema):
    scene = schema["$defs"]["scene"]["properties"]
    # How long a scene is trained is nothing to its poses.
    assert keys(schema, "scene") == set(poses.DEFAULTS) | {"steps"}
    assert set(scene["source"]["enum"]) == set(poses.POSES)
    ways = {way for ways in poses.POSES.values() for way in ways}
    assert set(scene["poses"]["enum"]) == ways | {None}
    for name in ("colmap", "courtyard"):
        assert scene[name]["additionalProperties"] is False
        assert set(scene[name]["properties"]) == set(poses.DEFAULTS[name])
    for name, entry in [*scene.items(), *scene["colmap"]["properties"].items()]:
        if "default" in entry:
            assert entry["default"] == (poses.DEFAULTS | poses.DEFAULTS["colmap"])[name]


def test_schema_and_flow_have_the_same_choices(schema):
    options = schema["$defs"]["flow"]["properties"]
    assert options["method"]["enum"] == [*estimate.METHODS, given.METHOD]
    assert options["kernel"]["enum"] == list(warp.KERNELS)


def test_schema_takes_the_defaults_of_the_embedded_scene(schema):
    scene = {key: value for key, value in poses.DEFAULTS.items() if key != "seed"}
    whole = schema | {"$ref": "#/$defs/scene"}
    for key in ("type", "properties", "required", "additionalProperties"):
        whole.pop(key)
    jsonschema.Draft202012Validator(whole).validate(scene)
    motions = schema["$defs"]["scene"]["properties"]["courtyard"]["properties"]
    for motion in motions["motion"]["enum"]:
        courtyard.draw_displacements(views=2, motion=motion)


def test_schema_is_one(schema):
    jsonschema.Draft202012Validator.check_schema(schema)
