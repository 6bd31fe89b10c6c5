"""What each job depends on: no more, and no less."""

import copy
import json

import pytest
import yaml

from alignerf.experiment import check, flows, jobs, regimes, rows, slices, sweep

WARM = {"from": "mipnerf360", "learning_rates": [0.005, 0.001]}


def test_configs_that_share_results_agree_on_them(root):
    """matching.yaml is of ablation.yaml's scenes, choices.yaml of another seed."""
    ablation, matching, choices = (
        check.checked(
            yaml.safe_load((root / f"workflow/config/{name}.yaml").read_text())
        )
        for name in ("ablation", "matching", "choices")
    )
    left_out = ("methods", "regimes", "reference")
    shared = {k: v for k, v in ablation.items() if k not in left_out}
    assert {k: v for k, v in matching.items() if k not in left_out} == shared
    for name in ("convolution", "alignment"):
        assert matching["methods"][name] == ablation["methods"][name]
    scene = ablation["scenes"]["ablation"] | {"seed": 1}
    other = {k: v for k, v in choices.items() if k not in left_out}
    assert other == shared | {"seed": 1, "scenes": {"choices": scene}}
    chosen = choices["methods"]["features_16"]
    assert chosen == ablation["methods"]["alignment"]
    assert 1 not in {scene["seed"] for scene in ablation["scenes"].values()}


def test_ablations_share_the_pretraining(demo, experiment_of):
    ablation = {"finetune_share": 0.1, "patches": 1, "features": 3, "align_penalty": 0}
    demo["methods"]["ablation"] = {"model": "base", "alignerf": ablation}
    experiment = experiment_of(demo)
    both = {
        slices.as_json(slices.job(experiment, "courtyard", name, "pretrain"))
        for name in ("alignerf", "ablation")
    }
    assert both == {slices.of_pretraining(experiment, "courtyard", "base")}
    own = [
        slices.of_round(experiment, "courtyard", name)
        for name in ("alignerf", "ablation")
    ]
    assert own[0] != own[1]


def test_a_scene_has_its_own_seed_and_steps(demo, experiment_of):
    demo["scenes"]["other"] = demo["scenes"]["courtyard"] | {"seed": 5, "steps": 70}
    demo["tradeoff"]["scene"] = "other"
    experiment = experiment_of(demo)
    poses = json.loads(slices.of_scene(experiment, "other"))
    assert poses["seed"] == 5
    # How long it is trained is nothing to its poses.
    assert "steps" not in poses
    found = [slices.of_round(experiment, "other", m) for m in experiment.methods]
    found += [slices.of_variant(experiment, "base")]
    parsed = [jobs.parse(json.loads(text)) for text in found]
    for job in parsed:
        found = job.training.steps, job.training.warmup_steps
        assert (job.seed, found) == (5, (70, 7))


def test_minutes_reach_the_jobs_instead_of_steps(demo, experiment_of):
    """Of the config or of a scene, whose own word counts; a warm start has a share."""
    courtyard = demo["scenes"]["courtyard"]
    demo["scenes"] = {
        "minutes": courtyard | {"budget_min": 3},
        "steps": courtyard | {"steps": 70},
        "neither": courtyard,
    }
    demo["methods"]["warm"] = {"model": "base", "rounds": 1, "warm_start": WARM}
    demo["tradeoff"]["variants"] = {"b": {"budget_min": 5}, "s": {"steps": 50}}
    demo["training"] = {"budget_min": 2.0, "warmup_steps": 40}
    experiment = experiment_of(demo)

    def length(text):
        found = jobs.parse(json.loads(text)).training
        return found.steps, found.budget_min, found.warmup_steps

    def of(scene, method="mipnerf360"):
        return length(slices.of_round(experiment, scene, method))

    assert of("minutes") == (None, 3.0, 40)
    assert of("neither") == of("neither", "alignerf") == (None, 2.0, 40)
    assert of("steps") == (70, None, 40)
    assert of("minutes", "warm") == (None, pytest.approx(0.9), 12)
    assert of("steps", "warm") == (21, None, 12)
    assert length(slices.of_pretraining(experiment, "minutes", "base"))[1] == 3.0
    assert length(slices.of_variant(experiment, "base")) == of("minutes")
    assert length(slices.of_variant(experiment, "b")) == (None, 5.0, 40)
    assert length(slices.of_variant(experiment, "s")) == (50, None, 40)
    poses = [slices.of_scene(experiment, scene) for scene in experiment.scenes]
    assert len(set(poses)) == 1
    # As it stands beside the results, it means the same.
    alone = experiment_of(json.loads(slices.complete(experiment, "minutes")))
    again = slices.of_round(alone, "minutes", "warm")
    assert again == slices.of_round(experiment, "minutes", "warm")


