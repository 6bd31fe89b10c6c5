"""The training loop: resume, step, look at the numbers, save.

A budget of minutes is turned into a number of steps once, before the first step. The
loop does not depend on the kind of method, nor on the source of its photos.
"""

import contextlib
import logging
import time
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from alignerf.experiment import jobs
from alignerf.io import progress, provenance
from alignerf.kernels import calls
from alignerf.processes import devices
from alignerf.training import checkpoint, memory, program
from alignerf.training import run as train_run

log = logging.getLogger("alignerf")

CHECKPOINT_EVERY_S = 60.0
# Numbers are fetched from the device for this many steps at once. Several CPU devices
# end the process once about 40 steps of theirs wait: at most 16, a test holds.
FETCH_EVERY = 10
# A budget's steps are timed for a share of it, and not for longer than this.
TIMING_FRACTION, TIMING_S = 0.05, 5.0


class NoAligner:
    """The `alignment.aligner.Aligner` of a training that aligns nothing."""

    places, report, compile_time_s, learning = (), (), 0.0, False

    def begin(self, steps, identity):
        """There are no places to fix."""

    def restore(self, step):
        """No alignment has to be on disk."""
        return True

    def views(self, views):
        """The views as they are."""
        return views


def fit(*start, **options):
    """Train to the last step; returns (parameters, timing).

    start, options: those of `begin`. Compilation is timed apart: a cache often saves
    it.
    """
    run = begin(*start, **options)
    run_steps(run)
    return run.state.params, run.timing()


def begin(
    job, method, built, params, views, checkpoints, *, names, sources="", aligner=None
) -> train_run.Run:
    """The run of a job, from its checkpoint or from `params`.

    names [n]: of the views. sources: identifies the code; a checkpoint of other code,
    config or data is not resumed. aligner: corrects what the training learns from, at
    some of its steps.
    """
    aligner = aligner or NoAligner()
    kernels = calls.name_of(job.training.kernels)
    data, code = checkpoint.digest((params, views)), (sources, kernels)
    known = (data, *code)
    identity = checkpoint.fingerprint(job.model_dump(), data)
    job, built, facts = in_budget(job, method, built, params, views, checkpoints, known)
    # What differs after the slash is code alone, and its number of steps in a budget.
    identity += f"/{checkpoint.fingerprint(job.model_dump(), *code)}"
    facts |= describe(job, method, params)
    aligner.begin(job.steps, identity)
    fresh = Resumed(program.fresh_state(built.optimizer, params), 0.0, None, {})
    done = resume(checkpoints, fresh, identity, job.steps, aligner)
    # Both take as much memory as the parameters and Adam's moments.
    del fresh
    aligned = aligner.views(views)
    built = program.refitted(built, done.micro_batches, job, method, params, aligned)
    program.log_memory(job, built, done.state, aligned)
    state, placed = devices.place((done.state, aligned), built.mesh)
    memory.keep_freed()
    run = train_run.Run(
        job=job,
        method=method,
        program=built,
        checkpoints=checkpoints,
        identity=identity,
        aligner=aligner,
        names=names,
        unaligned=views,
        facts=facts,
        state=state,
        views=placed,
        numbers=done.numbers,
        spent_s=done.spent_s,
    )
    if aligner.learning:
        run.switch()
    return run


def in_budget(job, method, built, params, views, checkpoints, data):
    """(job with its steps, program, {fact of the budget}); no facts without a budget.

    The number of steps is read from budget.json, or timed now. data: identifies the
    photos, cameras and initial parameters.
    """
    if job.budget_min is None:
        return job, built, {}
    identity = checkpoint.fingerprint(job.model_dump(), *data)
    budget = checkpoint.read_budget(checkpoints, identity=identity)
    if budget is None:
        # A new training begins in the usual micro-batches.
        built = program.refitted(built, None, job, method, params, views)
        budget = time_budget(job, built, params, views)
        checkpoint.save_budget(checkpoints, identity=identity, **budget)
    minutes, job = job.budget_min, jobs.with_steps(job, budget["steps"])
    speed_text = f"{budget['steps_per_s']:.3g} steps/s"
    log.info("budget %g min: %d steps at %s", minutes, job.steps, speed_text)
    return job, built, {"budget_min": minutes, "steps_per_s": budget["steps_per_s"]}


