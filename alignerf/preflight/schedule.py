"""The tasks of a scene's plan, each with seconds and bytes. No JAX here.

Trainings, renderings and flows were timed on this machine (`Rates`, `Flow`). All other
tasks are short. Their seconds are a process's start and a constant a megapixel; `pace`
scales the constants to this machine.
"""

import os
from typing import NamedTuple

from alignerf.decisions import rules
from alignerf.experiment import jobs
from alignerf.preflight.simulate import Task

# Flows that the control sets estimate for each test view.
CONTROL_FLOWS = 6
# Measured on one machine: the seconds in which a flow process starts; then seconds a
# megapixel to score a view in all test sets, to decompose a flow into the camera's part
# and the rest, to draw the figures, and to make the verdict.
START_S = 0.6
EVALUATE_S, DECOMPOSE_S, FIGURES_S, VERDICT_S = 3.0, 7.0, 1.0, 1.0
# Seconds to decode a phone's photo of 3 megapixels, and to undo its lens.
DECODE_S = 0.5
# Seconds that Snakemake takes for each job besides the process.
JOB_S = 0.4
# Seconds a megapixel to correct cameras: each view's flow is fitted a few times.
CORRECT_S = 2.4
# Of the seconds of a flow and its check, where a faster estimator checks it: those of
# `alignment.look.CHECKED_BY`.
CHECKED_SHARE = {"deepflow": 0.65}
# Start of a process with Pandas or Matplotlib over the start of a flow process.
SLOW_START = 3.0
# Bytes on disk of a training, without its views. A parameter takes 4 in the model's
# file and 12 in the checkpoint, which has Adam's two moments. Then: logs and tables.
PARAM_BYTES, SMALL_BYTES = 16, 100_000
DEPTH_BYTES, RGB_BYTES = 4, 3
# Of an alignment: the least smaller side in px of its small images, and the bytes of
# memory for each of their pixels.
FLOW_SIDE, ALIGNED_BYTES = 48, 44
# Images, and flows, on disk for each test view in the warped set and its control sets.
TESTSET_IMAGES, TESTSET_FLOWS = 7, 2


class Rates(NamedTuple):
    """The cost of a training and of its rendering on this machine."""

    start_s: float
    compile_s: float
    step_s: float
    params: int
    peak_bytes: int
    render_start_s: float
    render_compile_s: float
    pixel_s: float
    render_peak_bytes: int


# Of another program's: what it takes is not known, and counts nothing.
UNKNOWN = Rates(0.0, 0.0, 0.0, 0, 0, 0.0, 0.0, 0.0, 0)


class Flow(NamedTuple):
    """The cost of a flow process: its start, a view, and a view's files."""

    start_s: float
    view_s: float
    flow_bytes: int
    warped_bytes: int


class Views(NamedTuple):
    """Number and size of a scene's views."""

    train: int
    test: int
    pixels: int
    image_bytes: int
    # Smaller side of a photo in px.
    side: int = 0

    def number(self, splits):
        return sum(getattr(self, split) for split in splits)


def program_of(job):
    """The settings of a job that its compiled step depends on.

    Jobs with equal settings share measured `Rates`. The length of a training is left
    out: it is an input of the compiled step.
    """
    unlike = {"steps", "budget_min", "warmup_steps", "learning_rates"}
    shared = job | {"training": without(job["training"], unlike)}
    shared["model"] = job["model"] | {
        "training": without(job["model"].get("training", {}), unlike)
    }
    if job["stage"] == "pretrain":
        shared |= {"stage": "full"}
    shared.pop("pretrain_share", None)
    shared.pop("align", None)
    shared.pop("refine", None)
    if job.get("refine"):
        shared["refine"] = job["refine"]
    return shared


def without(mapping, keys):
    return {key: value for key, value in mapping.items() if key not in keys}


def tasks_of(work, rates, flow: Flow, views: Views, *, threads) -> list[Task]:
    """All tasks of a scene after its poses, in an order in which they can run.

    work: of `experiment.cluster.work.of_scene`. rates: the `Rates` of each entry of
    work["trainings"], in the same order. threads: of a training.
    """
    tasks = []
    for one, rate in zip(work["trainings"], rates, strict=True):
        tasks += training(one, rate, flow, views, threads=threads)
        if one["scored"]:
            tasks += scores(one, work, rate, flow, views, threads=threads)
    # All scores wait for the test sets, so this task comes before the first score.
    at = next((i for i, t in enumerate(tasks) if t.kind == "score"), len(tasks))
    tasks.insert(at, controls(work, flow, views))
    tasks += for_verdict(work, flow, views)
    tasks += for_windows(work, rates, flow, views, threads=threads)
    tasks.append(tables(work, flow, views, [task.name for task in tasks]))
    return [task._replace(seconds=task.seconds + JOB_S) for task in tasks]


