"""The method that a job names, composed of its model, its field and its losses."""

import jax

from alignerf import rays
from alignerf.experiment import jobs
from alignerf.kernels import calls
from alignerf.methods import base
from alignerf.mipnerf360 import model as mipnerf360
from alignerf.training import batches, methods


def make_method(job: jobs.Job, loaded=None, *, learning=False) -> methods.Method:
    """The method of a job: the baseline, or what its part makes of it.

    loaded: the scene, whose cameras may be learnt. learning: whether what the method
    learns besides, as cameras, is learnt now.
    """
    method = without_cameras(job, learning=learning)
    return base.part_of(job).wrapped(method, loaded, learning)


def without_cameras(job: jobs.Job, *, learning=False) -> methods.Method:
    """The method by cameras as they are; learning: see `make_method`."""
    training, part = job.training, base.part_of(job)
    chosen = part.patches
    options = {"outputs": chosen.outputs} if chosen else {}
    options |= {"native": calls.use(training.kernels)}
    model, loss = job.model.made(
        rays, moving=learning and job.learns is not None, **options
    )
    loss = part.data_loss or loss
    if not isinstance(model, mipnerf360.Model):
        return methods.single_rays(model, loss, batch_rays=training.batch_rays)
    model, bounds = model.for_any_scene()
    has_none = "distortion_weight" in job.model.has_no
    shared = {
        "loss_weights": methods.LossWeights(
            training.interlevel_weight, 0.0 if has_none else training.distortion_weight
        ),
        "proposal_fraction": training.proposal_fraction,
    }
    if chosen:
        drawn = (chosen.patches, chosen.patch_px, chosen.radius_px)
        method = methods.alignerf(
            model,
            drawn=batches.Patches(*drawn),
            convolution=chosen.convolution,
            losses_of=part.patch_losses,
            **shared,
        )
    else:
        method = methods.mipnerf360(
            model,
            data_loss=loss,
            batch_rays=training.batch_rays,
            coarse_to_fine=tuple((job.learns and job.learns.coarse_to_fine) or ()),
            **shared,
        )
    return methods.within(method, bounds)


# Views of a traced step, and their side in px: a patch and what is around it fits.
TRACED = 2, 1024


def trace(job: jobs.Job):
    """Trace a step's gradient by shapes alone, which raises what its losses raise."""
    plain = job.training.model_copy(update={"kernels": "jax"})
    method = without_cameras(job.changed(training=plain))
    (n, px), shape = TRACED, jax.ShapeDtypeStruct
    views = batches.Views(
        photos=shape((n, px, px, 3), "uint8"),
        valid=shape((n, px, px // 8), "uint8"),
        pixtocams=shape((n, 3, 3), "float32"),
        camtoworlds=shape((n, 3, 4), "float32"),
    )

    def step(views):
        key = jax.random.key(0)
        batch = method.draw(key, 0, views)

        def total(params):
            return sum(method.terms(params, batch, 0.5)[0].values())

        return jax.grad(total)(method.init(key))

    jax.eval_shape(step, views)
