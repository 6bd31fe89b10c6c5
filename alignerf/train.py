"""Train a method on a scene: `python -m alignerf.train`.

One product: the parameters, beside a `timing.json`. Resumes from its checkpoint
folder bit for bit, with the same number of threads, devices and micro-batches (those
of the checkpoint are taken again, where they fit). The first loss or gradient that is
not finite ends the training; the last checkpoint is kept.
"""

import hashlib
import json
from pathlib import Path

import jax

from alignerf.contributions import patch_conv
from alignerf.experiment import jobs
from alignerf.io import atomic, faults
from alignerf.methods import base
from alignerf.processes import devices
from alignerf.scenes import prepared
from alignerf.sfm import pose_error
from alignerf.training import (
    batches,
    checkpoint,
    compose,
    loop,
    memory,
    program,
)

OPTIONS = {
    "config": "job as JSON, or its file",
    "scene": "prepared scene folder",
    "[cameras]": "cameras.npz (default: the scene's)",
    "[photos]": "folder of photos (default: the scene's)",
    "[valid]": "folder of <view>.npz with valid pixels",
    "[initial]": "parameters to fine-tune",
    "[threads]": faults.THREADS,
    "[gpus]": faults.GPUS,
    "[sources]": ("hash: other code starts anew", ""),
    "checkpoints": "folder to resume from",
    "learnt": "folder, written: parameters, moved cameras, warped photos",
    "[truth]": "the truth's folder, to compare cameras with",
    "timing": "timing.json, written",
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    devices.begin(args.threads, args.gpus)
    job = jobs.read(args.config)
    if Path(args.timing).is_dir():
        # Else it is said after the training, which is hours.
        raise ValueError(f"{args.timing}: a folder, where a file is to be written")
    if program.hashed(job.model):
        # An MLP gains little by it, and each device holds all its parameters.
        devices.use_as_devices()
    # Before all that takes time: a second trainer is refused at once.
    with checkpoint.lock(args.checkpoints):
        timing = train(job, args)
    with atomic.replace_file(args.timing) as path:
        path.write_text(json.dumps(timing, indent=1))


def train(job, args):
    """Train from the checkpoint or from the beginning; returns what it took."""
    loaded = prepared.load(args.scene, args.cameras)
    chosen, photos = loaded.views("train"), args.photos or loaded.folder / "images"
    check_inputs(job, loaded, chosen, photos)
    compared = to_truth(loaded, args.truth) if args.truth else None
    method, part = compose.make_method(job, loaded), base.part_of(job)
    params = initial_params(job, method, args.initial)
    shapes = batches.view_shapes(loaded, chosen)
    aligner = part.aligner(loaded, photos, args.checkpoints)
    to_come = checked_bytes(shapes, aligner, photos)
    # Whether the checkpoint is this job's shows when the photos are there.
    micro_batches = checkpoint.read_micro_batches(args.checkpoints)
    built = program.build(
        job, method, params, shapes, micro_batches=micro_batches, to_come=to_come
    )
    views = batches.load_views(loaded, chosen, photos, args.valid)
    params, timing = loop.fit(
        *(job, method, built, params, views, args.checkpoints),
        names=[loaded.names[view] for view in chosen],
        sources=args.sources + weights_digest(job),
        aligner=aligner,
    )
    moved = part.moved(loaded, params, aligner)
    cameras = args.cameras or f"{args.scene}/cameras.npz"
    with atomic.replace_folder(args.learnt) as folder:
        checkpoint.write_params(folder / "model.msgpack", params)
        part.write(folder, loaded, moved, aligner, views, cameras)
    if compared:
        own = prepared.load(args.scene)
        errors_px = {"given": compared(own), "after": compared(moved)}
        timing["pose_error_px"] = errors_px
    return timing


def check_inputs(job, loaded: prepared.Scene, chosen, photos):
    """ValueError naming a photo that cannot be learnt from, by its head."""
    smallest = min(loaded.width, loaded.height)
    if job.stage == "finetune" and job.alignerf.patch_px > smallest:
        raise ValueError(
            f"config.alignerf.patch_px: {job.alignerf.patch_px} px do not fit "
            f"photos of {loaded.width}x{loaded.height}"
        )
    prepared.check_images(loaded, chosen, photos)


def checked_bytes(shapes, aligner, photos):
    """Memory that the views and their alignment take; ValueError where it is short."""
    to_come = memory.tree_bytes(shapes)
    if aligner:
        to_come += aligner.more_bytes(shapes)
    for free in (memory.free_host_bytes(), memory.free_bytes(jax.local_devices()[0])):
        memory.check(to_come, free, f"{photos}: training views")
    return to_come


def to_truth(loaded: prepared.Scene, truth):
    """A function: a scene -> median error of its training views' cameras, in px."""
    true, chosen = prepared.read_cameras(f"{truth}/cameras.npz"), loaded.views("train")
    points = pose_error.true_points(loaded, truth, chosen)
    return lambda scene: pose_error.median_px(scene, true, points)


def weights_digest(job) -> str:
    """SHA-256 of the frequency loss's weights: with others training starts anew."""
    if not job.weights:
        return ""
    with faults.opened(job.weights) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def initial_params(job, method, initial):
    """Fresh parameters, or widened pre-trained ones."""
    key = jax.random.key(job.seed)
    fresh = jax.jit(method.init)(key)
    if job.stage != "finetune":
        return fresh
    if initial is None:
        raise ValueError("--initial: fine-tuning needs trained parameters")
    pretrain = compose.make_method(jobs.plain(job))
    template = jax.eval_shape(pretrain.init, key)
    trained = checkpoint.read_params(initial, template)
    model = patch_conv.widen_values(trained["model"], job.alignerf.outputs, key)
    return {**fresh, "model": model}


if __name__ == "__main__":
    faults.run(main)
