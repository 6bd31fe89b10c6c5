"""What each job depends on: no more, and no less."""

import json

import pytest
import yaml

from alignerf.experiment import (
    check,
    jobs,
    plan,
)
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.experiment.tables import rows, scenes
from alignerf.methods import staged
from tests import step_cases as cases


def job_of(experiment, scene, method):
    """The job of a method's last training, which may go on from others."""
    return experiment.rounds_of(scene, method)[-1].job.model_dump()


def test_configs_that_share_results_agree_on_them(root):
    """choices.yaml is of table4.yaml's scene at another seed."""
    ablation, choices = (
        check.checked(
            yaml.safe_load((root / f"workflow/config/{name}.yaml").read_text())
        )
        for name in ("table4", "evidence/choices")
    )
    scene = ablation.scenes["ablation"].model_copy(update={"seed": 1})
    assert choices.scenes == {"choices": scene}
    assert choices.models["base"] == ablation.models["base"]
    assert choices.training == ablation.training
    chosen, named = choices.methods["features_16"], {"published": "+ alignment"}
    assert chosen.model_copy(update=named) == ablation.methods["alignment"]
    assert 1 not in {scene.seed for scene in ablation.scenes.values()}


def test_adjusted_cameras_have_a_pretraining_of_their_own(demo, experiment_of):
    demo["methods"]["both"] = {"model": "base", "adjust": True, "alignerf": {}}
    experiment = experiment_of(demo)
    plain, both = (experiment.at("courtyard", n, 0) for n in ("alignerf", "both"))
    adjusted = "results/courtyard/images/adjusted/train.npz"
    assert {one.cameras for one in (both, *both.after)} == {adjusted}
    assert [one.folder for one in both.after] == ["pretrain/base.adjusted"]
    assert plain.after[0].folder == "pretrain/base"
    assert adjusted not in {one.cameras for one in (plain, *plain.after)}
    assert both.job == plain.job


def test_ablations_share_the_pretraining(demo, experiment_of):
    ablation = {
        "finetune_fraction": 0.1,
        "patches": 1,
        "features": 3,
        "align_penalty": 0,
    }
    demo["methods"]["ablation"] = {"model": "base", "alignerf": ablation}
    experiment = experiment_of(demo)
    own = [experiment.at("courtyard", name, 0) for name in ("alignerf", "ablation")]
    assert own[0].after == own[1].after
    (pretrained,) = own[0].after
    assert pretrained.folder == "pretrain/base"
    for name in ("alignerf", "ablation"):
        job = staged.METHOD.pretraining(experiment, "courtyard", name)
        assert job == pretrained.job
        # Nothing of the fine-tuning is in it, so that this makes none anew.
        assert not hasattr(job, "alignerf")
        assert job.pretrain_fraction == 0.6
    assert own[0].job != own[1].job


@pytest.mark.parametrize("asked", [None, False, True])
@pytest.mark.parametrize("source", ["transforms", "photos", "courtyard"])
def test_the_poses_stage_finds_points_where_the_config_wants_them(
    demo, experiment_of, tmp_path, source, asked
):
    scene = {"source": source, "triangulate": asked}
    if source != "courtyard":
        scene["path"] = str(tmp_path)
        (tmp_path / "transforms.json").write_text("{}")
    demo |= {"scenes": {"a": scene}}
    experiment = experiment_of(demo)
    told = of_scenes.checked(json.loads(plan.scene_config(experiment, "a")))
    capture = experiment.capture("a")
    wanted = capture.wants_matches(experiment.scenes["a"])
    assert bool(capture.wants_matches(told)) == bool(wanted)


def test_a_scene_has_its_own_seed_and_steps(demo, experiment_of):
    demo["scenes"]["other"] = demo["scenes"]["courtyard"] | {"seed": 5, "steps": 70}
    experiment = experiment_of(demo)
    poses = json.loads(plan.scene_config(experiment, "other"))
    assert poses["seed"] == 5
    # How long it is trained is nothing to its poses.
    assert "steps" not in poses
    every = experiment.trainings("other")
    assert every.keys() > {"pretrain/base", "alignerf/round0"}
    parsed = [jobs.parse(training.job.model_dump()) for training in every.values()]
    for job in parsed:
        found = job.training.steps, job.training.warmup_steps
        assert (job.seed, found) == (5, (70, 7))