def test_minutes_of_a_scene_replace_the_steps_of_the_config(demo, experiment_of):
    demo["scenes"]["courtyard"]["budget_min"] = 3
    experiment = experiment_of(demo)
    job = slices.round_job(experiment, "courtyard", "mipnerf360")
    found = jobs.parse(job).training
    # A tenth of steps that are not known yet.
    assert (found.steps, found.budget_min, found.warmup_steps) == (None, 3.0, None)
    assert regimes.scenes(experiment)[0].steps is None


def test_a_scene_depends_on_its_own_source_only(demo, tmp_path, experiment_of):
    demo["scenes"]["own"] = {"source": "photos", "path": str(tmp_path)}
    demo["scenes"]["true"] = {"source": "courtyard", "poses": "truth"}
    experiment = experiment_of(demo)
    keys = {
        name: json.loads(slices.of_scene(experiment, name)).keys()
        for name in experiment.scenes
    }
    assert keys["courtyard"] >= {"courtyard", "colmap"}
    assert "courtyard" not in keys["own"]
    assert "colmap" not in keys["true"]


def test_a_radius_is_measured_where_it_is_asked_for(demo, experiment_of):
    demo["methods"]["alignerf"]["alignerf"]["radius_px"] = "auto"
    experiment = experiment_of(demo)
    measured = "results/courtyard/mipnerf360/round0/displacement_train.csv"
    found = rows.displacement_for_radius(experiment, "courtyard", "alignerf")
    assert found == {"displacement": measured}
    assert not rows.displacement_for_radius(experiment, "courtyard", "mipnerf360")
    job = slices.round_job(experiment, "courtyard", "alignerf")
    assert job["alignerf"]["radius_px"] is None
    assert measured in rows.data_of(experiment, "courtyard", "alignerf", 0)


def test_a_warm_start_goes_on_from_the_round_before(demo, experiment_of):
    demo["methods"]["warm"] = {"model": "base", "rounds": 2, "warm_start": WARM}
    experiment = experiment_of(demo)
    job = slices.round_job(experiment, "courtyard", "warm")
    assert job["stage"] == "warm"
    found = jobs.parse(job).training
    assert (found.steps, found.warmup_steps) == (600, 60)
    assert found.learning_rates == [0.005, 0.001]
    first, second = (
        rows.photos_of_round(experiment, "courtyard", "warm", str(k)) for k in (1, 2)
    )
    folder = "results/courtyard"
    assert first["photos"] == f"{folder}/mipnerf360/round0/warped/train"
    assert second["photos"] == f"{folder}/warm/round1/warped/train"
    assert second["valid"] == f"{folder}/warm/round1/flow/train"
    trainings = rows.trainings_of(experiment, "courtyard", "warm", 1)
    assert trainings == [
        f"{folder}/mipnerf360/round0/timing.json",
        f"{folder}/warm/round1/timing.json",
    ]
    before = flows.of_rounds(experiment, "courtyard", "warm", "1")
    # The decision is the method's own, also where it starts from another's round.
    assert before["before"] == f"{folder}/warm/round0/decision.json"
    assert before["before_flow"] == f"{folder}/mipnerf360/round0/flow/train"


def test_without_a_sweep_in_the_config_it_says_so(demo, experiment_of):
    del demo["tradeoff"]
    experiment = experiment_of(demo)
    assert sweep.names(experiment) == []
    with pytest.raises(ValueError, match="config: tradeoff: not there"):
        sweep.rows(experiment)


