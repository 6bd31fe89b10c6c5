"""Decisions by constructed facts: they follow what decides them, and say why."""

import json
import math

import jax.numpy as jnp
import numpy as np
import pytest

from alignerf import facts
from alignerf.causes.shared import misalignment
from alignerf.experiment import decisions as rules
from alignerf.experiment.keys import training as training_keys
from alignerf.mipnerf360 import coord
from alignerf.systems import base

FACTS = {
    "nearest": 0.5,
    "median_depth": 1.0,
    "pixel_angle_mrad": 4.0,
    "train_views": 50,
    "width_px": 400,
    "height_px": 300,
}


def decided(**changes):
    return {d.key: d for d in rules.decide(FACTS | changes)}


def test_every_key_that_a_config_can_leave_open_has_a_rule():
    names = {key.rpartition(".")[2] for key in decided()}
    assert names == {*rules.OPEN}


@pytest.mark.parametrize("nearest", [1e-3, 0.5, 14.0])
def test_samples_begin_before_the_nearest_point(nearest):
    found = decided(nearest=nearest)["model.near"]
    assert found.value == pytest.approx(rules.NEAR_FRACTION * nearest, rel=1e-2)
    assert found.default == base.USUAL["near"]
    assert found.facts == {"nearest": nearest}


@pytest.mark.parametrize(("nearest", "radius"), [(0.5, 1.0), (1.0, 1.0), (4.0, 4.0)])
def test_contraction_begins_where_the_scene_does(nearest, radius):
    assert decided(nearest=nearest)["model.radius"].value == radius


@pytest.mark.parametrize(
    ("angle_mrad", "depth", "nearest"),
    [(4.0, 1.0, 0.5), (1.0, 1.0, 0.5), (4.0, 3.0, 0.5), (2.0, 7.0, 4.0)],
)
def test_finest_cells_are_of_a_pixels_size(angle_mrad, depth, nearest):
    facts = {"pixel_angle_mrad": angle_mrad, "median_depth": depth, "nearest": nearest}
    found = decided(**facts)
    cell = rules.CONTRACTED_SIDE / found["model.field.max_resolution"].value
    # Two neighbouring pixels' points, through the contraction that the model has.
    points = np.array([[depth, 0, 0], [depth, 1e-3 * angle_mrad * depth, 0]])
    points = np.float32(points / found["model.radius"].value)
    across = np.linalg.norm(np.diff(coord.contract(jnp.asarray(points)), axis=0))
    # A power of 2.
    assert abs(math.log2(cell / across * rules.CELLS_A_PIXEL)) <= 0.51


def test_steps_grow_with_pixels_within_bounds():
    found = [
        decided(train_views=n)["training.steps"].value for n in (1, 50, 100, 10**4)
    ]
    assert found[0] == rules.STEPS[0]
    assert found[-1] == rules.STEPS[1]
    assert found[2] == pytest.approx(2 * found[1], rel=0.02)
    seen = found[1] * training_keys.Training().batch_rays / (50 * 400 * 300)
    assert seen == pytest.approx(rules.EPOCHS, rel=0.02)
    # As often as the verdict asks, below which a training is called short.
    assert seen >= misalignment.FEW_EPOCHS


@pytest.mark.parametrize(
    ("fact", "key"),
    [
        ("nearest", "model.near"),
        ("nearest", "model.radius"),
        ("median_depth", "model.field.max_resolution"),
    ],
)
def test_what_is_not_known_decides_nothing(fact, key):
    found = decided(**{fact: None})[key]
    assert found.value == found.default
    assert fact in found.reason


@pytest.mark.parametrize("nearest", [0.0, -1.0, math.nan, math.inf, 1e-9, 1e30])
def test_what_is_no_length_decides_nothing_impossible(nearest):
    found = decided(nearest=nearest, median_depth=nearest)
    assert rules.LENGTHS[0] <= found["model.near"].value <= rules.LENGTHS[1]
    assert 1 <= found["model.radius"].value <= rules.LENGTHS[1]
    least, most = rules.FINEST
    assert least <= found["model.field.max_resolution"].value <= most


def test_a_downscale_is_said_where_it_was_decided():
    photo = {"photo_width_px": 4000, "photo_height_px": 3000, "views": 50}
    found = decided(downscale_decided=True, downscale=8, **photo)["scenes.downscale"]
    assert (found.value, found.default) == (8, 1)
    assert "600 million" in found.reason
    assert "scenes.downscale" not in decided(downscale_decided=False)


def test_a_line_says_key_value_and_reason():
    line = rules.line(decided(nearest=14.0)["model.near"])
    assert (
        line
        == "suggested: model.near 8.4 (default 0.2): the nearest points are 14 away"
    )
    assert "(the default): " in rules.line(decided(nearest=None)["model.near"])


def test_files_are_shown_below_their_scene(tmp_path, capsys):
    (tmp_path / "decisions.json").write_text(
        json.dumps({"decisions": [d._asdict() for d in rules.decide(FACTS)]})
    )
    facts.main(["--show", str(tmp_path / "decisions.json"), "--unasked"])
    first, *lines, last = capsys.readouterr().out.splitlines()
    assert first == f"{tmp_path.name}: by its facts"
    assert lines == [f"  {rules.line(d)}" for d in rules.decide(FACTS)]
    assert "uses none" in last
