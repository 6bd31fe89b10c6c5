"""Plans of films: what they need, and what is made again."""

import re
import shlex

import yaml

from alignerf.experiment.tables import json_rows, sides
from tests.workflow.test_plans import jobs_of


def plan(tmp_path, dry_run, config, target="flythrough"):
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump(config, sort_keys=False))
    words = ("-n", "-p", target, "--configfile", path)
    code, output = dry_run(tmp_path, *words)
    assert code == 0, output
    return output


def test_a_film_needs_two_trainings_and_their_test_views(tmp_path, demo, dry_run):
    output = plan(tmp_path, dry_run, demo)
    jobs = jobs_of(output)
    assert jobs.items() >= {"train": 2, "render": 2}.items()
    assert jobs["camera_path"] == jobs["flythrough_scene"] == jobs["flythrough"] == 1
    assert not jobs.keys() & {"testset", "evaluate", "page", "verdict"}
    (command,) = re.findall(r"python -m alignerf\.flythrough --.*", output)
    words = shlex.split(command.partition(" 2>&1")[0])
    given = dict(zip(words[3::2], words[4::2], strict=True))
    assert given["--out"] == "results/courtyard/flythrough.webm"
    assert given["--frames"] == "results/courtyard/flythrough_frames"
    assert given["--camera-path"] == "results/courtyard/camera_path.json"
    found = json_rows.read(sides.Side, given["--sides"], "--sides")
    assert [one.label for one in found] == ["before (mipnerf360)", "after (aligned)"]


def test_renders_of_others_have_a_path(tmp_path, demo, dry_run):
    demo["methods"] = {
        "theirs": {"external": {"train": "a {data}", "render": "b {renders}"}}
    }
    jobs = jobs_of(plan(tmp_path, dry_run, demo))
    assert jobs["camera_path"] == 1
    assert not jobs.keys() & {"external_train", "flythrough_scene"}


def test_the_page_has_the_film_that_somebody_has_asked_for(tmp_path, demo, dry_run):
    page, film = "results/courtyard/index.html", sides.film_of("courtyard")
    assert "flythrough_scene" not in jobs_of(plan(tmp_path, dry_run, demo, page))
    (tmp_path / film).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / film).touch()
    output = plan(tmp_path, dry_run, demo, page)
    # Of other models than those that are trained now it is made anew.
    assert jobs_of(output)["flythrough_scene"] == 1
    (inputs,) = re.findall(r"^rule page:\n    input: (.*)$", output, re.MULTILINE)
    assert film in inputs.split(", ")
