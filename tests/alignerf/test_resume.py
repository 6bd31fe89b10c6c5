"""A training resumes bit for bit, and only its own checkpoint."""

import json
import shutil

import jax
import pytest
from PIL import Image

from alignerf.training import loop, memory
from tests import job_cases as cases


@pytest.mark.parametrize("at_step", cases.one_of([4, 12], 4))
def test_resumes_bit_for_bit(
    folder, uninterrupted, tmp_path, monkeypatch, caplog, at_step
):
    with monkeypatch.context() as patched:
        cases.kill_after_save(patched, at_step)
        with pytest.raises(cases.Killed):
            cases.run(folder, tmp_path)
    assert not (tmp_path / "learnt" / "model.msgpack").exists()
    caplog.set_level("INFO", "alignerf")
    if at_step == 12:
        jax.clear_caches()
    resumed = cases.run(folder, tmp_path)
    assert f"resuming at step {at_step} of {cases.STEPS}" in caplog.text
    assert resumed == (uninterrupted / "learnt" / "model.msgpack").read_bytes()
    timing = json.loads((tmp_path / "timing.json").read_text())
    assert timing["rays_seen"] == cases.STEPS * cases.TRAINING["batch_rays"]


def test_fine_tuning_resumes_bit_for_bit(folder, tmp_path, monkeypatch):
    initial = tmp_path / "pretrain"
    cases.run(folder, initial, cases.in_stage("pretrain"))
    tuned = cases.in_stage("finetune")
    more = ("--initial", str(initial / "learnt" / "model.msgpack"))
    whole = cases.run(folder, tmp_path / "whole", tuned, *more)
    with monkeypatch.context() as patched:
        cases.kill_after_save(patched, 4)
        with pytest.raises(cases.Killed):
            cases.run(folder, tmp_path / "parts", tuned, *more)
    assert cases.run(folder, tmp_path / "parts", tuned, *more) == whole


@pytest.mark.parametrize("change", ["seed", "config", "photos", "sources"])
def test_another_job_does_not_resume(
    folder, uninterrupted, tmp_path, monkeypatch, caplog, change
):
    shutil.copytree(uninterrupted / "checkpoints", tmp_path / "checkpoints")
    job, more = cases.JOB, ()
    if change == "seed":
        job = cases.JOB | {"seed": 4}
    elif change == "config":
        job = cases.JOB | {"training": cases.TRAINING | {"interlevel_weight": 0.5}}
    elif change == "sources":
        more = ("--sources", "of another version")
    else:
        shutil.copytree(folder / "images", tmp_path / "photos")
        Image.new("RGB", (cases.WIDTH, cases.HEIGHT)).save(
            tmp_path / "photos" / "v1.png"
        )
        more = ("--photos", str(tmp_path / "photos"))
    started = []

    def first_state(run):
        started.append(int(run.state.step))
        raise cases.Killed

    monkeypatch.setattr(loop, "run_steps", first_state)
    caplog.set_level("INFO", "alignerf")
    with pytest.raises(cases.Killed):
        cases.run(folder, tmp_path, job, *more)
    assert started == [0]
    said = "checkpoint of another configuration, starting anew"
    if change == "sources":
        said = "is of this configuration by other code"
    assert said in caplog.text


# Its memory is known to the kilobyte, where the kernels' depends on the compiler.
BY_JAX = cases.JOB | {"training": cases.JOB["training"] | {"kernels": "jax"}}


@pytest.mark.whole
def test_micro_batches_where_memory_is_short(folder, tmp_path, monkeypatch, caplog):
    """A resumed training keeps those that it began with, and so its every bit."""
    caplog.set_level("INFO", "alignerf")
    with monkeypatch.context() as patched:
        # The whole batch takes 220 kB, a quarter of it 80 kB.
        patched.setattr(memory, "free_bytes", lambda device: 120_000)
        whole = cases.run(folder, tmp_path / "whole", BY_JAX)
        cases.kill_after_save(patched, 8)
        with pytest.raises(cases.Killed):
            cases.run(folder, tmp_path / "parts", BY_JAX)
    # Less the photos and the moments of Adam, which come later.
    assert "more than 90% of 91.3 kB, in 1 micro-batches" in caplog.text
    assert "free 120.0 kB; 4 micro-batches of 16 rays on 1 devices" in caplog.text
    caplog.clear()
    assert cases.run(folder, tmp_path / "parts", BY_JAX) == whole
    assert "; 4 micro-batches of 16 rays on 1 devices" in caplog.text
    timing = json.loads((tmp_path / "parts" / "timing.json").read_text())
    assert timing["micro_batches"] == 4


@pytest.fixture(scope="module")
def stopped_in_four(folder, tmp_path_factory):
    """Where a training stopped that had too little memory for its whole batch."""
    place = tmp_path_factory.mktemp("in four")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(memory, "free_bytes", lambda device: 120_000)
        cases.kill_after_save(patched, 8)
        with pytest.raises(cases.Killed):
            cases.run(folder, place, BY_JAX)
    return place


@pytest.fixture
def in_four(stopped_in_four, tmp_path):
    """A copy of that folder."""
    shutil.copytree(stopped_in_four, tmp_path / "in four")
    return tmp_path / "in four"


@pytest.fixture
def compiled(monkeypatch):
    """Micro-batches of each step that is compiled from here on."""
    found = []
    compile_to_fit = memory.compile_to_fit

    def note(compile_parts, *others, **options):
        def compile_and_note(parts):
            found.append(parts)
            return compile_parts(parts)

        return compile_to_fit(compile_and_note, *others, **options)

    monkeypatch.setattr(memory, "compile_to_fit", note)
    return found


def test_a_resumed_training_compiles_once(folder, in_four, compiled, caplog):
    cases.run(folder, in_four, BY_JAX)
    assert compiled == [4]
    assert "other rounding" not in caplog.text


@pytest.mark.whole
def test_micro_batches_that_no_longer_fit_are_said(
    folder, in_four, compiled, monkeypatch, caplog
):
    monkeypatch.setattr(memory, "free_bytes", lambda device: 90_000)
    cases.run(folder, in_four, BY_JAX)
    assert compiled[0] == 4
    more = compiled[-1]
    assert more > 4
    assert f"resuming in {more} micro-batches instead of 4: other" in caplog.text


def test_another_job_begins_in_the_usual_micro_batches(
    folder, in_four, compiled, tmp_path
):
    """Bit for bit as in an empty folder; compiled again only where they differ."""
    job = BY_JAX | {"seed": 5}
    fresh = cases.run(folder, tmp_path / "fresh", job)
    compiled.clear()
    assert cases.run(folder, in_four, job) == fresh
    assert compiled == [4, 1]


@pytest.mark.parametrize(
    "manifest", cases.one_of(["", "[]", '{"parts": 0}', '{"parts": "2"}'], "[]")
)
def test_a_manifest_without_micro_batches_is_no_hint(
    folder, uninterrupted, tmp_path, compiled, manifest
):
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / "checkpoints" / "manifest.json").write_text(manifest)
    wanted = (uninterrupted / "learnt" / "model.msgpack").read_bytes()
    compiled.clear()
    assert cases.run(folder, tmp_path) == wanted
    assert compiled == [1]


def test_a_finished_training_that_is_run_again_tells_the_same(folder, tmp_path):
    found = []
    for _ in range(2):
        model = cases.run(folder, tmp_path)
        timing = json.loads((tmp_path / "timing.json").read_text())
        found.append((model, timing["final"]))
    assert found[0] == found[1]
    assert found[0][1]["loss"] > 0
