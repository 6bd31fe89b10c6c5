"""Training as a job: resumes bit for bit, and refuses what it should."""

import json
import re
import shutil
import subprocess
import sys

import filelock
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.experimental.compilation_cache import compilation_cache
from PIL import Image

from alignerf import train
from alignerf.command import faults
from alignerf.contributions import patch_conv
from alignerf.experiment import jobs
from alignerf.scenes import cameras
from alignerf.training import checkpoint, compose, loop, memory

WIDTH, HEIGHT, STEPS = 32, 24, 14
GRID = {"kind": "grid", "levels": 2, "log2_entries": 8, "finest": 32, "width": 8}
ALIGNERF = {
    "pretrain_share": 0.6,
    "finetune_share": 0.5,
    "learning_rates": [0.01, 0.001],
    "patches": 1,
    "patch_px": 12,
    "convolution": True,
    "features": 4,
    "matching": "patch",
    "error": "squared",
    "radius_px": 2,
    "align_penalty": 0.01,
    "frequency_weight": 0.05,
    "frequency_weights": None,
}
TRAINING = {
    "steps": STEPS,
    "batch_rays": 64,
    "learning_rates": [0.01, 0.001],
    "warmup_steps": 3,
    "adam_eps": 1e-15,
    "gradient_norm": None,
    "interlevel_weight": 1.0,
    "distortion_weight": 0.01,
}
JOB = {
    "seed": 3,
    "stage": "full",
    "model": {
        "near": 0.2,
        "far": 1e3,
        "samples": [4, 4],
        "proposal": GRID,
        "field": GRID | {"view_widths": [8]},
    },
    "training": TRAINING,
    "alignerf": ALIGNERF,
}


class Killed(BaseException):
    """A process that ends in the middle, as far as files can tell."""


@pytest.fixture(scope="module", autouse=True)
def compiled_once(tmp_path_factory):
    """Programs compiled for one training serve its repetitions."""
    options = {
        "jax_compilation_cache_dir": str(tmp_path_factory.mktemp("compiled")),
        "jax_persistent_cache_min_compile_time_secs": 0.1,
    }
    before = {name: getattr(jax.config, name) for name in options}
    for name, value in options.items():
        jax.config.update(name, value)
    compilation_cache.reset_cache()
    yield
    for name, value in before.items():
        jax.config.update(name, value)
    compilation_cache.reset_cache()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A prepared scene: random photos seen by cameras that differ a little."""
    folder = tmp_path_factory.mktemp("scene")
    (folder / "images").mkdir()
    rng = np.random.default_rng(0)
    names = [f"v{i}" for i in range(4)]
    for name in names:
        image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        Image.fromarray(image).save(folder / "images" / f"{name}.png")
    poses = np.repeat(np.eye(4)[None, :3], 4, axis=0)
    poses[:, :, 3] = rng.normal(size=(4, 3))
    np.savez(
        folder / "cameras.npz",
        pixtocams=np.stack([cameras.intrinsics(30.0, WIDTH, HEIGHT)] * 4),
        camtoworlds=poses,
        names=names,
        width=WIDTH,
        height=HEIGHT,
        split=["test", "train", "train", "train"],
    )
    return folder


def run(folder, out, job=JOB, *more):
    """Train into `out`; returns the parameters' bytes."""
    train.main(
        [
            *("--config", json.dumps(job), "--scene", str(folder)),
            *("--checkpoints", str(out / "checkpoints")),
            *("--model", str(out / "model.msgpack")),
            *("--timing", str(out / "timing.json"), *more),
        ]
    )
    return (out / "model.msgpack").read_bytes()


