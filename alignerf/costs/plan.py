"""A scene's plan as tasks with seconds and bytes. No JAX here.

A training's step and the flow of some photos are timed on this machine (`Rates`,
`Flow`); a task takes as much times its number of steps, rays or views. All else is
starts of processes, and a constant a megapixel of test views.
"""

import math
import os
from typing import NamedTuple

from alignerf.causes import shift
from alignerf.experiment import decisions, jobs, plan
from alignerf.experiment.step import flow_options, words
from alignerf.io import json_files

# Of a ray's seconds in a training: without gradients, which take twice as long.
RENDER_FRACTION = 1 / 3
# Seconds a megapixel to score a test view and to take its flow apart, where a process
# starts in START_S. Then: of Snakemake, for each job besides the process.
SCORES_S, START_S, JOB_S = 10.0, 0.6, 0.4
# Flows and images of each test view in the warped test set and its control sets.
TEST_SETS = 7
# Bytes on disk of a training: a parameter takes 4 in the model's file and 12 in the
# checkpoint, which has Adam's two moments. Then: logs and tables, and a pixel's depth.
PARAM_BYTES, SMALL_BYTES, DEPTH_BYTES = 16, 100_000, 4
# Bytes of memory of an alignment: its libraries and programs; for a pixel of its small
# images, and for one of the second copy of the photos. The least side of the former.
ALIGNER_BYTES, ALIGNED_BYTES, RGB_BYTES, FLOW_SIDE = 140_000_000, 44, 3, 48
# A training's own speed differs by a fifth from the one that is timed before.
SAFE = 1.2
# Keys that no compiled step depends on.
LENGTH = {"steps", "budget_min", "warmup_steps", "learning_rates"}
UNTIMED = {"stage", "pretrain_fraction", "align", "pose_optimization", "auto"}
UNTIMED |= {"decisions"}


class Rates(NamedTuple):
    """Seconds and bytes of a training on this machine; of another program's 0."""

    start_s: float = 0.0
    compile_s: float = 0.0
    step_s: float = 0.0
    params: int = 0
    peak_bytes: int = 0


class Flow(NamedTuple):
    """The cost of a flow process: its start, a view, and a view's files."""

    start_s: float
    view_s: float
    view_bytes: float


class Views(NamedTuple):
    """Number and size of a scene's views; side: the smaller one of a photo, in px."""

    train: int
    test: int
    pixels: int
    image_bytes: int
    side: int


class Task(NamedTuple):
    """A job: `seconds` on `threads` cores.

    file: an output of its rule, below the scene's folder. new_bytes: left on the disk.
    peak_bytes: of memory, where that is much.
    """

    kind: str
    file: str
    seconds: float
    new_bytes: int = 0
    peak_bytes: int = 0
    threads: int = 1


def of_scene(experiment, scene):
    """What `snakemake SCENE` has to train, as JSON can have it.

    trainings, in an order in which they can run: `name`, the folder below the scene's;
    `job`, the slice; `external`, that it is another program's; `after`, names of those
    that it needs; `splits` that are rendered and aligned; `crop`, of crops of the
    scene's photos. With `rounds: auto` all rounds are counted that there may be.
    """
    longest = plan.Experiment(experiment.config, lambda **place: True)
    found = {
        one.folder: {
            "name": one.folder,
            "job": one.job.model_dump(),
            "external": not one.job.ours,
            "after": list(dict.fromkeys(t.folder for t in (*one.after, *one.flows))),
            "splits": longest.splits(scene, one.folder),
            "crop": None,
        }
        for one in longest.trainings(scene).values()
    }
    judged = longest.reference_folder(scene, 0).name
    crops = []
    for name in experiment.crops(scene) if judged in found else ():
        crop, steps = (experiment.scenes[name][key] for key in ("crop", "steps"))
        cameras = crop["cameras"] and longest.at(scene, crop["cameras"], 0).folder
        more = {"name": f"{os.pardir}/{name}/{judged}", "splits": ["train", "test"]}
        more |= {"after": [cameras] if cameras else [], "crop": crop | {"steps": steps}}
        crops.append(found[judged] | more)
    return {
        "trainings": [*found.values(), *crops],
        "judged": judged,
        "scored": len(experiment.names("trains", False)),
        "moved": experiment.config["aligned_pose"] and 1 + experiment.has_truth(scene),
        "flow": words("", **flow_options(experiment))[1:],
    }


def as_json(experiment, scene):
    """The same as text."""
    return json_files.canonical(of_scene(experiment, scene))


def job_of(one) -> jobs.Job | None:
    """The job of a training with its decided settings; None of another program's."""
    return None if one["external"] else jobs.parse(decisions.fill(one["job"]))


def program_of(job: jobs.Job):
    """The settings that a job's compiled step depends on, as text: it is timed once."""
    shared = job.model_dump(exclude=UNTIMED | {"training"})
    return json_files.canonical([shared, job.training.model_dump(exclude=LENGTH)])


