"""What a training refuses, in one line, and what it leaves behind."""

import re
import shutil

import filelock
import jax.numpy as jnp
import numpy as np

from alignerf.experiment import jobs
from alignerf.scenes import prepared
from alignerf.training import compose, loop, memory, program
from alignerf.training import run as train_run
from tests import job_cases as cases


def test_photos_that_do_not_fit_are_one_line(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(memory, "free_bytes", lambda device: 5_000)
    line = cases.stops(capsys, lambda: cases.run(folder, tmp_path))
    wanted = "training views of 7.5 kB do not fit into 5.0 kB of free memory"
    assert line == f"error: {folder / 'images'}: {wanted}"


def test_a_training_that_diverges_stops_with_the_step(
    folder, tmp_path, capsys, monkeypatch
):
    def beyond_bounds(values):
        """A rate that no config may have."""
        job = parse(values)
        wild = {"learning_rates": [1e38, 1e38], "warmup_steps": 0}
        training = job.training.model_copy(update=wild)
        return job.model_copy(update={"training": training})

    parse = jobs.parse
    monkeypatch.setattr(jobs, "parse", beyond_bounds)
    line = cases.stops(capsys, lambda: cases.run(folder, tmp_path))
    assert re.search(r"training diverged at step \d+: not finite: \w+ loss, ", line)
    assert re.search(r"; in rays of v1, v2, v3, all .* parameters reach \d", line)
    assert {path.name for path in tmp_path.rglob("*")} <= {"checkpoints", "lock"}


def test_a_loss_that_stays_above_that_of_the_start_stops(
    folder, tmp_path, monkeypatch, capsys
):
    """What was saved before it rose is kept."""
    method = compose.make_method(jobs.parse(cases.JOB))

    def terms(params, batch, share):
        values, shown = method.terms(params, batch, share)
        return values | {"distortion": jnp.where(share > 0.3, 9.0, 0.1)}, shown

    rising = method._replace(terms=terms)
    monkeypatch.setattr(compose, "make_method", lambda job, loaded: rising)
    monkeypatch.setattr(loop, "CHECKPOINT_EVERY_S", 0.0)
    monkeypatch.setattr(loop, "FETCH_EVERY", 1)
    monkeypatch.setattr(train_run, "MIN_LOOKS", 3)
    line = cases.stops(capsys, lambda: cases.run(folder, tmp_path))
    wanted = r"training diverges before step 9: its loss, 0.\d+ at the start, stays "
    assert re.search(wanted + r"above 9\.\d+; lower learning_rates$", line)
    names = {path.name for path in (tmp_path / "checkpoints").iterdir()}
    assert names >= {"state-7.msgpack", "state-8.msgpack"}
    assert not (tmp_path / "learnt").exists()


def test_the_first_fault_stops_the_job_and_keeps_its_checkpoint(
    folder, tmp_path, monkeypatch, capsys
):
    """At the very step, though numbers are fetched later, and again when resumed."""
    method = compose.make_method(jobs.parse(cases.JOB))

    def terms(params, batch, share):
        values, shown = method.terms(params, batch, share)
        bad = (share > 9.5 / (cases.STEPS - 1)) & jnp.any(batch.view == 1)
        spoilt = values["distortion"] * jnp.where(bad, jnp.nan, 1.0)
        return values | {"distortion": spoilt}, shown

    # One for both trainings, which then compile it once.
    spoilt = method._replace(terms=terms)
    monkeypatch.setattr(compose, "make_method", lambda job, loaded: spoilt)
    monkeypatch.setattr(loop, "CHECKPOINT_EVERY_S", 0.0)
    monkeypatch.setattr(loop, "FETCH_EVERY", 4)
    for _ in range(2):
        line = cases.stops(capsys, lambda: cases.run(folder, tmp_path))
        wanted = "diverged at step 10: not finite: distortion loss; in rays of v2"
        assert line == f"error: training {wanted}"
        names = {path.name for path in (tmp_path / "checkpoints").iterdir()}
        states = {"state-4.msgpack", "state-8.msgpack"}
        assert names - {"lock"} == {"manifest.json", *states}
        assert not (tmp_path / "learnt" / "model.msgpack").exists()


def test_fine_tuning_needs_pretrained_parameters(
    folder, uninterrupted, tmp_path, capsys
):
    job = cases.in_stage("finetune")
    assert "--initial" in cases.stops(capsys, lambda: cases.run(folder, tmp_path, job))
    missing = ("--initial", str(tmp_path / "no.msgpack"))
    line = cases.stops(capsys, lambda: cases.run(folder, tmp_path, job, *missing))
    assert "no.msgpack: not found" in line
    wider = cases.JOB["model"] | {"field": cases.GRID | {"view_widths": [9]}}
    other = ("--initial", str(uninterrupted / "learnt" / "model.msgpack"))
    line = cases.stops(
        capsys, lambda: cases.run(folder, tmp_path, job | {"model": wider}, *other)
    )
    assert "model.msgpack: " in line
    assert not list(tmp_path.rglob("*.json"))


def test_masks_that_leave_no_pixel_are_refused(folder, tmp_path, capsys):
    """Each view has some in each folder, and no pixel is in both."""
    scene, left = shutil.copytree(folder, tmp_path / "scene"), np.zeros((24, 32), bool)
    left[:, :9] = True
    for place, mask in ((scene / prepared.MASKS, left), (tmp_path / "valid", ~left)):
        place.mkdir()
        for name in ("v1", "v2", "v3"):
            np.savez(place / f"{name}.npz", valid=mask)
    options = cases.JOB, "--valid", str(tmp_path / "valid")
    line = cases.stops(capsys, lambda: cases.run(scene, tmp_path / "out", *options))
    assert line == f"error: {tmp_path / 'valid'}: no valid pixel"
    assert {path.name for path in tmp_path.joinpath("out").rglob("*")} <= {
        *("checkpoints", "lock")
    }


def test_a_second_trainer_is_refused_at_once(folder, tmp_path, capsys, monkeypatch):
    """Before the scene is read and a step is compiled."""
    monkeypatch.delattr(prepared, "load")
    monkeypatch.delattr(program, "build")
    (tmp_path / "checkpoints").mkdir()
    with filelock.FileLock(tmp_path / "checkpoints" / "lock"):
        line = cases.stops(capsys, lambda: cases.run(folder, tmp_path))
    assert "checkpoints: another process is training here" in line


def test_bad_input_is_one_line(folder, tmp_path, capsys):
    shutil.copytree(folder, tmp_path / "scene")
    path = tmp_path / "scene" / "images" / "v2.png"
    path.write_bytes(path.read_bytes()[:-40])
    out = tmp_path / "out"
    line = cases.stops(capsys, lambda: cases.run(tmp_path / "scene", out))
    assert "v2.png" in line
    left = {path.name for path in (tmp_path / "out").rglob("*")}
    assert left <= {"checkpoints", "lock"}


def test_a_folder_in_a_files_place_is_refused_before_the_training(
    folder, tmp_path, capsys
):
    """Found by the torture: it was said after the last step."""
    (tmp_path / "timing.json").mkdir()
    line = cases.stops(capsys, lambda: cases.run(folder, tmp_path))
    wanted = f"{tmp_path / 'timing.json'}: a folder, where a file is to be written"
    assert line == f"error: {wanted}"
    assert [path.name for path in tmp_path.iterdir()] == ["timing.json"]