def time_budget(job, built, params, views):
    """{steps, steps_per_s} of the whole training's budget, at this stage's speed.

    The timed steps change a copy of the parameters, which is discarded.
    """
    max_s = min(TIMING_S, TIMING_FRACTION * 60 * job.budget_min)
    copy = jax.tree.map(jnp.copy, params)
    time_s = step_time_s(job, built, copy, views, max_s=max_s)
    # As if photos or cameras were wrong, which nobody knows yet.
    time_s *= job.mean_step
    steps = jobs.steps_in(job, time_s)
    return {"steps": steps, "steps_per_s": round(1 / time_s, 4)}


def step_time_s(job, built, params, views, *, max_s):
    """Median seconds of a job's step, timed for about `max_s`; it uses up `params`."""
    state = program.fresh_state(built.optimizer, params)
    state, views = devices.place((state, views), built.mesh)
    schedule = program.schedule_of(jobs.with_steps(job, jobs.MAX_STEPS), built.mesh)
    return program.step_time_s(
        lambda state: built.step(state, views, schedule),
        state,
        max_s=max_s,
        at_once=FETCH_EVERY,
    )


class Resumed(NamedTuple):
    """What a checkpoint holds: micro_batches None and numbers empty without one."""

    state: Any
    spent_s: float
    micro_batches: int | None
    numbers: dict


def resume(checkpoints, fresh: Resumed, identity, steps, aligner) -> Resumed:
    """The newest checkpoint of this very job, or `fresh` where there is none.

    A state whose alignments are lost is of no use.
    """
    restored = checkpoint.restore(checkpoints, fresh.state, identity=identity)
    if restored is None:
        return fresh
    state, manifest = restored
    if not aligner.restore(int(state.step)):
        log.warning("%s: its alignment is lost, starting anew", checkpoints)
        return fresh
    log.info("resuming at step %d of %d", int(state.step), steps)
    state = jax.tree.map(jnp.asarray, state)
    return Resumed(state, *(manifest[key] for key in ("time_s", "parts", "final")))


def describe(job, method, params):
    """The facts of a training for tables, besides its times; the log shows some."""
    # Without what a method gathers: it renders nothing.
    running_means = dict(method.running_means)
    networks = {
        name: tree for name, tree in params.items() if name not in running_means
    }
    facts = {
        "stage": job.stage,
        "steps": job.steps,
        "rays_seen": job.steps * job.rays_per_step,
        "params": sum(leaf.size for leaf in jax.tree.leaves(networks)),
        "device": jax.devices()[0].device_kind,
        "kernels": calls.name_of(job.training.kernels),
        **provenance.facts(),
    }
    log.info(
        "{stage}: {params:,} parameters, {steps} steps, on {device}".format(**facts)
    )
    return facts


def run_steps(run):
    """The loop: step, look at the numbers, save now and then.

    Before the aligner's steps the run is saved, then aligned. Raises
    ValueError(run.explain()) for the first step that is not finite.
    """
    steps, places = run.job.steps, run.aligner.places
    schedule = program.schedule_of(run.job, run.program.mesh)
    done, pending = int(run.state.step), []
    saved = fetched = time.perf_counter()
    bar = progress.Progress(run.job.stage, steps, done=done)
    # A checkpoint that is being written is written to its end, whatever happens.
    with contextlib.closing(bar), run.writer:
        while done < steps:
            if done in places:
                run.save()
                run.wait()
                run.align()
                saved = fetched = time.perf_counter()
            run.state, stats = run.program.step(run.state, run.views, schedule)
            pending.append(stats)
            done += 1
            if len(pending) < FETCH_EVERY and done not in {*places, steps}:
                continue
            run.look(pending)
            now = time.perf_counter()
            rays_per_s = len(pending) * run.job.rays_per_step / (now - fetched)
            shown = {"loss": run.numbers["loss"], "psnr": run.numbers["psnr_db"]}
            bar.advance(len(pending), **shown, **{"rays/s": rays_per_s})
            fetched, pending = now, []
            if now - saved > CHECKPOINT_EVERY_S or done == steps:
                run.save()
                saved = time.perf_counter()
        run.wait()
