"""Other systems and other programs' renders in a config: what they are, and may not."""

import pytest
import yaml

from alignerf import config as config_command
from alignerf import methods, systems
from alignerf.experiment import check, jobs
from alignerf.experiment.tables import scenes


def system(demo, **model):
    demo["models"]["other"] = model
    demo["methods"]["other"] = {"model": "other"}
    return demo


def job_of(experiment, scene, method):
    """The job of a method's first training."""
    return experiment.at(scene, method, 0).job.model_dump()


@pytest.mark.parametrize("kind", ["nerf", "mipnerf", "nerfpp", "ngp"])
def test_a_system_needs_its_kind_alone(demo, experiment_of, kind):
    experiment = experiment_of(system(demo, kind=kind))
    job = job_of(experiment, "courtyard", "other")
    parsed = jobs.parse(job)
    assert parsed.model.kind == kind
    assert tuple(parsed.training.learning_rates) == systems.every()[kind].RATES
    # A pinned training says what the slice says.
    assert jobs.parse(parsed.model_dump()) == parsed
    assert methods.label(experiment, "other").startswith(kind)


def test_without_a_kind_a_model_is_a_mipnerf360():
    found = check.checked({"scenes": {"a": {"source": "courtyard"}}})
    assert found.models["base"].kind == "mipnerf360"


def test_a_model_changes_its_own_trainings(demo, experiment_of):
    changes = {"batch_rays": 64, "adam_betas": [0.9, 0.999]}
    experiment = experiment_of(system(demo, kind="mipnerf", training=changes))
    job = job_of(experiment, "courtyard", "other")
    assert job["training"]["batch_rays"] == 64
    assert job["training"]["adam_betas"] == [0.9, 0.999]
    assert job["training"]["steps"] == demo["training"]["steps"]
    assert job["model"]["training"] == {}
    others = job_of(experiment, "courtyard", "mipnerf360")
    assert others["training"]["batch_rays"] == 512


def test_what_a_job_is_told_of_its_model_counts(demo, experiment_of):
    experiment = experiment_of(system(demo, kind="mipnerf"))
    job = job_of(experiment, "courtyard", "other")
    job["model"]["training"] = {"batch_rays": 32}
    assert jobs.parse(job).training.batch_rays == 32


@pytest.mark.parametrize(
    ("model", "reason"),
    [
        (
            {"kind": "nef"},
            r"models.other.kind: 'nef' should be one of 'mipnerf360', 'nerf'",
        ),
        ({"kind": "nerf", "field": {}}, r"models.other: 'field' is no key"),
        ({"levels": 3}, r"models.other: 'levels' is no key"),
        (
            {"kind": "nerf", "far": 1e6},
            r"models.other.far: 1000000.0 should be .* to 100",
        ),
        ({"kind": "nerf", "near": 101.0}, "models.other: near must be smaller"),
        (
            {"kind": "nerf", "samples": [64]},
            r"models.other.samples: .*at least 2 items",
        ),
        (
            {"kind": "nerfpp", "radius": 1.1},
            r"models.other.radius: 1.1 should be greater than 1.7321",
        ),
        ({"kind": "ngp", "side": 0}, r"models.other.side: 0 should be greater than 0"),
        (
            {"kind": "ngp", "max_resolution": 65536, "side": 128},
            r"models.other.max_resolution: 8.38861e\+06 cells over the box",
        ),
        (
            {"kind": "ngp", "max_resolution": 2, "side": 1},
            r"models.other.max_resolution: 2 cells over the box are not from 17",
        ),
        (
            {"kind": "nerf", "samples": [2, 8]},
            r"models.other.samples.0: 2 should be .* to 3",
        ),
        (
            {"kind": "ngp", "log2_hashmap_size": 26, "levels": 32, "features": 64},
            r"models.other.width: 2048 GiB to train",
        ),
        (
            {"kind": "nerf", "training": {"budget_min": 5}},
            r"training: 'budget_min' is no key",
        ),
        (
            {"kind": "nerf", "training": {"batch_rays": 0}},
            r"models.other.training.batch_rays: 0 should be greater",
        ),
    ],
)
def test_a_fault_of_a_system_is_named(demo, model, reason):
    with pytest.raises(ValueError, match=reason):
        check.checked(system(demo, **model))