def test_a_sweep_trains_on_photos_made_smaller(demo, experiment_of):
    demo["tradeoff"]["variants"] = {"small": {"downscale": 1.5}}
    experiment = experiment_of(demo)
    folder = "results/courtyard"
    base, small = (
        sweep.photos_of_variant(experiment, "courtyard", name)
        for name in ("base", "small")
    )
    assert base["photos"] == f"{folder}/images"
    assert small["photos"] == f"{folder}/tradeoff/downscale-1.5/images"
    assert small["cameras"] == f"{folder}/tradeoff/downscale-1.5/cameras.npz"


def test_a_variant_is_the_base_with_its_keys(demo):
    mlp = {"kind": "mlp", "width": 32}
    demo["training"]["warmup_steps"] = 200
    demo["tradeoff"]["variants"] = variants = {
        "steps": {"steps": 50},
        "warm": {"steps": 50, "warmup_steps": 7},
        "small": {"downscale": 2, "seed": 5},
        "table": {"field": {"log2_entries": 9}, "samples": [4, 2]},
        "mlp": {"field": mlp, "learning_rates": [0.1, 0.01]},
    }
    demo = check.checked(demo)
    before = copy.deepcopy(demo)
    base = slices.variant_of(demo, "base")
    model, training = demo["models"]["base"], demo["training"]
    wanted = {"seed": 0, "downscale": 1, "model": model, "training": training}
    assert base == wanted
    found = {name: slices.variant_of(demo, name) for name in variants}
    # The warm-up keeps its share of the steps: 200 of 2000.
    shorter = {"training": training | {"steps": 50, "warmup_steps": 5}}
    assert found["steps"] == base | shorter
    assert found["warm"]["training"]["warmup_steps"] == 7
    assert found["small"] == base | {"downscale": 2, "seed": 5}
    field = model["field"] | {"log2_entries": 9}
    changed = {"model": model | {"field": field, "samples": [4, 2]}}
    assert found["table"] == base | changed
    assert found["mlp"]["model"] == model | {"field": mlp}
    assert found["mlp"]["training"] == training | {"learning_rates": [0.1, 0.01]}
    assert demo == before


def test_the_weights_of_lpips_reach_the_command(demo, tmp_path, experiment_of):
    (tmp_path / "my weights.npz").touch()
    path = str(tmp_path / "my weights.npz")
    demo["lpips"] = {"vgg": path, "squeeze": None}
    assert flows.lpips_options(experiment_of(demo)) == ["--lpips-vgg", path]
    demo["lpips"] = {}
    assert flows.lpips_options(experiment_of(demo)) == []


def test_flows_made_elsewhere_reach_the_commands(demo, experiment_of):
    template = "my flows/{scene}/{method}-{round}-{split}"
    demo["flow"] = {"estimator": "files", "folder": template}
    experiment = experiment_of(demo)
    found = flows.of_views(experiment, "courtyard", "mipnerf360", "1", "train")
    folder = "my flows/courtyard/mipnerf360-1-train"
    assert found[-4:] == ["--method", "files", "--flows", folder]
    found = flows.of_reference(experiment, "courtyard")
    assert found[-1] == "my flows/courtyard/mipnerf360_large-2-test"
    # For images that we make ourselves it is the default estimator.
    assert "--method" not in flows.estimator_options(experiment)
    models = ["mipnerf360_large/round0", "mipnerf360_large/round2"]
    found = flows.benchmark_options(experiment)
    assert found == ["--scene", "results/courtyard", "--renders", *models]


def test_a_scenes_complete_config_is_a_config(demo, experiment_of):
    demo["scenes"]["again"] = demo["scenes"]["courtyard"] | {"seed": 1}
    experiment = experiment_of(demo)
    alone = json.loads(slices.complete(experiment, "again"))
    assert alone["scenes"].keys() == {"again"}
    again = experiment_of(alone)
    for method in experiment.methods:
        job = slices.of_round(experiment, "again", method)
        assert slices.of_round(again, "again", method) == job
    poses = slices.of_scene(experiment, "again")
    assert slices.of_scene(again, "again") == poses
    # Tables follow the config's order, and what a method is set against.
    assert again.all_rounds("again") == experiment.all_rounds("again")
    table = rows.as_json(rows.misalignment(experiment, "again"))
    assert rows.as_json(rows.misalignment(again, "again")) == table
    assert alone["tradeoff"] is None
    assert json.loads(slices.complete(experiment, "courtyard"))["tradeoff"]