def controls(work, flow: Flow, views: Views):
    """The task of the warped test set and its control sets."""
    seconds = 2 * flow.start_s + views.test * flow.view_s * (1 + CONTROL_FLOWS)
    sets = TESTSET_IMAGES * flow.warped_bytes + TESTSET_FLOWS * flow.flow_bytes
    return Task(
        *("testset", "rest", seconds, 1, [f"{work['reference']}/render"]),
        *("testset/overfit.csv", views.test * sets),
    )


def for_verdict(work, flow: Flow, views: Views):
    """The task that decomposes all views' flow for the verdict, two files a view."""
    name = work["verdict"]
    for one in work["trainings"]:
        if one["name"] == name:
            count = views.number(one["renders"])
            seconds = 2 * flow.start_s + decompose_s(flow, count * views.pixels)
            yield Task(
                *(f"{name}/parts_photos", "rest", seconds, 1, [f"{name}/flow"]),
                *(f"{name}/decomposition_photos_test.csv", 2 * count * flow.flow_bytes),
            )


def for_windows(work, rates, flow: Flow, views: Views, *, threads):
    """The tasks of windows at the photos' own size, which are trained like the rest."""
    names = [one["name"] for one in work["trainings"]]
    at = names.index(work["verdict"])
    tasks = []
    for windows in work.get("windows", ()):
        zoom = windows["zoom"]
        share = zoom["px"] ** 2 / views.pixels
        each = views._replace(
            train=zoom["count"] * views.train,
            test=zoom["count"] * views.test,
            pixels=zoom["px"] ** 2,
            image_bytes=round(share * views.image_bytes),
            side=zoom["px"],
        )
        flows = flow._replace(
            view_s=share * flow.view_s,
            flow_bytes=round(share * flow.flow_bytes),
            warped_bytes=round(share * flow.warped_bytes),
        )
        job = work["trainings"][at]["job"]
        seen = rules.PASSES * each.train * each.pixels / job["training"]["batch_rays"]
        steps = windows["steps"] * max(1, seen / rules.STEPS[0])
        length = {"steps": round(steps), "budget_min": None}
        job = job | {"training": job["training"] | length}
        # Tasks are named below the scene's folder; windows lie beside it.
        one = {"name": f"{os.pardir}/{windows['name']}/{names[at]}", "job": job}
        one |= {"renders": ["train", "test"], "corrects": False}
        one |= {"after": [windows["after"]] if windows["after"] else []}
        tasks += training(one, rates[at], flows, each, threads=threads)
        # Photos are decoded at their own size, before the training.
        photos = views.train + views.test
        parts_s = decompose_s(flow, zoom["count"] * photos * each.pixels)
        decode_s = pace(flow) * DECODE_S * photos
        tasks[-1] = tasks[-1]._replace(seconds=tasks[-1].seconds + parts_s + decode_s)
    return tasks


def tables(work, flow: Flow, views: Views, every):
    """The last task: facts, tables, figures and the verdict."""
    megapixels = 1e-6 * views.test * views.pixels
    seconds = pace(flow) * megapixels * (FIGURES_S * rounds(work) + VERDICT_S)
    seconds += 4 * SLOW_START * flow.start_s
    seconds += work["given"] * (flow.start_s + evaluate_s(flow, views))
    return Task("tables", "rest", seconds, 1, every, "verdict.json", SMALL_BYTES)


def rounds(work):
    """The number of trainings whose test views are scored."""
    return sum(one["scored"] for one in work["trainings"])


def pace(flow: Flow):
    """The slowness of this machine: 1 on the machine that the constants are from."""
    return flow.start_s / START_S


def decompose_s(flow: Flow, pixels):
    """Seconds to fit cameras to the flow of so many pixels."""
    return pace(flow) * DECOMPOSE_S * 1e-6 * pixels


def evaluate_s(flow: Flow, views: Views):
    """Seconds to score the test views in all test sets."""
    return pace(flow) * EVALUATE_S * 1e-6 * views.test * views.pixels


