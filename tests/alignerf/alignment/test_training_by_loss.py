"""A training with the aligned loss: its look, resuming, and every system's model."""

import json

import jax
import numpy as np
import pytest
from PIL import Image

from alignerf.alignment import loss
from alignerf.contributions import aligned_loss
from alignerf.training import compose, loop
from tests import job_cases as cases
from tests import training_cases
from tests.alignerf.systems.test_systems import SYSTEMS

OWN = {"start_fraction": 0.3, "radius_px": 3, "patch_px": 12, "patch_rays": 32}
SEARCHES = cases.JOB | {"aligned_loss": OWN | {"min_move_px": 0.0}}
STAYS = cases.JOB | {"aligned_loss": OWN | {"min_move_px": 50.0}}
# Of 14 steps.
PLACE = 4


@pytest.fixture(scope="module")
def whole(folder, tmp_path_factory):
    """A training that searches: (folder, bytes of its model)."""
    out = tmp_path_factory.mktemp("whole")
    return out, cases.run(folder, out, SEARCHES)


def timing_of(out):
    return json.loads((out / "timing.json").read_text())


def test_it_says_what_its_look_found(whole):
    (row,) = timing_of(whole[0])["alignments"]
    assert (row["step"], row["searching"]) == (PLACE, True)
    assert 0 <= row["offset_px"] <= np.hypot(3.5, 3.5)
    assert 0 < row["time_s"] < timing_of(whole[0])["train_time_s"]


def test_what_it_gathers_is_no_parameter_of_the_model(whole, uninterrupted):
    ours, plain = timing_of(whole[0]), timing_of(uninterrupted)
    assert ours["params"] == plain["params"]
    assert np.array(cases.params_of(whole[0])["costs"]).any()


def test_where_photos_are_not_off_it_is_plain_to_the_bit(
    folder, uninterrupted, tmp_path
):
    cases.run(folder, tmp_path, STAYS)
    assert not timing_of(tmp_path)["alignments"][0]["searching"]
    own, plain = map(cases.params_of, (tmp_path, uninterrupted))
    assert not np.array(own.pop("costs")).any()
    jax.tree.map(np.testing.assert_array_equal, own, plain)


def test_searching_is_another_training(whole, uninterrupted):
    own, plain = cases.params_of(whole[0]), cases.params_of(uninterrupted)
    assert not np.array_equal(
        *(np.ravel(jax.tree.leaves(tree["model"])[0]) for tree in (own, plain))
    )


@pytest.mark.parametrize("at_step", cases.one_of([2, PLACE, 8], 8))
def test_killed_before_or_after_its_look_it_resumes_bit_for_bit(
    folder, whole, tmp_path, monkeypatch, at_step
):
    monkeypatch.setattr(loop, "FETCH_EVERY", 2)
    with monkeypatch.context() as patched:
        cases.kill_after_save(patched, at_step, 2)
        with pytest.raises(cases.Killed):
            cases.run(folder, tmp_path, SEARCHES)
    assert cases.run(folder, tmp_path, SEARCHES) == whole[1]
    (row,) = timing_of(tmp_path)["alignments"]
    assert row["step"] == PLACE


DAMAGES = [
    lambda text: "[]",
    lambda text: text.replace('"identity": "', '"identity": "x'),
    lambda text: text.replace("true", '"no"'),
    lambda text: text.replace('"row": {', '"row": [5], "other": {'),
    lambda text: text[:9],
]


def test_a_damaged_look_starts_the_training_anew(
    folder, whole, tmp_path, monkeypatch, caplog
):
    monkeypatch.setattr(loop, "FETCH_EVERY", 2)
    with monkeypatch.context() as patched:
        cases.kill_after_save(patched, 8, 2)
        with pytest.raises(cases.Killed):
            cases.run(folder, tmp_path, SEARCHES)
    (path,) = tmp_path.rglob(loss.FILE)
    text, look = path.read_text(), loss.Look(None, None, path.parent)
    look.identity = json.loads(text)["identity"]
    assert look.read()
    for change in DAMAGES:
        path.write_text(change(text))
        assert look.read() is None
    assert cases.run(folder, tmp_path, SEARCHES) == whole[1]
    assert "its alignment is lost, starting anew" in caplog.text


def test_a_wall_without_texture_does_not_switch_the_search_on(tmp_path):
    """Noise alone has a best offset, too, of another length each time."""
    folder = cases.make_scene(tmp_path, width=64, height=48)
    rng = np.random.default_rng(1)
    for path in (folder / "images").glob("*.png"):
        wall = np.clip(rng.normal(128, 6, (48, 64, 3)), 0, 255)
        Image.fromarray(wall.astype(np.uint8)).save(path)
    own = OWN | {"patch_rays": 256, "patch_px": 16}
    cases.run(folder, tmp_path, cases.JOB | {"aligned_loss": own})
    (row,) = timing_of(tmp_path)["alignments"]
    assert row["offset_px"] < 0.4
    assert not row["searching"]


def test_a_search_beyond_the_photos_is_refused(folder, tmp_path):
    job = cases.JOB | {"aligned_loss": OWN | {"radius_px": 20}}
    with pytest.raises(ValueError, match="radius_px: 20 searches 41 px"):
        cases.run(folder, tmp_path, job)
    assert not (tmp_path / "learnt").exists()


@pytest.mark.parametrize("kind", cases.one_of([*SYSTEMS, "mipnerf360"], "ngp"))
def test_it_trains_any_system(kind):
    """The model keeps its own loss and sampling; its photos are the aligned ones."""
    if kind == "mipnerf360":
        method = training_cases.baseline()
    else:
        job = training_cases.job_of(kind=kind, **SYSTEMS[kind])
        method = compose.make_method(job)
    views = training_cases.make_views(valid_fraction=1.0)
    state, step = training_cases.start(training_cases.aligned_loss(method))
    for _ in range(3):
        state, shown = step(state, views)
    assert int(state.step) == 3
    assert np.isfinite(float(shown["loss"]))
    costs = np.array(state.params["costs"])
    assert np.isfinite(costs).all()
    assert (costs >= 0).all()
    assert costs.any()
    offsets = aligned_loss.offsets_px(state.params["costs"], 32, 0.01)
    assert np.isfinite(np.array(offsets)).all()
