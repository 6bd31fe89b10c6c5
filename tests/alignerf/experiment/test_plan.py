"""An experiment: which methods and rounds it has, and where they lie."""

import json
import re
from pathlib import Path

import pytest

from alignerf import methods
from alignerf.experiment import plan, sources, targets, trainings
from alignerf.experiment.steps import scenes
from alignerf.experiment.tables import rows
from tests import step_cases as cases


def test_a_round_changes_photos_or_cameras(demo, experiment_of):
    demo["methods"] = {
        "warped": {"model": "base", "rounds": 2},
        "moved": {"model": "base", "rounds": 2, "changes": "cameras"},
    }
    experiment = experiment_of(demo)
    photos = "results/courtyard/images"

    def of(method, round):
        found = experiment.at("courtyard", method, round)
        corrected = trainings.moved_for(found)
        cameras = found.cameras.removeprefix("results/courtyard/")
        as_taken, masked = found.photos == photos, "valid" in found.inputs()
        return cameras, as_taken, masked, len(corrected)

    # What is the same is trained once, under the first one's name.
    assert experiment.all_rounds("courtyard") == [
        *(("warped", k) for k in range(3)),
        *(("moved", 1), ("moved", 2)),
    ]
    assert (
        experiment.folder("courtyard", "moved", 0) == "results/courtyard/warped/round0"
    )
    assert experiment.followed("courtyard") == {
        *("warped/round0", "warped/round1", "moved/round1"),
    }
    assert of("warped", 2) == ("cameras.npz", False, True, 0)
    assert of("moved", 0) == ("cameras.npz", True, False, 0)
    # They lie with the training whose flow has put them right.
    assert of("moved", 2) == ("moved/round1/corrected/cameras.npz", True, False, 2)


def test_a_pretraining_is_a_row_that_only_leads_to_others(demo, experiment_of):
    demo["methods"] = {"alignerf": {"model": "base", "alignerf": {}}}
    first, last = rows.collected(experiment_of(demo), "courtyard", [("alignerf", 0)])
    assert (first.folder, first.method) == ("pretrain/base", None)
    assert first.files == {
        "timing": "results/courtyard/pretrain/base/timing.json",
        "process": "results/courtyard/pretrain/base/logs/train.tsv",
    }
    assert last.way == ["pretrain/base", "alignerf/round0"]
    assert last.flows == last.corrected == []


def test_staged_methods_are_set_against_plain_ones(demo, experiment_of):
    demo["models"]["alone"] = demo["models"]["base"]
    staged = demo["methods"]["alignerf"]
    demo["methods"]["staged_alone"] = staged | {"model": "alone"}
    experiment = experiment_of(demo)
    found = {m: methods.of_method(one).key for m, one in experiment.methods.items()}
    assert found == {
        "mipnerf360_large": None,
        "mipnerf360": None,
        "adjusted_poses": "adjust",
        "aligned": "align",
        "alignerf": "alignerf",
        "staged_alone": "alignerf",
    }
    assert {m: experiment.baseline(m) for m in experiment.methods} == {
        "mipnerf360_large": "mipnerf360_large",
        "mipnerf360": "mipnerf360",
        "aligned": "mipnerf360",
        "adjusted_poses": "mipnerf360",
        "alignerf": "mipnerf360",
        "staged_alone": "staged_alone",
    }
    compared = [row.method for row in scenes.compared(experiment, "courtyard")]
    plain = ["mipnerf360", "mipnerf360, round 2", "staged_alone"]
    assert compared == [*plain, "adjusted_poses", "aligned", "alignerf"]


def test_training_views_are_followed_where_something_comes_from_them(
    demo, experiment_of
):
    demo["methods"] = {
        "large": {"model": "large", "rounds": 2},
        "base": {"model": "base", "rounds": 0},
        "moved": {"model": "base", "rounds": 1, "changes": "cameras"},
        "fixed": {"model": "base", "alignerf": {"radius_px": 2}},
    }
    demo["reference"] = {"method": "large"}
    always = {"large/round0", "large/round1"}
    found = experiment_of(demo).followed("courtyard")
    assert found == always | {"base/round0"}
    del demo["methods"]["moved"]
    assert experiment_of(demo).followed("courtyard") == always
    # Where a method aligns itself, the verdict looks at the reference's.
    demo["methods"] = {"base": {"model": "base"}}
    demo["reference"] = {"method": "base"}
    assert experiment_of(demo).followed("courtyard") == set()
    demo["methods"]["aligned"] = {"model": "base", "align": {}}
    assert experiment_of(demo).followed("courtyard") == {"base/round0"}


