"""What the benchmarks run: models, jobs, and views that need no files.

Notation: views n of h x w pixels; a model is the config's mapping of that name.
"""

import dataclasses
import json

import numpy as np

from alignerf.experiment import jobs
from alignerf.scenes import prepare

NEAR, FAR = 0.2, 1e6
SAMPLES = [64, 64, 32]


def mlp_model(*, width, depth, proposal_width, proposal_depth, samples=None):
    """A model in mip-NeRF 360's shape; view layer and bottleneck as published."""
    return {
        "near": NEAR,
        "far": FAR,
        "samples": samples or SAMPLES,
        "proposal": {"kind": "mlp", "width": proposal_width, "depth": proposal_depth},
        "field": {"kind": "mlp", "width": width, "depth": depth},
    }


TINY = mlp_model(width=16, depth=2, proposal_width=8, proposal_depth=1, samples=[8, 4])
SMALL = mlp_model(width=128, depth=4, proposal_width=64, proposal_depth=2)
PUBLISHED = mlp_model(width=1024, depth=8, proposal_width=256, proposal_depth=4)

# The base model of workflow/config/table4.yaml.
GRID = {
    "near": NEAR,
    "far": FAR,
    "samples": [32, 16, 12],
    "proposal": {
        "kind": "grid",
        "levels": 3,
        "log2_hashmap_size": 15,
        "features": 2,
        "max_resolution": 128,
        "width": 16,
    },
    "field": {"kind": "grid", "log2_hashmap_size": 15, "max_resolution": 1024},
}

# The baseline's training, as published.
TRAINING = {
    "learning_rates": [0.002, 0.00002],
    "warmup_steps": 512,
    "hold_fraction": 0.0,
    "adam_betas": [0.9, 0.999],
    "adam_eps": 1e-6,
    "gradient_norm": 0.001,
    "proposal_fraction": 1.0,
    "interlevel_weight": 1.0,
    "distortion_weight": 0.01,
}


def make_job(model, *, batch_rays, steps=250_000, **training) -> jobs.Job:
    """A full training of a model; `training` changes keys of `TRAINING`."""
    training = TRAINING | training | {"steps": steps, "batch_rays": batch_rays}
    return jobs.parse(
        {
            "seed": 0,
            "stage": "full",
            "model": model,
            "training": training,
            "alignerf": None,
        }
    )


def as_json(job):
    """A job as the command line takes it."""
    return json.dumps(job.model_dump())


@dataclasses.dataclass(frozen=True)
class Photos:
    """Posed photos on the host, in the frame that training sees."""

    images: np.ndarray  # [n, h, w, 3] uint8
    pixtocams: np.ndarray  # [n, 3, 3]
    camtoworlds: np.ndarray  # [n, 3, 4]


def orbit(count=8, width=64, height=64) -> Photos:
    """Cameras on a circle that look at its centre; the colours are noise."""
    angles = 2 * np.pi * np.arange(count) / count
    back = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    up = np.broadcast_to([0.0, 0.0, 1.0], back.shape)
    camtoworlds = np.stack([np.cross(up, back), up, back, back], axis=-1)
    focal = 1.2 * width
    camtopix = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    rng = np.random.default_rng(0)
    return Photos(
        images=rng.integers(0, 256, (count, height, width, 3), np.uint8),
        pixtocams=np.tile(np.linalg.inv(camtopix), (count, 1, 1)),
        camtoworlds=camtoworlds,
    )


def write_scene(folder, photos: Photos):
    """A prepared scene's folder of these photos."""
    count, height, width, _ = photos.images.shape
    views = prepare.PosedViews(
        names=[f"view{i:04d}" for i in range(count)],
        pixtocams=photos.pixtocams,
        camtoworlds=photos.camtoworlds,
        width=width,
        height=height,
        photos=list(map(prepare.Photo, photos.images)),
    )
    split = prepare.split_views(count, test_every=8)
    prepare.write_views(folder, views, split=split)
