"""What waits for a scene's cost, and that `preview` trains nothing."""

import os
import re

import pytest
import yaml

from alignerf.files import owned


def planned(output):
    stats = output.split("Job stats:")[1].split("\n\n")[0]
    return {m[1]: int(m[2]) for m in re.finditer(r"^(\w+) +(\d+)$", stats, re.M)}


@pytest.fixture
def options(tmp_path, demo):
    demo["scenes"]["other"] = demo["scenes"]["courtyard"]
    demo["methods"]["warm"] = {
        "model": "base",
        "rounds": 1,
        "warm_start": {"from": "mipnerf360"},
    }
    demo["methods"]["joint"] = {"model": "base", "refine": {}}
    demo["methods"]["on_the_way"] = {"model": "base", "align": {"shrink": 2}}
    demo["preflight"] = True
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump(demo, sort_keys=False))
    return tmp_path, "--configfile", path, "-n"


def test_every_training_waits_for_its_scenes_cost(options, dry_run):
    code, output = dry_run(*options)
    assert code == 0, output
    assert planned(output)["preflight"] == 2
    jobs = re.split(r"\n(?=(?:rule|localrule|checkpoint) )", output)
    trained = set()
    for job in (job for job in jobs if job.startswith("rule train:")):
        scene, folder = re.search(r"output: results/(\w+)/(\w+/\w+)/", job).groups()
        assert f"results/{scene}/preflight.json" in job, job
        trained.add((scene, folder))
    # Of every kind.
    folders = {"mipnerf360/round0", "warm/round1", "joint/round0", "on_the_way/round0"}
    folders |= {"pretrain/base", "alignerf/round0"}
    scenes = ("courtyard", "other")
    assert trained >= {(scene, folder) for scene in scenes for folder in folders}


def test_a_preview_trains_nothing_also_where_rounds_are_to_be_decided(options, dry_run):
    config = yaml.safe_load(options[2].read_text())
    config["methods"]["auto"] = {"model": "base", "rounds": "auto"}
    config["decide"] = True
    options[2].write_text(yaml.safe_dump(config, sort_keys=False))
    code, output = dry_run(*options, "preview")
    assert code == 0, output
    assert planned(output) == {
        "config": 2,
        "poses_courtyard": 2,
        "facts": 2,
        "decisions": 2,
        "preflight": 2,
        "preview": 1,
        "total": 11,
    }


def test_without_it_nothing_is_measured(options, dry_run):
    """The file stays an input: a training is not made again for the switch."""
    config = yaml.safe_load(options[2].read_text())
    options[2].write_text(yaml.safe_dump(config | {"preflight": False}))
    code, output = dry_run(*options, "-p", "preview")
    assert code == 0, output
    assert planned(output)["preflight"] == 2
    assert output.count("--work null") == 2


def test_a_cost_older_than_the_scene_hides_no_training(options, dry_run):
    """As after a run that was stopped between the poses and the preflight.

    Of jobs whose `ancient` input is made again Snakemake plans none, and exits with 0.
    """
    folder, *arguments = options
    arguments += ["--rerun-triggers", "mtime"]
    _, before = dry_run(folder, *arguments)
    made = re.findall(r"rule poses_courtyard:\n +output: (.*)", before)
    for path in (folder / name for names in made for name in names.split(", ")):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("") if path.suffix else path.mkdir()
    scenes = sorted((folder / "results").iterdir())
    for scene in scenes:
        owned.put(scene)
        cost = scene / "preflight.json"
        cost.write_text("{}")
        os.utime(cost, (1e9, 1e9))
    code, output = dry_run(folder, *arguments)
    assert code == 0, output
    assert len(scenes) == 2
    wanted = planned(before)
    wanted["total"] -= wanted.pop("poses_courtyard")
    assert planned(output) == wanted
    assert wanted["train"] > 2