def test_minutes_reach_the_jobs_instead_of_steps(demo, experiment_of):
    """Of the config or of a scene, whose own word counts."""
    courtyard = demo["scenes"]["courtyard"]
    demo["scenes"] = {
        "minutes": courtyard | {"budget_min": 3},
        "steps": courtyard | {"steps": 70},
        "neither": courtyard,
    }
    demo["training"] = {"budget_min": 2.0, "warmup_steps": 40}
    experiment = experiment_of(demo)

    def length(job):
        job = job if isinstance(job, dict) else job.model_dump()
        found = jobs.parse(job).training
        return found.steps, found.budget_min, found.warmup_steps

    def of(scene, method="mipnerf360"):
        return length(job_of(experiment, scene, method))

    assert of("minutes") == (None, 3.0, 40)
    assert of("neither") == of("neither", "alignerf") == (None, 2.0, 40)
    assert of("steps") == (70, None, 40)
    pretrained = staged.METHOD.pretraining(experiment, "minutes", "alignerf")
    assert length(pretrained)[1] == 3.0
    poses = [plan.scene_config(experiment, scene) for scene in experiment.scenes]
    assert len(set(poses)) == 1
    # As it stands beside the results, it means the same.
    alone = experiment_of(json.loads(plan.complete_config(experiment, "minutes")))
    again = alone.at("minutes", "mipnerf360", 1)
    assert again == experiment.at("minutes", "mipnerf360", 1)


def test_minutes_of_a_scene_replace_the_steps_of_the_config(demo, experiment_of):
    demo["scenes"]["courtyard"]["budget_min"] = 3
    experiment = experiment_of(demo)
    found = jobs.parse(job_of(experiment, "courtyard", "mipnerf360")).training
    # A tenth of steps that are not known yet.
    assert (found.steps, found.budget_min, found.warmup_steps) == (None, 3.0, None)
    assert scenes.of_experiment(experiment)[0].scene_steps is None


def test_a_scene_depends_on_its_own_source_only(demo, tmp_path, experiment_of):
    demo["scenes"]["own"] = {"source": "photos", "path": str(tmp_path)}
    demo["scenes"]["true"] = {"source": "courtyard", "poses": "truth"}
    experiment = experiment_of(demo)
    keys = {
        name: json.loads(plan.scene_config(experiment, name)).keys()
        for name in experiment.scenes
    }
    assert keys["courtyard"] >= {"courtyard", "colmap"}
    assert "courtyard" not in keys["own"]
    assert "colmap" not in keys["true"]


def test_the_default_kind_of_pose_error_changes_no_job(demo, experiment_of):
    """Poses of before the key `perturb_by` are not made anew."""
    courtyard = demo["scenes"]["courtyard"]
    demo["scenes"] |= {
        by: courtyard | {"perturb_by": by} for by in ("rotation", "translation")
    }
    experiment = experiment_of(demo)
    told = {one: plan.scene_config(experiment, one) for one in experiment.scenes}
    assert told["rotation"] == told["courtyard"]
    assert "perturb_by" not in told["courtyard"]
    assert json.loads(told["translation"])["perturb_by"] == "translation"
    first, same, other = scenes.of_experiment(experiment)
    assert first.alike == same.alike != other.alike


def test_the_weights_of_lpips_reach_the_command(demo, tmp_path, experiment_of):
    (tmp_path / "my weights.npz").touch()
    path = str(tmp_path / "my weights.npz")
    demo["lpips"] = {"vgg": path, "alex": None}
    job = {"training": "mipnerf360/round0", "moved": ""}
    found = cases.options("evaluate", experiment_of(demo), "courtyard", **job)
    assert found["lpips-vgg"] == path
    assert "lpips-alex" not in found
    job["moved"] = "_aligned_pose"
    found = cases.options("evaluate", experiment_of(demo), "courtyard", **job)
    assert "lpips-vgg" not in found


def test_flows_made_elsewhere_reach_the_commands(demo, experiment_of):
    template = "my flows/{scene}/{method}-{round}-{split}"
    demo["flow"] = {"estimator": "files", "folder": template}
    experiment = experiment_of(demo)
    # A rule knows the folder of a training; the command puts the split in.
    job = {"training": "mipnerf360/round1"}
    found = cases.options("align", experiment, "courtyard", **job)
    assert found["method"] == "files"
    assert found["flows"] == "my flows/courtyard/mipnerf360-1-{split}"
    found = cases.options("testset", experiment, "courtyard")
    assert found["flows"] == "my flows/courtyard/mipnerf360_large-2-test"
    # For images that we make ourselves it is the default estimator.
    assert "method" not in cases.options("control_sets", experiment, "courtyard")


def test_a_scenes_complete_config_is_a_config(demo, experiment_of):
    demo["scenes"]["again"] = demo["scenes"]["courtyard"] | {"seed": 1}
    experiment = experiment_of(demo)
    alone = json.loads(plan.complete_config(experiment, "again"))
    assert alone["scenes"].keys() == {"again"}
    again = experiment_of(alone)
    for method in experiment.methods:
        found = experiment.rounds_of("again", method)
        assert again.rounds_of("again", method) == found
    poses = plan.scene_config(experiment, "again")
    assert plan.scene_config(again, "again") == poses
    # Tables follow the config's order, and what a method is set against.
    assert again.all_rounds("again") == experiment.all_rounds("again")
    table = rows.as_json(rows.of_scene(experiment, "again"))
    assert rows.as_json(rows.of_scene(again, "again")) == table
