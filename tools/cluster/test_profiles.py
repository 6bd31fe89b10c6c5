"""The profiles of clusters name what the workflow has."""

import re

import pytest
import yaml

ON_ACCELERATORS = {"train", "render", "align_test_poses"}
MEASURING = {"preflight"}


@pytest.fixture(scope="module")
def profiles(root):
    return {
        path.parent.name: yaml.safe_load(path.read_text())
        for path in (root / "profiles").glob("*/config.yaml")
    }


@pytest.fixture(scope="module")
def rules(root):
    text = "".join(path.read_text() for path in (root / "workflow/rules").glob("*.smk"))
    return {*re.findall(r"^rule (\w+):", text, re.MULTILINE)}


@pytest.mark.parametrize("name", ["slurm", "slurm_gpu", "kubernetes"])
def test_only_rules_that_there_are(profiles, rules, name):
    named = {*profiles[name].get("set-threads", {}), *profiles[name]["set-resources"]}
    assert named <= rules


def test_all_that_trains_or_renders_has_an_accelerator(profiles):
    for name in ("slurm_gpu", "kubernetes"):
        found = profiles[name]["set-resources"]
        having = {rule for rule, said in found.items() if said.get("gpu") == 1}
        assert having == ON_ACCELERATORS | MEASURING


def test_a_training_has_as_many_cores_on_every_node(profiles):
    """The machine that submits says nothing of those that compute."""
    for name in ("slurm", "slurm_gpu"):
        threads = profiles[name]["set-threads"]
        trained = ON_ACCELERATORS | MEASURING
        assert {*threads} == trained | {"poses"}
        count = {threads[rule] for rule in trained}
        of_training = profiles[name]["set-resources"]["preflight"]["of_training"]
        assert count == {of_training}


def test_with_accelerators_nothing_else_is_different(profiles):
    unlike = ("set-threads", "set-resources")
    plain, gpu = (
        {key: value for key, value in profiles[name].items() if key not in unlike}
        for name in ("slurm", "slurm_gpu")
    )
    assert plain == gpu