@pytest.fixture(scope="module")
def uninterrupted(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("uninterrupted")
    run(folder, out)
    return out


def kill_after_save(monkeypatch, at_step):
    """Let training stop for good once it has saved the step `at_step`."""
    save = checkpoint.save

    def save_and_die(folder, state, **options):
        save(folder, state, **options)
        if int(state.step) == at_step:
            raise Killed

    monkeypatch.setattr(checkpoint, "save", save_and_die)
    monkeypatch.setattr(loop, "CHECKPOINT_EVERY_S", 0.0)
    monkeypatch.setattr(loop, "FETCH_EVERY", 4)


@pytest.mark.parametrize("at_step", [4, 12])
def test_resumes_bit_for_bit(
    folder, uninterrupted, tmp_path, monkeypatch, caplog, at_step
):
    with monkeypatch.context() as patched:
        kill_after_save(patched, at_step)
        with pytest.raises(Killed):
            run(folder, tmp_path)
    assert not (tmp_path / "model.msgpack").exists()
    caplog.set_level("INFO", "alignerf")
    resumed = run(folder, tmp_path)
    assert f"resuming at step {at_step} of {STEPS}" in caplog.text
    assert resumed == (uninterrupted / "model.msgpack").read_bytes()
    timing = json.loads((tmp_path / "timing.json").read_text())
    assert timing["rays_seen"] == STEPS * TRAINING["batch_rays"]


def test_fine_tuning_resumes_bit_for_bit(folder, tmp_path, monkeypatch):
    initial = tmp_path / "pretrain"
    run(folder, initial, JOB | {"stage": "pretrain"})
    tuned = JOB | {"stage": "finetune"}
    more = ("--initial", str(initial / "model.msgpack"))
    whole = run(folder, tmp_path / "whole", tuned, *more)
    with monkeypatch.context() as patched:
        kill_after_save(patched, 4)
        with pytest.raises(Killed):
            run(folder, tmp_path / "parts", tuned, *more)
    assert run(folder, tmp_path / "parts", tuned, *more) == whole


@pytest.fixture(scope="module")
def pretrained(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("pretrained")
    run(folder, out, JOB | {"stage": "pretrain"})
    return out / "model.msgpack"


MLP = JOB["model"] | {"field": {"kind": "mlp", "width": 16, "depth": 2}}


@pytest.mark.parametrize(
    ("model", "parts"),
    [
        (JOB["model"], {}),
        (JOB["model"], {"convolution": False}),
        (JOB["model"], {"features": 9}),
        (MLP, {}),
    ],
    ids=["grid", "no convolution", "more features", "mlp"],
)
def test_fine_tuning_starts_from_the_pretrained_function(
    folder, tmp_path, model, parts
):
    """Colours of a view, before the first step: equal to 1e-5."""
    chosen = ALIGNERF | parts
    of_both = JOB | {"model": model, "alignerf": chosen}
    run(folder, tmp_path, of_both | {"stage": "pretrain"})
    pretrained = tmp_path / "model.msgpack"
    jobs = [
        jobs.parse(of_both | {"stage": stage}) for stage in ("pretrain", "finetune")
    ]
    before, after = map(compose.make_method, jobs)
    template = jax.eval_shape(before.init, jax.random.key(0))
    params = jax.tree.map(jnp.asarray, checkpoint.read_params(pretrained, template))
    widened = train.initial_params(jobs[1], after, str(pretrained))
    assert ("head" in widened) == chosen["convolution"]
    rows, columns = jnp.mgrid[:HEIGHT, :WIDTH]
    rays = cameras.pixels_to_rays(
        columns.ravel(),
        rows.ravel(),
        jnp.asarray(cameras.intrinsics(30.0, WIDTH, HEIGHT), jnp.float32),
        jnp.eye(3, 4),
    )
    widened = jax.tree.map(jnp.asarray, widened)
    colours = before.render(params, rays).values.reshape(HEIGHT, WIDTH, 3)
    assert jnp.ptp(colours) > 0.01
    values = after.render(widened, rays).values.reshape(HEIGHT, WIDTH, -1)
    found = after.colours(widened, patch_conv.pad(values) if after.halo else values)
    np.testing.assert_allclose(found, colours, atol=1e-5)


def test_a_search_radius_comes_from_the_displacement(
    folder, pretrained, tmp_path, capsys, caplog
):
    job = JOB | {"stage": "finetune", "alignerf": ALIGNERF | {"radius_px": None}}
    more = ("--initial", str(pretrained))
    assert "--displacement" in stops(capsys, lambda: run(folder, tmp_path, job, *more))
    measured = tmp_path / "displacement.csv"
    measured.write_text("view,p95_px\na,1.2\nb,2.3\n")
    more += ("--displacement", str(measured))
    caplog.set_level("INFO", "alignerf")
    found = run(folder, tmp_path / "auto", job, *more)
    assert "search radius: 3 px" in caplog.text
    fixed = job | {"alignerf": ALIGNERF | {"radius_px": 3}}
    assert run(folder, tmp_path / "fixed", fixed, *more[:2]) == found


def test_a_warm_start_begins_with_the_parameters_given(
    folder, uninterrupted, tmp_path, monkeypatch
):
    """Not with fresh ones; it resumes bit for bit, and wants them to fit."""
    initial = str(uninterrupted / "model.msgpack")
    warm = JOB | {"stage": "warm", "training": TRAINING | {"steps": 8}}
    more = ("--initial", initial)
    begun = []
    with monkeypatch.context() as patched:
        run_steps = loop.run_steps

        def first_state(job, step, state, *others):
            begun.append(jax.tree.map(np.asarray, state.params))
            return run_steps(job, step, state, *others)

        patched.setattr(loop, "run_steps", first_state)
        whole = run(folder, tmp_path / "whole", warm, *more)
        kill_after_save(patched, 4)
        with pytest.raises(Killed):
            run(folder, tmp_path / "parts", warm, *more)
    given = checkpoint.read_params(initial, begun[0])
    jax.tree.map(np.testing.assert_array_equal, begun[0], given)
    assert run(folder, tmp_path / "parts", warm, *more) == whole
    with pytest.raises(ValueError, match="--initial: stage 'warm' needs trained"):
        run(folder, tmp_path / "none", warm)
    field = GRID | {"view_widths": [16]}
    other = warm | {"model": JOB["model"] | {"field": field}}
    with pytest.raises(ValueError, match=r"model\.msgpack"):
        run(folder, tmp_path / "other", other, *more)
    assert not (tmp_path / "other" / "model.msgpack").exists()


@pytest.mark.parametrize("change", ["seed", "config", "photos", "sources"])
def test_another_job_does_not_resume(
    folder, uninterrupted, tmp_path, monkeypatch, caplog, change
):
    shutil.copytree(uninterrupted / "checkpoints", tmp_path / "checkpoints")
    job, more = JOB, ()
    if change == "seed":
        job = JOB | {"seed": 4}
    elif change == "config":
        job = JOB | {"training": TRAINING | {"interlevel_weight": 0.5}}
    elif change == "sources":
        more = ("--sources", "of another version")
    else:
        shutil.copytree(folder / "images", tmp_path / "photos")
        Image.new("RGB", (WIDTH, HEIGHT)).save(tmp_path / "photos" / "v1.png")
        more = ("--photos", str(tmp_path / "photos"))
    started = []

    def first_state(job, step, state, *others):
        started.append(int(state.step))
        raise Killed

    monkeypatch.setattr(loop, "run_steps", first_state)
    caplog.set_level("INFO", "alignerf")
    with pytest.raises(Killed):
        run(folder, tmp_path, job, *more)
    assert started == [0]
    assert "checkpoint of another configuration, starting anew" in caplog.text


def test_micro_batches_where_memory_is_short(folder, tmp_path, monkeypatch, caplog):
    """A resumed training keeps those that it began with, and so its every bit."""
    caplog.set_level("INFO", "alignerf")
    with monkeypatch.context() as patched:
        # The whole batch takes 220 kB, a quarter of it 80 kB.
        patched.setattr(memory, "free_bytes", lambda device: 120_000)
        whole = run(folder, tmp_path / "whole")
        kill_after_save(patched, 8)
        with pytest.raises(Killed):
            run(folder, tmp_path / "parts")
    # Less the photos and the moments of Adam, which come later.
    assert "more than 90% of 91.6 kB, in 1 micro-batches" in caplog.text
    assert "free 120.0 kB; 4 micro-batches of 16 rays on 1 devices" in caplog.text
    caplog.clear()
    assert run(folder, tmp_path / "parts") == whole
    assert "; 4 micro-batches of 16 rays on 1 devices" in caplog.text
    timing = json.loads((tmp_path / "parts" / "timing.json").read_text())
    assert timing["micro_batches"] == 4


def test_photos_that_do_not_fit_are_one_line(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(memory, "free_bytes", lambda device: 5_000)
    line = stops(capsys, lambda: run(folder, tmp_path))
    wanted = "training views of 7.2 kB do not fit into 5.0 kB of free memory"
    assert line == f"error: {folder / 'images'}: {wanted}"


def stops(capsys, call):
    """The one line that an entry point ends with."""
    with pytest.raises(SystemExit) as stopped:
        faults.run(call)
    assert stopped.value.code == 1
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert line.startswith("error: ")
    return line


def test_a_training_that_diverges_stops_with_the_step(folder, tmp_path, capsys):
    wild = TRAINING | {"learning_rates": [1e38, 1e38], "warmup_steps": 0}
    job = JOB | {"training": wild}
    line = stops(capsys, lambda: run(folder, tmp_path, job))
    assert re.search(r"training diverged at step \d+: not finite: \w+ loss, ", line)
    assert re.search(r"; in rays of v1, v2, v3, all .* parameters reach \d", line)
    assert {path.name for path in tmp_path.rglob("*")} <= {"checkpoints", "lock"}


def test_the_first_fault_stops_the_job_and_keeps_its_checkpoint(
    folder, tmp_path, monkeypatch, capsys
):
    """At the very step, though numbers are fetched later, and again when resumed."""
    make_method = compose.make_method

    def spoilt_method(job):
        method = make_method(job)

        def terms(params, batch, share):
            values, shown = method.terms(params, batch, share)
            bad = (share > 9.5 / (STEPS - 1)) & jnp.any(batch.view == 1)
            spoilt = values["distortion"] * jnp.where(bad, jnp.nan, 1.0)
            return values | {"distortion": spoilt}, shown

        return method._replace(terms=terms)

    monkeypatch.setattr(compose, "make_method", spoilt_method)
    monkeypatch.setattr(loop, "CHECKPOINT_EVERY_S", 0.0)
    monkeypatch.setattr(loop, "FETCH_EVERY", 4)
    for _ in range(2):
        line = stops(capsys, lambda: run(folder, tmp_path))
        wanted = "diverged at step 10: not finite: distortion loss; in rays of v2"
        assert line == f"error: training {wanted}"
        names = {path.name for path in (tmp_path / "checkpoints").iterdir()}
        assert names - {"lock"} == {"manifest.json", "state-8.msgpack"}
        assert not (tmp_path / "model.msgpack").exists()


def test_fine_tuning_needs_pretrained_parameters(
    folder, uninterrupted, tmp_path, capsys
):
    job = JOB | {"stage": "finetune"}
    assert "--initial" in stops(capsys, lambda: run(folder, tmp_path, job))
    missing = ("--initial", str(tmp_path / "no.msgpack"))
    line = stops(capsys, lambda: run(folder, tmp_path, job, *missing))
    assert "no.msgpack: model file not found" in line
    wider = JOB["model"] | {"field": GRID | {"view_widths": [9]}}
    other = ("--initial", str(uninterrupted / "model.msgpack"))
    line = stops(capsys, lambda: run(folder, tmp_path, job | {"model": wider}, *other))
    assert "model.msgpack: " in line
    assert not list(tmp_path.rglob("*.json"))


def test_a_second_trainer_is_refused(folder, tmp_path, capsys):
    (tmp_path / "checkpoints").mkdir()
    with filelock.FileLock(tmp_path / "checkpoints" / "lock"):
        line = stops(capsys, lambda: run(folder, tmp_path))
    assert "checkpoints: another process is training here" in line


def test_bad_input_as_a_process_is_one_line(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "scene")
    path = tmp_path / "scene" / "images" / "v2.png"
    path.write_bytes(path.read_bytes()[:-40])
    options = ["--config", json.dumps(JOB), "--scene", tmp_path / "scene"]
    for name in ("checkpoints", "model", "timing"):
        options += [f"--{name}", tmp_path / "out" / name]
    done = subprocess.run(
        [sys.executable, "-m", "alignerf.train", *options],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("error: ")
    assert "v2.png" in done.stderr
    assert not (tmp_path / "out").exists()