def training(one, rate: Rates, flow: Flow, views: Views, *, threads):
    """The tasks of a training, of its renders and of their flow."""
    name, splits = one["name"], one["renders"]
    count = views.number(splits)
    corrects_s = pace(flow) * CORRECT_S * 1e-6 * views.train * views.pixels
    before_s = (flow.start_s + corrects_s) if one["corrects"] else 0.0
    own_s, photos_bytes, more_bytes = of_job(one, rate, flow, views)
    train = Task(
        *(f"{name}/train", "train", before_s + own_s),
        *(threads, [f"{before}/flow" for before in one["after"]]),
        f"{name}/timing.json",
        PARAM_BYTES * rate.params + SMALL_BYTES + photos_bytes,
        rate.peak_bytes + more_bytes,
    )
    if not splits:
        # There is no flow task: the training takes that name, which others wait for.
        return [train._replace(name=f"{name}/flow")]
    render = Task(
        *(f"{name}/render", "render", render_s(rate, count * views.pixels), threads),
        *([train.name], f"{name}/render/{splits[-1]}.json"),
        count * (views.image_bytes + DEPTH_BYTES * views.pixels),
        rate.render_peak_bytes,
    )
    aligned = Task(
        *(f"{name}/flow", "flow", flow.start_s + count * flow.view_s, 1),
        *([render.name], f"{name}/displacement/{splits[-1]}.csv"),
        count * (flow.flow_bytes + flow.warped_bytes),
    )
    return [train, render, aligned]


def of_job(one, rate: Rates, flow: Flow, views: Views):
    """(seconds, bytes of photos on disk, more bytes of memory) of a training alone.

    Another program's time is not known; it gets a copy of all photos.
    """
    if one.get("external"):
        return 0.0, (views.train + views.test) * views.image_bytes, 0
    job = jobs.parse(one["job"])
    minutes = job.budget_min
    loop_s = job.steps * rate.step_s if minutes is None else 60 * minutes
    photos_bytes = views.train * views.image_bytes if job.align else 0
    seconds = rate.start_s + rate.compile_s + loop_s + aligns_s(job, rate, flow, views)
    return seconds, photos_bytes, aligns_bytes(job, views)


def aligns_s(job, rate: Rates, flow: Flow, views: Views):
    """Seconds of a training's alignments: small renders, their flow, the cameras.

    Of all views; where nothing is wrong, an early look sees some of them only.
    """
    if not job.align:
        return 0.0
    count = len({*job.align.cameras_at, *job.align.photos_at})
    share = 1 / shrink_of(job, views) ** 2
    flow_s = CHECKED_SHARE.get(job.align.estimator, 1.0) * flow.view_s
    view_s = share * (views.pixels * rate.pixel_s + flow_s)
    corrects_s = pace(flow) * CORRECT_S * 1e-6 * views.pixels * share
    return rate.render_compile_s + count * views.train * (view_s + corrects_s)


def shrink_of(job, views: Views):
    """Factor by which an alignment's renders are smaller, as `look.factor` chooses."""
    return max(1, min(job.align.shrink, views.side // FLOW_SIDE))


def aligns_bytes(job, views: Views):
    """Extra memory of alignments: a second copy of the photos, and small images."""
    if not job.align:
        return 0
    small = ALIGNED_BYTES / shrink_of(job, views) ** 2
    return int((RGB_BYTES + small) * views.train * views.pixels)


def render_s(rate: Rates, pixels):
    """Seconds of a process that renders so many pixels."""
    return rate.render_start_s + rate.render_compile_s + pixels * rate.pixel_s


def scores(one, work, rate: Rates, flow: Flow, views: Views, *, threads):
    """The tasks on a training's test views: their flow decomposed, and their scores."""
    name, pixels = one["name"], views.test * views.pixels
    targets = 2 if work["truth"] else 1
    parts_s = flow.start_s + decompose_s(flow, pixels)
    flows = 2
    if work["truth"]:
        # The flow to the oracle is estimated too; two more flow files are written.
        parts_s += views.test * flow.view_s
        flows = 4
    parts = Task(
        *(f"{name}/parts", "rest", parts_s, 1, [f"{name}/flow"]),
        *(f"{name}/decomposition_test.csv", flows * views.test * flow.flow_bytes),
    )
    scored = Task(
        *(f"{name}/scores", "score", SLOW_START * flow.start_s, 1),
        *([f"{name}/flow", "testset"], f"{name}/metrics.csv", 0),
    )
    scored = scored._replace(seconds=scored.seconds + evaluate_s(flow, views))
    # By moved cameras only a model of ours can be asked.
    if not work["aligned_pose"] or one.get("external"):
        return [parts, scored]
    moved_s = render_s(rate, targets * pixels) + SLOW_START * flow.start_s
    moved_s += decompose_s(flow, pixels * targets)
    moved = Task(
        *(f"{name}/aligned_pose", "rest", moved_s, threads, [parts.name]),
        f"{name}/metrics_aligned_pose.csv",
        targets * views.test * views.image_bytes,
        rate.render_peak_bytes,
    )
    return [parts, moved, scored]
