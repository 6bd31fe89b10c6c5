"""Train a method on a scene: `python -m alignerf.train`.

One product: the parameters, beside a `timing.json`. Resumes from its checkpoint
folder bit for bit (with the same number of threads).
"""

import argparse
import hashlib
import json
import logging
import time

import jax
import jax.numpy as jnp
import numpy as np

from alignerf import (
    checkpoint,
    cli,
    config,
    methods,
    patch_conv,
    progress,
    scene,
    train_step,
)

log = logging.getLogger("alignerf")

CHECKPOINT_EVERY_S = 60.0
# Numbers are fetched from the device for this many steps at once.
FETCH_EVERY = 10


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--config", required=True, help="job as JSON, or its file")
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--photos", help="folder of photos (default: the scene's)")
    parser.add_argument("--valid", help="folder of <view>.npz with valid pixels")
    parser.add_argument("--initial", help="parameters to fine-tune from")
    parser.add_argument("--sources", default="", help="hash: other code starts anew")
    parser.add_argument("--checkpoints", required=True, help="folder to resume from")
    parser.add_argument("--model", required=True, help="parameters, written")
    parser.add_argument("--timing", required=True, help="timing.json, written")
    args = parser.parse_args(argv)
    job = config.parse_job(cli.read_config(args.config))
    loaded = scene.load(args.scene)
    check_patches(job, loaded)
    views = load_views(loaded, args.photos, args.valid)
    method = config.make_method(job)
    params = initial_params(job, method, args.initial)
    with checkpoint.lock(args.checkpoints):
        params, timing = fit(
            job, method, params, views, args.checkpoints, sources=args.sources
        )
    checkpoint.write_params(args.model, params)
    with cli.replace_file(args.timing) as path:
        path.write_text(json.dumps(timing, indent=1))


def check_patches(job, loaded: scene.Scene):
    """A patch must lie inside the photos."""
    smallest = min(loaded.width, loaded.height)
    if job.stage == "finetune" and job.alignerf.patch_px > smallest:
        raise ValueError(
            f"config.alignerf.patch_px: {job.alignerf.patch_px} px do not fit photos "
            f"of {loaded.width}x{loaded.height}"
        )


def load_views(loaded: scene.Scene, photos, valid) -> methods.Views:
    """The training views on the device, with what says which pixels count."""
    chosen = loaded.views("train")
    images = scene.read_images(loaded, chosen, photos or loaded.folder / "images")
    if valid is None:
        masks = np.ones(images.shape[:3], bool)
    else:
        masks = scene.read_validity(loaded, chosen, valid)
    return methods.Views(
        photos=jnp.asarray(images),
        valid=jnp.asarray(masks),
        pixtocams=jnp.asarray(loaded.pixtocams[chosen], jnp.float32),
        camtoworlds=jnp.asarray(loaded.camtoworlds[chosen], jnp.float32),
    )


def initial_params(job, method, initial):
    """Fresh parameters, or the pre-trained ones widened to features."""
    key = jax.random.key(job.seed)
    fresh = jax.jit(method.init)(key)
    if job.stage != "finetune":
        return fresh
    if initial is None:
        raise ValueError("--initial: fine-tuning needs pre-trained parameters")
    pretrain = config.make_method(config.replace_stage(job, "pretrain"))
    template = jax.eval_shape(pretrain.init, key)
    trained = checkpoint.read_params(initial, template)
    model = patch_conv.widen_values(trained["model"], job.alignerf.features, key)
    return {**fresh, "model": model}


def fit(job, method, params, views, checkpoints, *, sources=""):
    """Train to the last step; returns (parameters, timing).

    `sources` identifies the code: a checkpoint of other code, config or data is not
    resumed. Compilation is timed apart: a cache often saves it.
    """
    optimizer = train_step.make_optimizer(
        learning_rates=job.learning_rates,
        steps=job.schedule_steps,
        warmup_steps=job.warmup_steps,
        eps=job.training.adam_eps,
    )
    step = train_step.make_step(
        method,
        optimizer,
        steps=job.schedule_steps,
        gradient_norm=job.training.gradient_norm,
        seed=job.seed,
    )
    state = train_step.State(jnp.zeros((), jnp.int32), params, optimizer.init(params))
    identity = checkpoint.fingerprint(
        config.as_dict(job), digest((params, views)), sources
    )
    state, spent_s = resume(checkpoints, state, identity, job.steps)
    facts = describe(job, params)
    log.info(
        "{stage}: {params:,} parameters, {steps} steps, on {device}".format(**facts)
    )
    start = time.perf_counter()
    step = step.lower(state, views).compile()
    compile_time_s = round(time.perf_counter() - start, 3)
    start = time.perf_counter()

    def time_s():
        return round(spent_s + time.perf_counter() - start, 3)

    def save(state):
        checkpoint.save(checkpoints, state, identity=identity, time_s=time_s())

    state, numbers = run_steps(job, step, state, views, save)
    times = {"train_time_s": time_s(), "compile_time_s": compile_time_s}
    return state.params, facts | times | {"final": numbers}


def resume(checkpoints, state, identity, steps):
    """The state to go on from, and the seconds that it took so far."""
    found = checkpoint.restore(checkpoints, state, identity=identity)
    if found is None:
        return state, 0.0
    state, spent_s = found
    log.info("resuming at step %d of %d", int(state.step), steps)
    return jax.tree.map(jnp.asarray, state), spent_s


def describe(job, params):
    """What a table says of a training, besides its time."""
    return {
        "stage": job.stage,
        "steps": job.steps,
        "rays_seen": job.steps * job.rays_per_step,
        "params": sum(leaf.size for leaf in jax.tree.leaves(params)),
        "device": jax.devices()[0].device_kind,
    }


def run_steps(job, step, state, views, save):
    """The loop: step, look at the numbers, save now and then.

    Returns the last state and the numbers of the last steps (none where a finished
    training was resumed).
    """
    done = int(state.step)
    bar = progress.Progress(job.stage, job.steps, done=done)
    pending, history = [], {}
    saved = fetched = time.perf_counter()
    while done < job.steps:
        state, stats = step(state, views)
        pending.append(stats)
        done += 1
        if len(pending) < FETCH_EVERY and done < job.steps:
            continue
        history = look_at(jax.device_get(pending), done - len(pending))
        now = time.perf_counter()
        rays_per_s = len(pending) * job.rays_per_step / (now - fetched)
        bar.advance(
            len(pending),
            loss=history["loss"],
            psnr=history["psnr_db"],
            **{"rays/s": rays_per_s},
        )
        fetched, pending = now, []
        if now - saved > CHECKPOINT_EVERY_S or done == job.steps:
            save(state)
            saved = time.perf_counter()
    bar.close()
    return state, history


def look_at(batch, first_step):
    """Means of the steps' numbers; the first that is not finite stops the job."""
    for number, stats in enumerate(batch):
        bad = [name for name, value in stats.items() if not np.isfinite(value)]
        if stats["nonfinite_gradients"]:
            bad.append(f"{int(stats['nonfinite_gradients'])} gradient entries")
        if bad:
            raise ValueError(
                f"training diverged at step {first_step + number}: not finite: "
                + ", ".join(bad)
            )
    return {key: float(np.mean([s[key] for s in batch])) for key in batch[0]}


def digest(tree):
    """SHA-256 of the arrays of a tree: the data that a training starts from."""
    found = hashlib.sha256()
    for leaf in jax.tree.leaves(jax.device_get(tree)):
        found.update(np.ascontiguousarray(leaf))
    return found.hexdigest()


if __name__ == "__main__":
    cli.run(main)
