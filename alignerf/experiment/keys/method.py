"""Keys of `methods`: what is trained, stage by stage and round by round."""

from typing import Literal

import pydantic

from alignerf.experiment.keys import estimators
from alignerf.experiment.keys.key import Keys, key, learning_rates
from alignerf.files.environment import extensions


class WarmStart(Keys):
    from_: str = key(
        what="method of the same model whose round 0 it starts from", alias="from"
    )
    share: float = key(
        0.3, "of training.steps, in each round of warping", above=0, most=1
    )
    learning_rates: list[float] = learning_rates(0.01, 0.001)


class AligNeRF(Keys):
    """The three contributions and the two stages' shares of the steps."""

    pretrain_share: float = key(
        0.6, "of training.steps, as the baseline", above=0, most=1
    )
    finetune_share: float = key(0.2, "of training.steps, on patches", above=0, most=1)
    learning_rates: list[float] = learning_rates(0.003, 0.0003)
    patches: int = key(4, "patches a step", least=1, most=4096)
    patch_px: int = key(16, "side of a patch", least=8, most=512)
    convolution: bool = key(
        True, "contribution 1, patch convolution; false shows the model's colours"
    )
    features: int = key(16, "N of the patch convolution", least=3, most=1024)
    matching: Literal["patch", "pixel"] = key(
        "patch",
        "contribution 2, what moves over the photo: a whole patch (Eq. 4), or every "
        "pixel on its own (contextual loss, which the paper compares with)",
    )
    error: Literal["squared", "charbonnier"] = key(
        "squared",
        "of the render and what it was matched with: squared (as printed), or "
        "charbonnier (the baseline's)",
    )
    radius_px: int | Literal["auto"] = key(
        8,
        "largest offset searched; 0 searches none; auto takes it from the displacement "
        "of the training views after the baseline's first round",
        least=0,
        most=64,
    )
    align_penalty: float = key(
        0.01,
        "weight of the offset's length in px: lambda of Eq. 4 against the error summed "
        "over a patch; of a pixel against its mean squared error",
        least=0,
        most=1e6,
    )
    frequency_weight: float = key(
        0.05,
        "contribution 3, w of the high-frequency loss; 0 has none",
        least=0,
        most=1e6,
    )


class Refine(Keys):
    """Cameras learnt with the scene, as BARF and CamP do."""

    learning_rates: list[float] = learning_rates(0.001, 0.00001)
    delay_share: float = key(
        0.1, "of the steps before the cameras may move", least=0, most=0.99
    )
    preconditioned: bool = key(
        True, "turns and steps in units that move pixels alike, as CamP"
    )
    coarse_to_fine: list[float] | None = key(
        None,
        "shares of the steps between which the field's frequencies, or the levels of "
        "a grid, come in one by one; BARF's are 0.1 and 0.5; null: all from the start",
        least=0,
        most=1,
        length=(2, 2),
    )


class Align(Keys):
    """Alignment on the way: where one training stops, and what it puts right there."""

    cameras_at: list[float] = key(
        [0.15, 0.35],
        "shares of the steps at which the cameras of the training views are put right",
        above=0,
        most=0.99,
        length=(0, 16),
    )
    photos_at: list[float] = key(
        [0.35],
        "shares of the steps at which photos are warped, after the cameras if both",
        above=0,
        most=0.99,
        length=(0, 16),
    )
    photos: Literal["moving", "whole"] = key(
        "moving",
        "what a photo is warped by: what no moved camera explains of its flow, or all",
    )
    shrink: int = key(
        3,
        "renders and photos are made smaller by at most this factor for the flow; less "
        "where the estimator would have too few pixels a side",
        least=1,
        most=16,
    )
    least_move_px: float = key(
        0.12,
        "where the median camera would move by less, in px of the small renders, that "
        "is the flow's own error and all stay; more early in the training, less once "
        "cameras were seen to be wrong",
        least=0,
        most=100,
    )
    estimator: Literal[estimators.FAST] = key(
        "deepflow", "of the flow, see `flow.estimator`"
    )
    match_blur: bool = key(
        False, "blur the photo like the render, for the estimate only"
    )


class External(Keys):
    """Another program, which trains and renders: docs/howto/any_trainer.md."""

    train: str | None = key(
        None,
        "command that trains; {data}, {model}, {cores}, {seed}, {steps}, {scene} and "
        "{round} stand for a folder or a number; no shell reads it",
        pattern=r"\S",
    )
    render: str | None = key(
        None,
        "command that renders all views as <view>.png below {renders} and, if it can, "
        "their depth as <view>.npy or .npz below {depth}; the others of train too",
        pattern=r"\S",
    )
    renders: str | None = key(
        None,
        "instead of both commands: folder of finished renders, <view>.png below; "
        "{scene} stands for the scene's name",
        pattern=r"\S",
    )
    depth: str | None = key(
        None, "beside renders: folder of their depth; {scene} too", pattern=r"\S"
    )
    gpu: int = key(0, "accelerators of each command", least=0, most=64)
    mem_mb: int | None = key(
        None, "memory of each command; null asks for the usual", least=1, most=10**9
    )


class Method(Keys):
    model: str | None = key(None, "a key of models; null takes the first")
    rounds: int | Literal["auto"] = key(
        0,
        "warping rounds after the first training; auto goes on until the flow from "
        "renders to the photos they were learnt from falls by less than a tenth, see "
        "flow/rounds.py; decision.json of each round before most_rounds says why",
        least=0,
        most=16,
    )
    most_rounds: int = key(
        4, "where `rounds: auto` ends, whatever the flow does", least=1, most=16
    )
    changes: Literal["photos", "cameras", "cameras_then_photos"] = key(
        "photos",
        "what a round changes by the flow: photos are warped, as in the paper, or the "
        "training views' cameras are put right; cameras_then_photos warps photos in "
        "the last round only; with alignerf, cameras are put right before fine-tuning",
    )
    warm_start: WarmStart | None = key(
        None,
        "each warping round goes on from the weights of the one before, instead of "
        "from scratch as in the paper",
    )
    alignerf: AligNeRF | None = key(
        None, "staged training with the three contributions"
    )
    adjust: bool = key(
        False,
        "it trains with cameras that bundle adjustment has corrected, beside methods "
        "that train with the scene's; alone, or beside align or refine",
    )
    refine: Refine | None = key(
        None, "the training views' cameras are learnt with the scene, without flow"
    )
    align: Align | None = key(
        None, "alignment on the way: the training puts right what it learns from"
    )
    external: External | None = key(
        None, "another program trains and renders: in rounds, as ours are trained"
    )
    renders: str | None = key(
        None,
        "instead of a training: folder of another program's renders of the test views, "
        "<view>.png of the scene's size (8-bit RGB); {scene} stands for the scene's "
        "name; they are scored, and no more",
        pattern=r"\S",
    )
    published: str | None = key(
        None,
        "what results/published calls the method; `snakemake comparison` shows what is "
        "printed for it",
        pattern=r"\S",
    )


def extended(kind):
    """The class with the keys of other packages' kinds of method."""
    kinds = extensions.of_group("kinds").values()
    extensions.check_new("kinds", [one.KEY for one in kinds], dir(kind()))
    more = {
        one.KEY: (
            one.Keys | None,
            key(None, (one.Keys.__doc__ or one.KEY).split("\n")[0]),
        )
        for one in kinds
    }
    return pydantic.create_model(kind.__name__, __base__=kind, **more) if more else kind


Method = extended(Method)
