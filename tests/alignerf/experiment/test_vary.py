"""Seeds and lengths that every scene is run with."""

import copy

import pytest

from alignerf.experiment import check


def test_every_scene_with_every_seed_and_length(demo):
    demo["scenes"]["timed"] = {"source": "courtyard", "budget_min": 3}
    demo["vary"] = {"seeds": [4, 7], "lengths": [0.25, 1]}
    config = check.checked(copy.deepcopy(demo))
    steps = config.training.steps
    found = {
        name: (scene.seed, scene.steps, scene.budget_min)
        for name, scene in config.scenes.items()
    }
    assert found == {
        "courtyard": (4, steps, None),
        "courtyard_x0.25": (4, steps // 4, None),
        "courtyard_seed7": (7, steps, None),
        "courtyard_seed7_x0.25": (7, steps // 4, None),
        "timed": (4, None, 3),
        "timed_x0.25": (4, None, 0.75),
        "timed_seed7": (7, None, 3),
        "timed_seed7_x0.25": (7, None, 0.75),
    }
    # Where another key means the first scene, it is the one as written.
    assert next(iter(found)) == "courtyard"
    assert config.vary is None
    again = check.checked(config.model_dump())
    assert again == config


def test_what_cannot_be_varied_is_named(demo):
    demo["vary"] = {"seeds": [0, 2]}
    demo["scenes"]["courtyard_seed2"] = {"source": "courtyard"}
    with pytest.raises(ValueError, match="vary: there would be two scenes courtyard_s"):
        check.checked(copy.deepcopy(demo))
    demo["scenes"]["courtyard_seed2"]["seed"] = 5
    with pytest.raises(ValueError, match=r"scenes.courtyard_seed2.seed: not beside va"):
        check.checked(copy.deepcopy(demo))
    demo["vary"] = {"lengths": [1000]}
    demo["scenes"]["courtyard"]["steps"] = 10**6
    with pytest.raises(ValueError, match=r"scenes.courtyard_x1000.steps: .* less"):
        check.checked(copy.deepcopy(demo))
    demo["vary"] = {"seeds": [2, 2]}
    demo["scenes"].pop("courtyard_seed2")
    with pytest.raises(ValueError, match="vary: there would be two scenes courtyard"):
        check.checked(copy.deepcopy(demo))
