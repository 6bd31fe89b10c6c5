"""What a scene's trainings and renders take, from a timed step of each. No JAX here."""

import math
import os
from typing import NamedTuple

from alignerf.causes.shared import misalignment
from alignerf.experiment import decisions, jobs
from alignerf.io import json_files

# Of a ray's seconds in a training: without gradients, which take twice as long.
RENDER_FRACTION = 1 / 3
# A training's own speed differs by a fifth from the one that is timed before.
SAFE = 1.2
# Of what is free: the rest is for what others take meanwhile.
USABLE = 0.9
# Keys that no compiled step depends on.
LENGTH = {"steps", "budget_min", "warmup_steps", "learning_rates"}
UNTIMED = {"stage", "pretrain_fraction", "align", "pose_optimization", "auto"}
UNTIMED |= {"decisions", "scaled", "seed"}


class Rates(NamedTuple):
    """Seconds and bytes of a training on this machine; of another program's 0."""

    start_s: float = 0.0
    step_s: float = 0.0
    peak_bytes: int = 0


class Views(NamedTuple):
    """Numbers of a scene's views, and of pixels of each."""

    train: int
    test: int
    pixels: int


def of_scene(experiment, scene):
    """What `snakemake SCENE` has to train, as JSON can have it.

    trainings, in an order in which they can run: `name`, the folder below the scene's;
    `job`, the slice, null of another program's; `after`, names of those that it needs;
    `splits` that are rendered; `crop`, of crops of the scene's photos. judged: the
    verdict's training.
    """
    found = {
        one.folder: {
            "name": one.folder,
            "job": one.job.model_dump() if one.job.ours else None,
            "after": [before.folder for before in one.after],
            "splits": experiment.splits(scene, one.folder),
            "crop": None,
        }
        for one in experiment.trainings(scene).values()
    }
    judged = experiment.reference_folder(scene, 0).name
    crops = []
    for name in experiment.crops(scene) if judged in found else ():
        crop, steps = experiment.scenes[name].crop, experiment.scenes[name].steps
        cameras = crop.cameras and experiment.at(scene, crop.cameras, 0).folder
        more = {"name": f"{os.pardir}/{name}/{judged}", "splits": ["train", "test"]}
        more["after"] = [cameras] if cameras else []
        more["crop"] = crop.model_dump() | {"steps": steps}
        crops.append(found[judged] | more)
    return {"trainings": [*found.values(), *crops], "judged": judged}


def as_json(experiment, scene):
    """The same as text."""
    return json_files.canonical(of_scene(experiment, scene))


def job_of(one) -> jobs.Job | None:
    """The job of a training with its decided settings; None of another program's."""
    return one["job"] and jobs.parse(jobs.fill(one["job"]))


def program_of(job: jobs.Job):
    """The settings that a job's compiled step depends on, as text: it is timed once."""
    shared = job.model_dump(exclude=UNTIMED | {"training"})
    return json_files.canonical([shared, job.training.model_dump(exclude=LENGTH)])


def estimated(work, rates, views: Views, cores, parallel_jobs):
    """{wall_s, memory_bytes, length, said} of `of_scene`; rates: {training: Rates}."""
    ways, every = {}, work["trainings"]
    seconds = {one["name"]: seconds_of(one, rates[one["name"]], views) for one in every}
    for one in every:
        before = max((ways[name] for name in one["after"]), default=0.0)
        ways[one["name"]] = before + seconds[one["name"]]
    # All cores are busy, or the longest way is gone.
    wall_s = max(sum(seconds.values()) / parallel_jobs, *ways.values(), 0.0)
    # Those on one way wait for each other.
    ends = len(ways) - len({name for one in every for name in one["after"]})
    peaks = sorted(rate.peak_bytes for rate in rates.values())
    memory = sum(peaks[-min(parallel_jobs, max(1, ends)) :])
    said = (
        f"trainings and renders take about {math.ceil(wall_s / 60)} min on {cores} "
        f"cores, and {gigabytes(memory)} of memory"
    )
    if not all(one["job"] for one in every):
        said += ", without those of other programs"
    found = {"wall_s": round(wall_s, 1), "memory_bytes": memory, "said": said}
    return found | {"length": length_of(work, rates, views)}


def seconds_of(one, rate: Rates, views: Views):
    """Seconds of a training and of its renders."""
    if not (job := job_of(one)):
        return 0.0
    minutes, pixels = job.budget_min, views.pixels
    length_s = 60 * minutes if minutes else job.steps * job.mean_step * rate.step_s
    if crop := one["crop"]:
        pixels = crop["count"] * crop["px"] ** 2
        length_s = crop["steps"] * rate.step_s
        if one["job"]["scaled"]:
            passes = decisions.EPOCHS * views.train * pixels / job.training.batch_rays
            length_s *= max(1.0, passes / decisions.STEPS[0])
    rays = pixels * sum(getattr(views, split) for split in one["splits"])
    render_s = RENDER_FRACTION * rate.step_s * rays / job.rays_per_step
    return (1 + bool(rays)) * rate.start_s + length_s + render_s


def length_of(work, rates, views: Views):
    """How long the training is that the verdict looks at; None of another program's.

    epochs: how often it sees each pixel; budget_min: of the config, or None; least_min,
    enough_min: budgets with which a verdict is possible, and none calls it short.
    """
    one = next(t for t in work["trainings"] if t["name"] == work["judged"])
    if (job := job_of(one)) is None:
        return None
    rate, pixels = rates[one["name"]], views.train * views.pixels
    budget_min = job.training.budget_min
    if budget_min is not None:
        job = jobs.with_steps(job, jobs.steps_in(job, rate.step_s))
    whole_min = pixels / job.rays_per_step / job.share * rate.step_s / 60
    least, enough = misalignment.FEW_EPOCHS / 2, misalignment.FEW_EPOCHS
    return {
        "epochs": job.steps * job.rays_per_step / pixels,
        "budget_min": budget_min,
        "least_min": math.ceil(SAFE * least * whole_min),
        "enough_min": math.ceil(SAFE * enough * whole_min),
    }


def check(scene, found, free_bytes, parallel_jobs):
    """ValueError with advice where `estimated` needs more memory than is free, or where
    a budget is too short for any verdict.
    """
    if found["memory_bytes"] > USABLE * free_bytes:
        less = "--cores 1" if parallel_jobs > 1 else "a smaller model or batch_rays"
        needed, free = gigabytes(found["memory_bytes"]), gigabytes(free_bytes)
        raise ValueError(
            f"{scene}: trainings need {needed} of memory, and {free} are free: {less}, "
            "or a larger downscale"
        )
    length = found["length"] or {}
    if not length.get("budget_min") or length["epochs"] >= misalignment.FEW_EPOCHS / 2:
        return
    least, enough = length["least_min"], length["enough_min"]
    more = f", {enough} are enough" * (enough > least)
    raise ValueError(
        f"{scene}: a budget of {length['budget_min']:g} min is too short for a "
        f"verdict: each pixel would be seen {length['epochs']:.2g} times. The least "
        f"that serves is --budget-min {least} (training.budget_min)"
        f"{more}; `preflight: false` in the config trains all the same"
    )


def gigabytes(size):
    return f"{size / 1e9:.1f} GB"