def tasks_of(work, rates, flow: Flow, views: Views, threads):
    """{training: its tasks} of `of_scene`; "": the last one. rates: {training: Rates}.

    threads: of a training.
    """
    seconds = 6 * flow.start_s + TEST_SETS * views.test * flow.view_s
    seconds += (1 + work["scored"]) * scores_s(flow, views)
    size = round(TEST_SETS * views.test * flow.view_bytes)
    found = {
        one["name"]: of_training(one, work["moved"], rates[one["name"]], flow, views)
        for one in work["trainings"]
    } | {"": [Task("rest", "verdict.json", seconds, size)]}
    return {
        name: [
            task._replace(
                seconds=round(task.seconds + JOB_S, 2),
                threads=threads if task.peak_bytes else 1,
            )
            for task in tasks
        ]
        for name, tasks in found.items()
    }


def of_training(one, moved, rate: Rates, flow: Flow, views: Views):
    """The tasks of a training, of its renders, of their flow and of their scores."""
    name, job, crop = one["name"], job_of(one), one["crop"]
    if crop:
        share = crop["count"] * crop["px"] ** 2 / views.pixels
        flow = Flow(flow.start_s, share * flow.view_s, share * flow.view_bytes)
        pixels, size = round(share * views.pixels), round(share * views.image_bytes)
        views = views._replace(pixels=pixels, image_bytes=size, side=crop["px"])
        times = 1.0
        if "steps" in one["job"]["training"].get("decided", ()):
            passes = decisions.EPOCHS * views.train * pixels / job.training.batch_rays
            times = max(1.0, passes / decisions.STEPS[0])
        job = jobs.with_steps(job, round(crop["steps"] * times))
        job = job.changed(training=job.training.model_copy(update={"budget_min": None}))
    pixel_s = RENDER_FRACTION * rate.step_s / job.rays_per_step if job else 0.0
    begin_s = rate.start_s + rate.compile_s
    length_s, more_bytes = loop_of(job, rate, pixel_s, flow, views) if job else (0.0, 0)
    size, peak = PARAM_BYTES * rate.params + SMALL_BYTES, rate.peak_bytes + more_bytes
    yield Task("train", f"{name}/timing.json", begin_s + length_s, size, peak)
    if not (count := sum(getattr(views, split) for split in one["splits"])):
        return
    size = count * (views.image_bytes + DEPTH_BYTES * views.pixels)
    seconds = begin_s + count * views.pixels * pixel_s
    yield Task("render", f"{name}/render", seconds, size, rate.peak_bytes)
    seconds, size = flow.start_s + count * flow.view_s, round(count * flow.view_bytes)
    yield Task("flow", f"{name}/displacement", seconds, size)
    if "test" in one["splits"] and not crop:
        seconds, size = 4 * flow.start_s + scores_s(flow, views), size * views.test
        yield Task("rest", f"{name}/metrics.csv", seconds, 2 * size // count)
        if moved and job:
            seconds += begin_s + moved * views.test * views.pixels * pixel_s
            file, size = f"{name}/metrics_aligned_pose.csv", views.test * size // count
            yield Task("rest", file, seconds, size, rate.peak_bytes)


def loop_of(job, rate: Rates, pixel_s, flow: Flow, views: Views):
    """(seconds of a training's steps and alignments, their bytes of memory)."""
    minutes = job.budget_min
    seconds = (
        job.steps * rate.step_s * job.mean_step if minutes is None else 60 * minutes
    )
    if not job.aligns:
        return seconds, 0
    share = 1 / max(1, min(job.aligns.shrink, views.side // FLOW_SIDE)) ** 2
    places = {*job.aligns.cameras_at, *job.aligns.photos_at}
    # Where none moves by a look, one tells whether cameras are learnt.
    looks = max(len(places), 1) * views.train
    look_s = share * (views.pixels * pixel_s + flow.view_s)
    size = (RGB_BYTES + share * ALIGNED_BYTES) * views.train * views.pixels
    # Its renderer and, where cameras are learnt, another step are compiled.
    compile_s = rate.compile_s * (1 + bool(job.learns))
    return seconds + compile_s + looks * look_s, ALIGNER_BYTES + int(size)


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
    least, enough = shift.FEW_EPOCHS / 2, shift.FEW_EPOCHS
    return {
        "epochs": job.steps * job.rays_per_step / pixels,
        "budget_min": budget_min,
        "least_min": math.ceil(SAFE * least * whole_min),
        "enough_min": math.ceil(SAFE * enough * whole_min),
    }


def scores_s(flow: Flow, views: Views):
    """Seconds to score all test views."""
    return flow.start_s / START_S * SCORES_S * 1e-6 * views.test * views.pixels


def wall_s(work, tasks, cores) -> float:
    """Seconds until all tasks are done: all cores are busy, or the longest way is gone.

    tasks: of `tasks_of`.
    """
    ways = {}
    for one in work["trainings"]:
        before = max((ways[name] for name in one["after"]), default=0.0)
        ways[one["name"]] = before + sum(task.seconds for task in tasks[one["name"]])
    every = [task for own in tasks.values() for task in own]
    busy_s = sum(task.seconds * min(task.threads, cores) for task in every) / cores
    return max(busy_s, max(ways.values(), default=0.0) + tasks[""][0].seconds)


def peak_bytes(work, tasks, at_once) -> int:
    """Memory of so many tasks at once; those on one way wait for each other."""
    needed = {name for one in work["trainings"] for name in one["after"]}
    ends = sum(one["name"] not in needed for one in work["trainings"])
    most = [max(task.peak_bytes for task in own) for own in tasks.values()]
    return sum(sorted(most)[-min(at_once, max(1, ends)) :])