@pytest.mark.parametrize("stage", ["alignerf", "pose_optimization"])
def test_what_is_made_for_the_baseline_is_refused(demo, stage):
    demo = system(demo, kind="nerf")
    demo["methods"]["other"][stage] = {}
    with pytest.raises(ValueError, match=f"methods.other.{stage}: not of a model of k"):
        check.checked(demo)


def test_defaults_of_all_systems_stand_in_the_schema():
    found = yaml.safe_load(config_command.schema_text())["$defs"]
    for system in systems.every().values():
        properties = found[system.__name__]["properties"]
        assert properties["samples"]["default"] == system().samples


def test_all_are_set_against_a_round_that_is_trained(demo, experiment_of):
    """The reference's round 0 may be another method's, of the same model."""
    demo["methods"] = {"first": {"model": "base"}, "alias": {"model": "base"}}
    demo["reference"] = {"method": "alias"}
    experiment = experiment_of(demo)
    (scene,) = scenes.compared(experiment)
    assert scene.reference == "first"
    every = scenes.rows_of(experiment, "courtyard", "comparison/")
    assert {row.base for row in every} == {"first/round0"}


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"published_table": 2}, "published_table: no method says what it is called"),
        ({"published": "NeRF"}, "methods.other.published: only with published_table"),
        (
            {"published_table": 2, "published": "Nerf 361"},
            "methods.other.published: 'Nerf 361' is none of NeRF, mip-NeRF, mip-NeRF w",
        ),
        ({"published_table": 2, "published": ""}, "published: '' should match"),
    ],
)
def test_names_that_no_paper_has_are_refused(demo, changes, reason):
    demo = system(demo, kind="nerf")
    if "published" in changes:
        demo["methods"]["other"]["published"] = changes["published"]
    if "published_table" in changes:
        demo["published_table"] = changes["published_table"]
    with pytest.raises(ValueError, match=reason):
        check.checked(demo)


@pytest.mark.parametrize(
    ("kind", "points"), [("nerf", 256), ("mipnerf", 256), ("nerfpp", 512), ("ngp", 96)]
)
def test_a_rays_points_are_those_that_networks_see(demo, experiment_of, kind, points):
    experiment = experiment_of(system(demo, kind=kind))
    job = jobs.parse(job_of(experiment, "courtyard", "other"))
    assert job.model.points_a_ray == points


def test_all_networks_of_a_system_have_to_fit(demo):
    fits = {"kind": "mipnerf", "width": 16384, "depth": 60}
    check.checked(system(demo, **fits))
    with pytest.raises(ValueError, match=r"models.other.width: \d+ GiB to train"):
        check.checked(system(demo, **fits | {"kind": "nerfpp"}))


@pytest.mark.parametrize("kind", ["nerf", "ngp"])
def test_keys_that_a_system_has_no_use_for_are_refused(demo, kind):
    changes = {"distortion_weight": 0.5}
    with pytest.raises(ValueError, match=r"training.distortion_weight: kind \w+ has n"):
        check.checked(system(demo, kind=kind, training=changes))


@pytest.mark.parametrize(
    "model", [{"background": "white"}, {"field": {"kind": "nerf"}, "far": 4}]
)
def test_what_squares_errors_has_no_distortion(demo, model):
    model |= {"training": {"distortion_weight": 0.5}}
    with pytest.raises(
        ValueError, match=r"training.distortion_weight: none with field"
    ):
        check.checked(system(demo, **model))
    del model["training"]
    check.checked(system(demo, **model))


@pytest.mark.parametrize(
    ("model", "found"), [({}, "white"), ({"background": "black"}, "black")]
)
def test_what_transparent_pixels_stand_on_is_known_to_the_model(
    demo, experiment_of, tmp_path, model, found
):
    scene = {"source": "blender", "path": str(tmp_path), "background": "white"}
    demo["scenes"]["lego"] = scene
    experiment = experiment_of(system(demo, **model))
    jobs_of = {
        name: job_of(experiment, name, "other") for name in ("lego", "courtyard")
    }
    assert jobs_of["lego"]["model"]["background"] == found
    assert jobs_of["courtyard"]["model"]["background"] == model.get("background")
