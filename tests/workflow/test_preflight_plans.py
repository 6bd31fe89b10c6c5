"""What asks for a scene's cost, and that `preview` trains nothing."""

import re

import pytest
import yaml


def planned(output):
    stats = output.split("Job stats:")[1].split("\n\n")[0]
    return {m[1]: int(m[2]) for m in re.finditer(r"^(\w+) +(\d+)$", stats, re.M)}


@pytest.fixture
def options(tmp_path, demo):
    demo["scenes"]["other"] = demo["scenes"]["courtyard"]
    demo["methods"]["joint"] = {"model": "base", "pose_optimization": {}}
    demo["methods"]["in_loop"] = {"model": "base", "align": {"shrink": 2}}
    demo["preflight"] = True
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump(demo, sort_keys=False))
    return tmp_path, "--configfile", path, "-n"


def test_no_training_has_its_scenes_cost_as_an_input(options, dry_run):
    """Measured anew it makes nothing again; the page says it."""
    code, output = dry_run(*options)
    assert code == 0, output
    assert planned(output)["preflight"] == 2
    jobs = re.split(r"\n(?=(?:rule|localrule|checkpoint) )", output)
    asking = [x.split(":")[0] for x in jobs if re.search(r"input: .*preflight", x)]
    assert asking == ["rule page"] * 2


def test_a_preview_trains_nothing(options, dry_run):
    config = yaml.safe_load(options[2].read_text())
    config["decide"] = True
    options[2].write_text(yaml.safe_dump(config, sort_keys=False))
    code, output = dry_run(*options, "preview")
    assert code == 0, output
    assert planned(output) == {
        "poses": 2,
        "facts": 2,
        "preflight": 2,
        "preview": 1,
        "total": 7,
    }


def test_without_it_nothing_is_measured(options, dry_run):
    config = yaml.safe_load(options[2].read_text())
    options[2].write_text(yaml.safe_dump(config | {"preflight": False}))
    code, output = dry_run(*options, "preview")
    assert code == 0, output
    assert "preflight" not in planned(output)
