"""The method that a job names, composed of its model, its field and its losses."""

from alignerf import fields
from alignerf.contributions import frequency_loss
from alignerf.experiment import jobs
from alignerf.experiment.keys import fields as fields_keys
from alignerf.experiment.keys import model as model_keys
from alignerf.files.environment import extensions
from alignerf.kernels import calls
from alignerf.methods import base, staged
from alignerf.mipnerf360 import model as mipnerf360
from alignerf.networks import convnet
from alignerf.systems import instant_ngp, mipnerf, nerf, nerfpp, rendering
from alignerf.training import methods

# What each kind of model but mip-NeRF 360 is made by.
SYSTEMS = {"nerf": nerf, "mipnerf": mipnerf, "nerfpp": nerfpp}
SYSTEMS |= {
    system.Keys.default("kind"): system
    for system in extensions.of_group("systems").values()
}


def make_method(job: jobs.Job, loaded=None, *, to_train=True) -> methods.Method:
    """The method of a job: baseline, or AligNeRF in its fine-tuning stage.

    loaded: the scene, whose cameras may be learnt. to_train: False leaves out the
    weights file, which only the loss needs.
    """
    part = base.part_of(job)
    return part.wrapped(without_cameras(job, part, to_train=to_train), loaded)


def without_cameras(job: jobs.Job, part: base.Part, *, to_train) -> methods.Method:
    """The method by cameras as they are; what learns them differentiates its rays."""
    moving = part.moving is not None
    if job.model.kind != "mipnerf360":
        return make_system(job, moving=moving)
    fine, native = job.stage == "finetune", calls.use(job.training.kernels)
    outputs = {"outputs": job.alignerf.outputs} if fine else {}

    def field(chosen, **options):
        # Other fields look nothing up.
        known = {"native": native} if chosen.kind == "grid" else {}
        return make_field(chosen, **known, **options)

    moves = {"moving": True} if moving and job.model.field.kind == "grid" else {}
    model = mipnerf360.Model(
        proposal=field(job.model.proposal) if len(job.model.samples) > 1 else None,
        field=field(job.model.field, **outputs, **moves),
        samples=tuple(job.model.samples),
        near=job.model.near,
        far=job.model.far,
        radius=job.model.radius,
        background=job.model.background,
        native=native,
    )
    squares = model_keys.squares_errors(job.model.model_dump())
    shared = {
        "loss_weights": methods.LossWeights(
            job.training.interlevel_weight,
            0.0 if squares else job.training.distortion_weight,
        ),
        "proposal_share": job.training.proposal_share,
    }
    if not fine:
        own_loss = {"data_loss": rendering.squared()} if squares else {}
        return methods.mipnerf360(
            model,
            batch_rays=job.training.batch_rays,
            annealed=job.annealed,
            coarse_to_fine=part.coarse_to_fine,
            **shared,
            **own_loss,
        )
    chosen = job.alignerf
    return methods.alignerf(
        model,
        patches=chosen.patches,
        patch_px=chosen.patch_px,
        convolution=chosen.convolution,
        loss=make_loss(chosen, to_train=to_train),
        **shared,
    )


def make_system(job: jobs.Job, *, moving) -> methods.Method:
    """The method of another system of the paper, with its own loss."""
    training = job.training
    if job.model.kind == "ngp":
        native = calls.use(training.kernels)
        model, loss = instant_ngp.make(job.model, moving=moving, native=native)
        return methods.mipnerf360(
            model,
            batch_rays=training.batch_rays,
            annealed=job.annealed,
            data_loss=loss,
            loss_weights=methods.LossWeights(training.interlevel_weight, 0.0),
            proposal_share=training.proposal_share,
        )
    model, loss = SYSTEMS[job.model.kind].make(job.model)
    return methods.single_rays(model, loss, batch_rays=training.batch_rays)


def make_loss(chosen: staged.Finetuning, *, to_train) -> methods.Loss:
    """The loss of fine-tuning; without a radius yet (see `train`), one of 0."""
    return methods.Loss(
        matching=chosen.matching,
        error=chosen.error,
        radius_px=chosen.radius_px or 0,
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


def make_field(
    chosen: fields_keys.Grid | fields_keys.Mlp | fields_keys.Nerf, **options
):
    """The field of these settings; options, as `outputs`, are added to them."""
    settings = chosen.model_dump() | options
    return fields.make(
        **{k: tuple(v) if isinstance(v, list) else v for k, v in settings.items()}
    )
