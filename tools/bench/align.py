"""The search of the alignment-aware loss (AligNeRF, Eq. 4): speed, rightness, share.

Each way of the search beside the one that training takes, in turns; how far each is
from float64 on patches that are hard; and what the loss with its search and gradient
takes of a fine-tuning step. The FFT is the fastest; as all expanded ways it is wrong
in the second digit where a render fits well, and nothing bounds how many offsets a
shortlist from it has to hold.

Notation: as in `align_loss`: patches of p x p pixels in q x q, s^2 offsets.
"""

import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import yaml

from alignerf.experiment import check, jobs
from alignerf.training import methods
from tools.bench import cases, measure, ours, searches

# Of the paper: patches of 32 in 48 pixels, 289 offsets.
SIZE_PX, RADIUS_PX = 32, 8
QUICK_PX = 8, 2

# Brightness, contrast, and in contrasts: how much too bright, and how noisy.
HARD = {
    "level": (0, 1, 100),
    "contrast": (1e-4, 1e-2, 1, 1e4),
    "apart": (0, 1, 1000),
    "noise": (1e-3, 0.1),
}


def run(options):
    """Rows: patches/s of each way, its largest error, shares of fine-tuning steps."""
    size, radius = QUICK_PX if options.quick else (SIZE_PX, RADIUS_PX)
    counts = (1,) if options.quick else (1, 2, 32)
    return [
        *(row for n in counts for row in speeds(n, size, radius, options.repeats)),
        *(error_row(name, way, size, radius) for name, way in searches.WAYS.items()),
        *shares(options),
    ]


def best_of(way):
    """(index, squared error) of the best offset, for a batch of patches."""

    def best(render, photo):
        errors = way(render, photo)
        return jnp.argmin(errors), jnp.min(errors)

    return jax.jit(jax.vmap(best))


def speeds(count, size, radius, repeats):
    """A row for each way: training's and it in turns."""
    patches = random_patches(np.random.default_rng(0), count, size, radius)
    arms = {
        name: functools.partial(best_of(way), *patches)
        for name, way in searches.WAYS.items()
    }
    times = measure.interleave(arms, 3 * repeats)
    mine = times.pop(searches.TRAINING)
    what = f"search, {count} of {size} px, {searches.TRAINING}"
    return [
        measure.rates(
            f"{what} / {name}", {"ours": mine, "peer": found}, count, unit="patches/s"
        )
        for name, found in times.items()
    ]


def random_patches(
    rng, count, size, radius, *, level=0.0, contrast=1.0, apart=0.0, noise=0.1
):
    """Renders that fit their photos at some offset but for noise and brightness."""
    around = size + 2 * radius
    photo = level + contrast * rng.uniform(size=(count, around, around, 3))
    starts = rng.integers(0, 2 * radius + 1, (count, 2))
    render = np.stack(
        [g[y : y + size, x : x + size] for g, (y, x) in zip(photo, starts, strict=True)]
    )
    render += contrast * (apart + noise * rng.normal(size=render.shape))
    return np.float32(render), np.float32(photo)


def error_row(name, way, size, radius):
    """How far the best offset's squared error is from float64, on hard patches."""
    rng, best, errors, wrong = np.random.default_rng(1), best_of(way), [], 0
    for values in itertools.product(*HARD.values()):
        hard = dict(zip(HARD, values, strict=True))
        render, photo = random_patches(rng, 2, size, radius, **hard)
        offsets, costs = best(render, photo)
        for *pair, offset, cost in zip(render, photo, offsets, costs, strict=True):
            wanted = in_float64(*pair)
            errors.append(abs(float(cost) / wanted.min() - 1))
            wrong += wanted.ravel()[offset] > (1 + 1e-5) * wanted.min()
    return measure.Row(
        what=f"largest error, {name}",
        unit="of float64's",
        ours=measure.one(max(errors)),
        goal=measure.Goal("ours", "<=", 1e-5) if name == searches.TRAINING else None,
        note=f"{wrong} of {len(errors)} offsets wrong by more than 1e-5",
    )


def in_float64(render, photo):
    """Squared errors [s, s] by the formula."""
    render, photo = np.float64(render), np.float64(photo)
    crops = np.lib.stride_tricks.sliding_window_view(photo, render.shape[:2], (0, 1))
    errors = [
        [((part - render.transpose(2, 0, 1)) ** 2).sum() for part in row]
        for row in crops
    ]
    return np.array(errors)


def shares(options):
    """Rows: per cent of a fine-tuning step, by config and for the published model."""
    if options.quick:
        yield share("tiny", cases.TINY, settings_of("table1") | QUICK_SETTINGS, 1)
        return
    model = read_config("table1")["models"]["base"]
    yield share("table1", model, settings_of("table1"), options.repeats)
    # One patch of the 32: all grows with their number, and a step takes long.
    paper = settings_of("table1") | {"patches": 1, "features": 128}
    yield share("published, 1 patch", cases.PUBLISHED, paper, 3)


QUICK_SETTINGS = {"patch_px": QUICK_PX[0], "radius_px": QUICK_PX[1]}


def read_config(name):
    """One of the configs that come with the program; facts decide nothing."""
    path = measure.ROOT / "workflow" / "config" / f"{name}.yaml"
    return check.checked(yaml.safe_load(path.read_text()) | {"decide": False})


def settings_of(name):
    """Of the method alignerf in a config, as a job takes them."""
    found = read_config(name)["methods"]["alignerf"]["alignerf"]
    return {"frequency_weights": None} | found


def share(name, model, chosen, repeats):
    """A row: the loss with its search and gradient, and the step, in turns."""
    training = cases.TRAINING | {"steps": 1000, "batch_rays": 1024}
    job = jobs.parse(
        {
            "seed": 0,
            "stage": "finetune",
            "model": model,
            "training": training,
            "alignerf": chosen,
        }
    )
    patches = random_patches(
        np.random.default_rng(0),
        *(chosen[key] for key in ("patches", "patch_px", "radius_px")),
    )
    valid, penalty = jnp.ones(patches[1].shape[:3]), chosen["align_penalty"]
    loss = jax.jit(
        jax.grad(lambda r, g: methods.match_patches(r, g, valid, penalty)[1])
    )
    arms = {
        "step": ours.Training(job, cases.orbit()),
        "loss": functools.partial(loss, *patches),
    }
    times = measure.interleave(arms, repeats)
    return measure.Row(
        what=f"share of a fine-tuning step, {name}",
        unit="per cent",
        ours=measure.spread(
            100 * a / b for a, b in zip(times["loss"], times["step"], strict=True)
        ),
        goal=measure.Goal("ours", "<=", 10.0),
        note=f"{chosen['patches']} patches of {chosen['patch_px']} px, "
        f"radius {chosen['radius_px']} px",
    )
