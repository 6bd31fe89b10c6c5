"""What `sooner` compares: the defaults as they were, in numbers, and as they are.

`old` and the mlp pair are whole jobs, so that no new default changes them; `new` is
what the configs that come with the program say.
"""

from typing import NamedTuple

import yaml

from alignerf.experiment import check, plan, slices
from tests.bench import measure

CONFIGS = measure.ROOT / "workflow" / "config"
# Of the configs' methods, the one that is trained in one go with their first model.
METHOD = "mipnerf360"
# Of a job, its model and its training, what an older checkout does not know; it does
# as the old settings say.
NEW_KEYS = {"decisions", "refine", "align"}
NEW_MODEL_KEYS = {"background", "decided", "kind", "radius", "training"}
NEW_FIELD_KEYS = {"anti_aliased"}
NEW_TRAINING_KEYS = {"budget_min", "hold_share", "adam_betas", "proposal_share"}
NEW_TRAINING_KEYS |= {"decided"}


def job_of(samples, proposal, field, **training):
    """A whole job as the old defaults had it, but for these."""
    grid = {
        "kind": "grid",
        "features": 2,
        "coarsest": 16,
        "anti_aliased": True,
        "bottleneck": 15,
        "view_widths": [64],
        "precision": "float32",
    }
    return {
        "seed": 0,
        "stage": "full",
        "model": {
            "kind": "mipnerf360",
            "training": {},
            "near": 0.2,
            "far": 1e6,
            "radius": 1.0,
            "background": None,
            "decided": [],
            "samples": samples,
            "proposal": grid | proposal,
            "field": field if "kind" in field else grid | field,
        },
        "training": {
            "budget_min": None,
            "batch_rays": 1024,
            "learning_rates": [0.01, 0.001],
            "hold_share": 0.0,
            "adam_betas": [0.9, 0.999],
            "adam_eps": 1e-15,
            "gradient_norm": None,
            "proposal_share": 1.0,
            "interlevel_weight": 1.0,
            "distortion_weight": 0.01,
            "decided": [],
        }
        | training,
        "alignerf": None,
        "refine": None,
        "align": None,
        "decisions": None,
    }


DEMO_SAMPLES = [32, 16]
DEMO_PROPOSAL = {"levels": 4, "log2_entries": 14, "finest": 128, "width": 16}
DEMO_OLD = job_of(
    DEMO_SAMPLES,
    DEMO_PROPOSAL,
    {"levels": 8, "log2_entries": 15, "finest": 1024, "width": 64},
    steps=1000,
    warmup_steps=100,
)
PHOTOS_OLD = job_of(
    [48, 24],
    {"levels": 5, "log2_entries": 15, "finest": 256, "width": 16},
    {"levels": 8, "log2_entries": 17, "finest": 2048, "width": 64},
    steps=2000,
    warmup_steps=100,
)
MLP = {
    "kind": "mlp",
    "width": 64,
    "depth": 4,
    "skip_every": 4,
    "degrees": 12,
    "bottleneck": 64,
    "view_width": 64,
    "precision": "float32",
}
MLP_OLD = job_of(DEMO_SAMPLES, DEMO_PROPOSAL, MLP, steps=500, warmup_steps=50)
MLP_NEW = job_of(
    [32, 16, 12],
    DEMO_PROPOSAL | {"levels": 3, "log2_entries": 15},
    MLP,
    steps=1000,
    batch_rays=512,
    hold_share=0.5,
    adam_betas=[0.9, 0.99],
    proposal_share=0.25,
    warmup_steps=100,
)


class Case(NamedTuple):
    """A scene, what it is scored against, and the jobs beside the config's own."""

    config: str
    # Keys of the scene; a path is below the folder of real data.
    scene: dict
    test_set: str
    frozen: dict
    # Whether a seed is of the scene too, or of the training alone.
    made_by_seed: bool = False


CASES = {
    "courtyard": Case(
        config="demo",
        scene={"source": "courtyard", "downscale": 2, "perturb_px": 1.5},
        test_set="oracle",
        frozen={"old": DEMO_OLD, "mlp_old": MLP_OLD, "mlp_new": MLP_NEW},
        made_by_seed=True,
    ),
    "fox": Case(
        config="own_photos",
        scene={
            "source": "photos",
            "path": "scenes/fox/images",
            "downscale": 4,
            "colmap": {"max_size_px": 960},
        },
        test_set="standard",
        frozen={"old": PHOTOS_OLD},
    ),
    "treehill": Case(
        config="own_photos",
        scene={"source": "photos", "path": "scenes/treehill/images", "downscale": 2},
        test_set="standard",
        frozen={"old": PHOTOS_OLD},
    ),
}


def experiment_of(name, seed, data):
    """The case's config, its first scene replaced by the case's.

    data: folder of real scenes. What the case leaves open stays as the config has it:
    the steps of its scene, say.
    """
    case = CASES[name]
    config = yaml.safe_load((CONFIGS / f"{case.config}.yaml").read_text())
    scene = next(iter(config["scenes"].values())) | case.scene
    if "path" in case.scene:
        scene["path"] = str(data.resolve() / case.scene["path"])
    if case.made_by_seed:
        scene["seed"] = seed
    # Of the same settings as the figures before: fixed ones.
    fixed = config | {"decide": False, "scenes": {name: scene}}
    return plan.Experiment(check.checked(fixed), None)


def jobs_of(name, experiment, seed):
    """{setting: job}, in the order in which they take turns."""
    found = dict(CASES[name].frozen)
    old = found.pop("old")
    new = slices.round_job(experiment, name, METHOD)
    return {
        setting: job | {"seed": seed}
        for setting, job in {"old": old, "new": new, **found}.items()
    }


def as_known_before(job):
    """The job without what an older checkout does not know."""
    fields = {
        key: without(NEW_FIELD_KEYS, job["model"][key]) for key in ("proposal", "field")
    }
    return without(NEW_KEYS, job) | {
        "model": without(NEW_MODEL_KEYS, job["model"]) | fields,
        "training": without(NEW_TRAINING_KEYS, job["training"]),
    }


def without(keys, of):
    """A dict but for these keys."""
    return {k: v for k, v in of.items() if k not in keys}


def with_budget(job, budget):
    """The job with so many times its steps, and a schedule that ends there."""
    training = job["training"]
    steps = max(1, round(budget * training["steps"]))
    return job | {"training": training | slices.retimed(training, steps)}


def quick_jobs():
    """The same of hardly any size: both settings, no config."""
    grid = {"levels": 1, "log2_entries": 4, "finest": 16, "width": 4}
    old = job_of([4, 4], grid, grid, steps=4, warmup_steps=1, batch_rays=16)
    return {"old": old, "new": with_budget(old, 0.5)}
