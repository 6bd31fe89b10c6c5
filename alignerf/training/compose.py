"""The method that a job names, composed of its model, its field and its losses."""

from alignerf import rays
from alignerf.contributions import frequency_loss
from alignerf.experiment import jobs
from alignerf.kernels import calls
from alignerf.methods import base, staged
from alignerf.mipnerf360 import model as mipnerf360
from alignerf.networks import convnet
from alignerf.training import methods


def make_method(
    job: jobs.Job, loaded=None, *, to_train=True, learning=False
) -> methods.Method:
    """The method of a job: baseline, or AligNeRF in its fine-tuning stage.

    loaded: the scene, whose cameras may be learnt. to_train: False leaves out the
    weights file, which only the loss needs. learning: whether what the method learns
    besides, as cameras, is learnt now.
    """
    method = without_cameras(job, to_train=to_train, learning=learning)
    return base.part_of(job).wrapped(method, loaded, learning)


def without_cameras(job: jobs.Job, *, to_train, learning=False) -> methods.Method:
    """The method by cameras as they are; learning: see `make_method`."""
    training, fine = job.training, job.stage == "finetune"
    options = {"outputs": job.alignerf.outputs} if fine else {}
    options |= {"native": calls.use(training.kernels)}
    model, loss = job.model.made(
        rays, moving=learning and job.learns is not None, **options
    )
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
    if not fine:
        method = methods.mipnerf360(
            model,
            data_loss=loss,
            batch_rays=training.batch_rays,
            coarse_to_fine=tuple((job.learns and job.learns.coarse_to_fine) or ()),
            **shared,
        )
        return methods.within(method, bounds)
    chosen = job.alignerf
    method = methods.alignerf(
        model,
        patches=chosen.patches,
        patch_px=chosen.patch_px,
        convolution=chosen.convolution,
        loss=make_loss(chosen, to_train=to_train),
        **shared,
    )
    return methods.within(method, bounds)


def make_loss(chosen: staged.Finetuning, *, to_train) -> methods.Loss:
    """The loss of fine-tuning."""
    return methods.Loss(
        error=chosen.error,
        radius_px=chosen.radius_px,
        align_penalty=chosen.align_penalty,
        frequency_weight=chosen.frequency_weight,
        frequency_features=frequency_features(chosen) if to_train else None,
    )


def frequency_features(chosen: staged.Finetuning):
    """VGG-19's first block, or the derivative bank; None where it weighs nothing."""
    if chosen.frequency_weight == 0:
        return None
    if chosen.frequency_weights is None:
        return frequency_loss.bank_features
    return convnet.vgg19_features(chosen.frequency_weights)
