"""The training loop: resume, step, look at the numbers, save.

Nothing here knows what a method is made of, or where its photos came from.
"""

import contextlib
import logging
import time

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.command import progress, provenance
from alignerf.experiment import jobs
from alignerf.training import checkpoint, diagnose, memory, program

log = logging.getLogger("alignerf")

CHECKPOINT_EVERY_S = 60.0
# Numbers are fetched from the device for this many steps at once.
FETCH_EVERY = 10


def fit(job, method, built, params, views, checkpoints, *, names, sources=""):
    """Train to the last step; returns (parameters, timing).

    `names` [n] are those of the views. `sources` identifies the code: a checkpoint of
    other code, config or data is not resumed. Compilation is timed apart: a cache
    often saves it.
    """
    facts = describe(job, params)
    log.info(
        "{stage}: {params:,} parameters, {steps} steps, on {device}".format(**facts)
    )
    identity = checkpoint.fingerprint(
        jobs.as_dict(job), checkpoint.digest((params, views)), sources
    )
    state = program.fresh_state(built.optimizer, params)
    state, spent_s, parts = resume(checkpoints, state, identity, job.steps)
    built = with_parts(built, parts, job, method, params, views)
    program.log_memory(job, built, state, views)
    state, views = program.place((state, views), built.mesh)
    start = time.perf_counter()

    def time_s():
        return round(spent_s + time.perf_counter() - start, 3)

    def save(state):
        check_finite(state)
        facts = {"identity": identity, "time_s": time_s(), "parts": built.parts}
        checkpoint.save(checkpoints, state, **facts)

    def explain(state):
        options = {"steps": job.schedule_steps, "seed": job.seed, "parts": built.parts}
        return diagnose.explain(method, state, views, names, **options)

    state, numbers = run_steps(job, built.step, state, views, save, explain)
    return state.params, facts | {
        "train_time_s": time_s(),
        "compile_time_s": built.compile_time_s,
        "micro_batches": built.parts,
        "final": numbers,
    }


def resume(checkpoints, state, identity, steps):
    """The state to go on from, the seconds that it took so far, its micro-batches."""
    found = checkpoint.restore(checkpoints, state, identity=identity)
    if found is None:
        return state, 0.0, None
    state, manifest = found
    log.info("resuming at step %d of %d", int(state.step), steps)
    state = jax.tree.map(jnp.asarray, state)
    return state, manifest["time_s"], manifest["parts"]


def with_parts(built, parts, job, method, params, views):
    """The program in the micro-batches that the resumed training had, if they fit.

    parts: how many; None where nothing is resumed, which takes the usual ones.
    """
    first = program.first_parts(job, method, built.mesh, parts)
    if first != built.first_parts:
        # Built for a checkpoint that turned out to be another job's. Only this case
        # compiles twice: a new training begins with the usual ones, whatever lay there.
        # A CPU takes the photos as they lie in memory.
        on_cpu = jax.local_devices()[0].platform == "cpu"
        to_come = 0 if on_cpu else memory.tree_bytes(views)
        before_s = built.compile_time_s
        built = program.build(job, method, params, views, parts=parts, to_come=to_come)
        built = built._replace(compile_time_s=before_s + built.compile_time_s)
    if parts not in (None, built.parts):
        log.warning(
            "resuming in %d micro-batches instead of %d: other rounding",
            *(built.parts, parts),
        )
    return built


def check_finite(state):
    """ValueError where parameters are not finite: such a checkpoint is of no use."""
    if spoilt := diagnose.spoilt_parameters(state.params):
        raise ValueError(
            f"training diverged before step {int(state.step)}: not finite: "
            + ", ".join(spoilt)
        )


def describe(job, params):
    """What a table says of a training, besides its time."""
    return {
        "stage": job.stage,
        "steps": job.steps,
        "rays_seen": job.steps * job.rays_per_step,
        "params": sum(leaf.size for leaf in jax.tree.leaves(params)),
        "device": jax.devices()[0].device_kind,
        **provenance.facts(),
    }


def run_steps(job, step, state, views, save, explain):
    """The loop: step, look at the numbers, save now and then.

    Returns the last state and the numbers of the last steps (none where a finished
    training was resumed). Raises ValueError(explain(state)), with the state before
    it, for the first step that is not finite.
    """
    done = int(state.step)
    pending, history = [], {}
    saved = fetched = time.perf_counter()
    bar = progress.Progress(job.stage, job.steps, done=done)
    with contextlib.closing(bar):
        while done < job.steps:
            state, stats = step(state, views)
            pending.append(stats)
            done += 1
            if len(pending) < FETCH_EVERY and done < job.steps:
                continue
            numbers = jax.device_get(pending)
            if not all(is_finite(stats) for stats in numbers):
                raise ValueError(explain(state))
            history = {
                key: float(np.mean([stats[key] for stats in numbers])) for key in stats
            }
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
    return state, history


def is_finite(stats):
    """Whether a step had a finite loss and gradient, and so changed the state."""
    return np.isfinite(stats["loss"]) and stats["nonfinite_gradients"] == 0