def test_lengths_of_a_method_are_some_scenes_and_its_baselines(demo, experiment_of):
    plain, loss = {"lengths": [1]}, {"aligned_loss": {}, "lengths": [7]}
    config = demo | {"methods": {"plain": plain, "loss": loss}}
    with pytest.raises(ValueError, match=r"loss\.lengths: no scene is trained"):
        plan.check_lengths(experiment_of(config))
    config["vary"] = {"lengths": [1, 7]}
    with pytest.raises(ValueError, match=r"loss\.lengths: plain, its baseline, lacks"):
        plan.check_lengths(experiment_of(config))


def test_folders_of_trainings_become_a_pattern(demo, experiment_of):
    demo["methods"]["warped"] = {"model": "base", "rounds": 11}
    experiment = experiment_of(demo)
    pattern = re.compile(
        f"results/courtyard/({plan.folders([experiment])})/timing.json"
    )
    for folder in experiment.trainings("courtyard"):
        assert pattern.fullmatch(f"results/courtyard/{folder}/timing.json")[1] == folder
    for folder in (
        *("warped/round11", "pretrain/base"),
        *("aligned/round0", "alignerf/round0"),
    ):
        assert folder in experiment.trainings("courtyard")
    for folder in (
        *("other/round7", "warped/round01", "warped/round", "warped", "pretrain/none"),
        *("x/warped/round0", "warped/round0/corrected"),
    ):
        assert not pattern.fullmatch(f"results/courtyard/{folder}/timing.json")


def test_the_truth_is_known_of_the_embedded_scene(demo, tmp_path, experiment_of):
    demo["scenes"]["own"] = {"source": "photos", "path": str(tmp_path)}
    experiment = experiment_of(demo)
    assert [n for n in experiment.scenes if experiment.has_truth(n)] == ["courtyard"]
    assert [n for n in experiment.scenes if not experiment.has_truth(n)] == ["own"]
    assert experiment.truth_of("own") is None
    assert experiment.truth_of("courtyard") == "results/courtyard/images/truth"
    made = targets.of_scene(experiment, "courtyard")
    own = targets.of_scene(experiment, "own")
    assert "results/courtyard/tables/ranking.csv" in made
    assert "results/own/tables/ranking.csv" not in own
    assert "results/own/index.html" in own
    assert len(made) == len(own) + 2
    assert "results/own/figures/crops.png" in own


def test_names_become_a_pattern_that_matches_them_alone():
    assert plan.one_of(["a.b", "c"]) == r"(?:a\.b|c)"
    assert plan.one_of([]) == "(?!)"
    names = ["scene_1", "scene_10", "scene_2", "my-yard.1"]
    found = re.compile(f"results/({plan.one_of(names)})/")
    assert [found.fullmatch(f"results/{name}/")[1] for name in names] == names
    for name in ("scene_", "scene_100", "my-yardx1", ""):
        assert found.fullmatch(f"results/{name}/") is None


