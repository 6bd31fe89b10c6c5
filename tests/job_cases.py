"""What the tests of training as a job share: a tiny scene, a job, how to run it."""

import json

import flax.serialization
import numpy as np
import pytest
from PIL import Image

from alignerf import train
from alignerf.io import faults
from alignerf.scenes import cameras
from alignerf.training import checkpoint, loop

WIDTH, HEIGHT, STEPS = 32, 24, 14
GRID = {
    "kind": "grid",
    "levels": 2,
    "log2_hashmap_size": 8,
    "features": 2,
    "max_resolution": 32,
    "width": 8,
}
ALIGNERF = {
    "pretrain_fraction": 0.6,
    "finetune_fraction": 0.5,
    "learning_rates": [0.01, 0.001],
    "patches": 1,
    "patch_px": 12,
    "convolution": True,
    "features": 4,
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
}


def in_stage(stage, job=JOB, **changes):
    """The job in a stage of AligNeRF's, with what that has of its own.

    changes: of AligNeRF's settings.
    """
    chosen = ALIGNERF | changes
    if stage == "pretrain":
        return job | {"stage": stage, "pretrain_fraction": chosen["pretrain_fraction"]}
    return job | {"stage": stage, "alignerf": chosen}


def one_of(values, *kept):
    """Values of which `make test` has those kept; `make tools` has the others."""
    return [
        pytest.param(one, marks=() if one in kept else pytest.mark.whole)
        for one in values
    ]


class Killed(BaseException):
    """A process that ends in the middle, as far as files can tell."""


def make_scene(folder, width=WIDTH, height=HEIGHT):
    """A prepared scene: random photos seen by cameras that differ a little."""
    (folder / "images").mkdir()
    rng = np.random.default_rng(0)
    names = [f"v{i}" for i in range(4)]
    for name in names:
        image = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
        Image.fromarray(image).save(folder / "images" / f"{name}.png")
    poses = np.repeat(np.eye(4)[None, :3], 4, axis=0)
    poses[:, :, 3] = rng.normal(size=(4, 3))
    np.savez(
        folder / "cameras.npz",
        pixtocams=np.stack([cameras.intrinsics(30.0, width, height)] * 4),
        camtoworlds=poses,
        names=names,
        width=width,
        height=height,
        split=["test", "train", "train", "train"],
    )
    return folder


def run(folder, out, job=JOB, *more):
    """Train into `out`; returns the parameters' bytes."""
    train.main(
        [
            *("--config", json.dumps(job), "--scene", str(folder)),
            *("--checkpoints", str(out / "checkpoints")),
            *("--learnt", str(out / "learnt")),
            *("--timing", str(out / "timing.json"), *more),
        ]
    )
    return (out / "learnt" / "model.msgpack").read_bytes()


def params_of(out):
    """The parameters that a training has written."""
    content = (out / "learnt" / "model.msgpack").read_bytes()
    return flax.serialization.msgpack_restore(content)


def kill_after_save(monkeypatch, at_step, every=4):
    """Let training stop for good once it has saved the step `at_step`.

    every: steps whose numbers are fetched at once.
    """
    save = checkpoint.save

    def save_and_die(folder, state, **options):
        save(folder, state, **options)
        if int(state.step) == at_step:
            raise Killed

    monkeypatch.setattr(checkpoint, "save", save_and_die)
    monkeypatch.setattr(loop, "CHECKPOINT_EVERY_S", 0.0)
    monkeypatch.setattr(loop, "FETCH_EVERY", every)


def stops(capsys, call):
    """The one line that an entry point ends with."""
    with pytest.raises(SystemExit) as stopped:
        faults.run(call)
    assert stopped.value.code == 1
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert line.startswith("error: ")
    return line
