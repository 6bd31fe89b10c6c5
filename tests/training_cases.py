"""What the tests of training share: tiny methods, and views that need no files."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from alignerf import fields
from alignerf.alignment import loss
from alignerf.contributions import aligned_loss as contribution
from alignerf.contributions import patch_losses
from alignerf.experiment import jobs
from alignerf.methods.aligned_loss import AlignedLoss
from alignerf.mipnerf360 import model as mipnerf360
from alignerf.scenes import cameras
from alignerf.training import batches, methods
from alignerf.training import step as train_step

WEIGHTS = methods.LossWeights(interlevel=1.0, distortion=0.01)
HEIGHT, WIDTH, FOCAL_PX = 36, 40, 30.0


def tiny_model(outputs=3):
    grid = {"levels": 2, "log2_hashmap_size": 8, "max_resolution": 32, "width": 8}
    return mipnerf360.Model(
        proposal=fields.make("grid", **grid),
        field=fields.make("grid", **grid, outputs=outputs),
        samples=(8, 4),
        near=0.2,
        far=1e3,
    )


def job_of(**model):
    """The job of a short training of that model."""
    return jobs.parse(
        {
            "seed": 0,
            "stage": "full",
            "model": model,
            "training": {"steps": 10, "batch_rays": 8},
        }
    )


def random_params(rng, method):
    """Parameters as large as fresh ones, drawn without compiling anything.

    An entry's bound goes with the number of a row's entries, as in `he_uniform`.
    """

    def draw(shape):
        bound = np.sqrt(6 / shape.shape[-1]) if len(shape.shape) > 1 else 0.1
        return jnp.asarray(rng.uniform(-bound, bound, shape.shape), shape.dtype)

    return jax.tree.map(draw, jax.eval_shape(method.init, jax.random.key(0)))


def with_density(params, bias):
    """`bias` is added to raw densities: as they start, networks give next to none."""
    return jax.tree_util.tree_map_with_path(
        lambda path, leaf: (
            leaf + bias if "density" in str(path) and "bias" in str(path) else leaf
        ),
        params,
    )


def varied(params, size=1.0):
    """Parameters that say something: fresh ones are flat, and alike."""

    def moved(leaf):
        waves = size * np.sin(7.0 * np.arange(leaf.size)).reshape(leaf.shape)
        return jnp.asarray(np.asarray(leaf) + waves, leaf.dtype)

    return jax.tree.map(moved, params)


def baseline(batch_rays=96, loss_weights=WEIGHTS):
    return methods.mipnerf360(
        tiny_model(), batch_rays=batch_rays, loss_weights=loss_weights
    )


def aligned_loss(method, learning=True, count=3, **settings):
    """A method of single rays with the aligned loss, of `make_views`."""
    chosen = {"radius_px": 3, "patch_px": 20, "patch_rays": 32} | settings
    chosen = AlignedLoss(**chosen)
    size = HEIGHT, WIDTH
    tiles = contribution.tiles_of(size, count, chosen.patch_px, chosen.radius_px)
    count *= tiles.rows * tiles.columns
    return loss.aligned(method, chosen, tiles, count, learning=learning)


def alignerf(outputs=6, patches=2, radius_px=3, convolution=True, **options):
    """Its patches, and `patch_losses.Losses` with other options."""
    settings = {"align_penalty": 0.01, "frequency_weight": 0.05}
    return methods.alignerf(
        tiny_model(outputs=outputs),
        drawn=batches.Patches(patches, 12, radius_px),
        convolution=convolution,
        losses_of=patch_losses.Losses(**settings | options),
        loss_weights=WEIGHTS,
    )


def make_views(count=3, height=HEIGHT, width=WIDTH, valid_fraction=0.7):
    """Random photos by cameras that look down -z, without turning, from one place."""
    rng = np.random.default_rng(0)
    pixtocam = cameras.intrinsics(FOCAL_PX, width, height)
    camtoworld = np.concatenate([np.eye(3), [[0.0], [0.0], [1.0]]], axis=1)
    mask = rng.uniform(size=(count, height, width)) < valid_fraction
    return batches.Views(
        photos=jnp.asarray(rng.integers(0, 256, (count, height, width, 3)), jnp.uint8),
        valid=jnp.asarray(batches.pack_valid(mask)),
        pixtocams=jnp.asarray(np.stack([pixtocam] * count), jnp.float32),
        camtoworlds=jnp.asarray(np.stack([camtoworld] * count), jnp.float32),
    )


def start(method, steps=50, **options):
    """(fresh state, step of the state and the views) of a method."""
    adam = train_step.Adam(
        (1e-2, 1e-3), (0.9, 0.999), 1e-15, running_means=method.running_means
    )
    optimizer = adam(train_step.Schedule(steps, 5, 0))
    params = jax.jit(method.init)(jax.random.key(0))
    state = train_step.State(jnp.zeros((), jnp.int32), params, optimizer.init(params))
    options = {"gradient_norm": None} | options
    seed = options.pop("seed", 0)
    step = train_step.make_step(method, adam, **options)
    schedule = train_step.Schedule(jnp.int32(steps), jnp.int32(5), jnp.uint32(seed))
    return state, functools.partial(step, schedule=schedule)