def test_a_change_of_code_or_of_versions_changes_a_job(tmp_path, monkeypatch):
    for name, text in {
        "alignerf/__init__.py": "",
        "alignerf/stage.py": "from alignerf.part import thing\n",
        "alignerf/part/__init__.py": "",
        "alignerf/part/thing.py": "import json\n",
        "alignerf/part/other.py": "",
        "alignerf/part/page.html": "",
        "alignerf/part/vendor/slider.js": "",
        "requirements.lock": "jax==1",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(sources, "ROOT", tmp_path)

    def hash_of(path=None, text=""):
        sources.sources_of.cache_clear()
        sources.imports.cache_clear()
        if path:
            (tmp_path / path).write_text(text)
        return sources.sources_of("alignerf.stage")

    first = hash_of()
    assert hash_of("alignerf/part/other.py", "x = 1\n") == first
    changed = {
        hash_of("alignerf/part/thing.py", "import json\n\n"),
        hash_of("alignerf/stage.py", "from alignerf.part import thing, other\n"),
        hash_of("requirements.lock", "jax==2"),
        # What a package holds besides modules is as good as code.
        hash_of("alignerf/part/page.html", "<p>"),
        hash_of("alignerf/part/vendor/slider.js", "0"),
    }
    assert len(changed | {first}) == 6
    sources.sources_of.cache_clear()
    sources.imports.cache_clear()


def test_a_package_that_runs_is_its_main(root):
    found = {path.name for path in sources.reached("alignerf.verdict")}
    # And that of a registry, all that is registered there.
    assert {"__main__.py", "__init__.py", "csv_files.py", "blur.py"} <= found


def test_jobs_find_the_sources_and_this_python(monkeypatch, root):
    monkeypatch.setenv("PATH", "/somewhere")
    monkeypatch.setenv("PYTHONPATH", "")
    for name in ("DIR", "MIN_COMPILE_TIME_SECS"):
        kind = "COMPILATION" if name == "DIR" else "PERSISTENT"
        monkeypatch.setenv(f"JAX_{kind}_CACHE_{name}", "as it was")
    for _ in range(2):
        sources.set_environment()
    import os

    assert os.environ["PYTHONPATH"] == str(root)
    assert os.environ["PATH"].endswith(f"{os.pathsep}/somewhere")
    assert os.environ["PATH"].count(os.pathsep) == 1
    assert os.environ["JAX_COMPILATION_CACHE_DIR"] == "as it was"


def test_the_cause_of_a_failure_is_its_jobs_last_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    logs = {
        "a.log": "fine\nerror: x.jpg is broken\n",
        "b c.log": "step 1\rstep 2  eta 3:00\n",
        "e f.log": "error: y.jpg is broken\n",
        "d.log": "Traceback (most recent call last):\n  File\nKeyError: 'x'\n",
    }
    for name, text in logs.items():
        Path(name).write_text(text)
    Path("snakemake.log").write_text(
        "    log: a.log (check log file(s) for error details)\n"
        "Command 'set -e; python 2>&1 | tee a.log' returned non-zero exit status 1.\n"
        "Command 'python 2>&1 | tee 'b c.log'' returned non-zero exit status 137.\n"
        "    log: d.log (check log file(s) for error details)\n"
        "Command 'set -e; python > 'e f.log' 2>&1' returned non-zero exit status 1.\n"
        "    log: none.log (check log file(s) for error details)\n"
    )
    found = targets.causes(["snakemake.log"])
    assert sorted(found[:-1:2]) == [
        "error: KeyError: 'x'",
        "error: a job stopped without a word (killed, or out of memory?); its last "
        "line: step 2  eta 3:00",
        "error: x.jpg is broken",
        "error: y.jpg is broken",
    ]
    assert set(found[1:-1:2]) == {f"  in {name}" for name in logs}
    with open("snakemake.log", "a") as file:
        file.write("Terminating processes on user request, this might take some time")
    assert targets.causes(["snakemake.log"])[0] == "stopped, as asked."
    Path("snakemake.log").write_text("nothing of the kind")
    assert targets.causes(["snakemake.log"]) == []


def test_what_is_asked_of_each_scene_is_found_once(demo, experiment_of):
    demo["methods"]["moved"] = {"model": "base", "rounds": 1, "changes": "cameras"}

    def found(count):
        (scene,) = demo["scenes"].values()
        names = [f"scene_{k}" for k in range(count)]
        experiment = experiment_of(demo | {"scenes": dict.fromkeys(names, scene)})
        for name in names:
            targets.of_scene(experiment, name)
            rows.of_scene(experiment, name)
            scenes.seen(experiment, name)
            scenes.compared(experiment, name)
        return experiment.known

    one, many = found(1), found(40)
    of_scenes = {key for key in one if "scene_0" in key}
    # What is of no scene is the same; of each scene there is as much as of one.
    assert one.keys() - of_scenes >= {("in_order",), ("names", "ours")}
    assert all(many[key] == one[key] for key in one.keys() - of_scenes)
    assert len(many) - len(one) == 39 * len(of_scenes)


def with_crops(demo):
    demo["methods"] = {"plain": {}, "aligned": {"align": {}}}
    return demo | {"crops": {"px": 96, "count": 3, "steps": 500}}


def test_crops_are_scenes_beside_the_one_that_they_judge(demo, experiment_of):
    experiment = experiment_of(with_crops(demo))
    assert experiment.captures() == ["courtyard"]
    names = ["courtyard_crops", "courtyard_crops_aligned"]
    assert experiment.crops("courtyard") == names
    assert all(experiment.parent(name) == "courtyard" for name in names)
    given, put_right = (experiment.scenes[name] for name in names)
    assert (given.downscale, given.steps) == (1, 500)
    assert given.crop.cameras is None
    assert put_right.crop.cameras == "aligned"
    # Photos of crops have no truth of their own.
    assert not any(map(experiment.has_truth, names))
    found = cases.options("poses", experiment, names[0])
    assert found["whole"] == "results/courtyard"
    assert found["cameras"] == "results/courtyard/cameras.npz"
    assert "places" not in found
    learnt = "results/courtyard/aligned/round0/learnt"
    found = cases.options("poses", experiment, names[1])
    assert found["cameras"] == f"{learnt}/cameras.npz"
    assert found["places"] == f"results/{names[0]}"
    assert cases.inputs("poses", experiment, names[1])["cameras"] == learnt
    found = cases.options("verdict", experiment, "courtyard")
    assert found["crops"] == f"results/{names[0]}/plain/round0"
    assert found["crops-corrected"] == f"results/{names[1]}/plain/round0"
    assert "train_flow" in scenes.seen(experiment, names[0])


def test_a_complete_config_has_the_same_crops(demo, experiment_of):
    """As results/SCENE/config.yaml has it: crops are scenes there."""
    experiment = experiment_of(with_crops(demo))
    again = experiment_of(json.loads(plan.complete_config(experiment, "courtyard")))
    assert again.scenes == experiment.scenes
    for name in experiment.scenes:
        own = trainings.common(experiment, name, "plain")
        assert trainings.common(again, name, "plain") == own


def test_crops_are_told_apart_by_their_cameras(demo, experiment_of):
    """In any order, and trained without what would move cameras."""
    demo["methods"] = {"plain": {}, "aligned": {"align": {}}}
    demo["reference"] = {"method": "aligned"}
    whole = demo["scenes"]["courtyard"]
    demo["scenes"] = {
        "fixed": whole | {"crop": {"of": "courtyard", "cameras": "aligned"}},
        "as_given": whole | {"crop": {"of": "courtyard"}},
        "courtyard": whole,
    }
    experiment = experiment_of(demo)
    assert scenes.crops(experiment, "courtyard") == {
        "crops_corrected": "results/fixed/plain/round0",
        "crops": "results/as_given/plain/round0",
    }
    again = experiment_of(json.loads(plan.complete_config(experiment, "fixed")))
    assert set(again.scenes) == set(experiment.scenes)


def test_crops_are_as_long_as_their_own_key_says(demo, experiment_of):
    """No place of an aligning method's looks is sought among so few steps."""
    demo = with_crops(demo)
    demo["crops"]["steps"] = 10
    experiment_of(demo)


@pytest.mark.parametrize(
    ("scene", "fault"),
    [
        ({"crop": {"of": "gone"}}, "scenes.other.crop.of: gone is none of the scenes"),
        ({"crop": {"of": "courtyard", "cameras": "plain"}}, "plain is no method"),
        ({"crop": {"count": 2}}, "scenes.other.crop: 'of' is missing"),
    ],
)
def test_crops_of_what_is_not_there(demo, experiment_of, scene, fault):
    demo["methods"] = {"plain": {}, "aligned": {"align": {}}}
    demo["scenes"]["other"] = {"source": "courtyard"} | scene
    with pytest.raises(ValueError, match=fault):
        experiment_of(demo)
