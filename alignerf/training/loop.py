"""The training loop: resume, step, look at the numbers, save.

A budget of minutes becomes a number of steps before the first one, once and for all.

Nothing here knows what a method is made of, or where its photos came from.
"""

import contextlib
import logging
import time

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.experiment import jobs
from alignerf.files import progress, provenance
from alignerf.processes import consensus, rank
from alignerf.training import checkpoint, devices, diagnose, memory, program

log = logging.getLogger("alignerf")

CHECKPOINT_EVERY_S = 60.0
# Numbers are fetched from the device for this many steps at once. Several CPU devices
# end the process once about 40 steps of theirs wait: at most 16, a test holds.
FETCH_EVERY = 10
# A budget's steps are timed for a share of it, and not for longer than this.
TIMING_SHARE, TIMING_S = 0.05, 5.0


class NoAligner:
    """What a training asks of `alignment.aligner.Aligner`, where nothing is aligned."""

    places, report, compile_time_s = (), (), 0.0

    def begin(self, steps, identity):
        """Nothing to be fixed."""

    def restore(self, step):
        """Nothing has to be there."""
        return True

    def views(self, views):
        """The views as they are."""
        return views


def fit(
    job,
    method,
    built,
    params,
    views,
    checkpoints,
    *,
    names,
    sources="",
    note=progress.nothing,
    aligner=None,
):
    """Train to the last step; returns (parameters, timing).

    `names` [n] are those of the views. `sources` identifies the code: a checkpoint of
    other code, config or data is not resumed. Compilation is timed apart: a cache
    often saves it. note: what the progress line says besides, of the share done.
    aligner: puts right what the training learns from, at some of its steps.
    """
    aligner = aligner or NoAligner()
    data = checkpoint.digest((params, views)), sources
    consensus.check_same(data[0], "photos, cameras and initial parameters")
    job, built, facts = in_budget(job, method, built, params, views, checkpoints, data)
    identity = checkpoint.fingerprint(jobs.as_dict(job), *data)
    facts |= describe(job, params)
    log.info(
        "{stage}: {params:,} parameters, {steps} steps, on {device}".format(**facts)
    )
    state = program.fresh_state(built.optimizer, params)
    aligner.begin(job.steps, identity)
    state, spent_s, micro_batches, last = resume(
        checkpoints, state, identity, job.steps, aligner
    )
    given, views = views, aligner.views(views)
    built = with_micro_batches(built, micro_batches, job, method, params, views)
    program.log_memory(job, built, state, views)
    # Those of the first steps are let go where an alignment gives others.
    state, *placed = devices.place((state, views), built.mesh)
    del views
    memory.keep_freed()
    start = time.perf_counter()

    def time_s():
        passed_s = time.perf_counter() - start - aligner.compile_time_s
        return round(spent_s + passed_s, 3)

    def save(state, numbers):
        state = devices.local(state)
        check_finite(state)
        facts = {
            "identity": identity,
            "time_s": time_s(),
            "micro_batches": built.micro_batches,
        }
        if rank.is_first():
            checkpoint.save(checkpoints, state, final=numbers, **facts)

    def align(state):
        aligner.align(devices.local(state.params), int(state.step))
        views = aligner.views(given)
        if rank.are_several():
            consensus.check_same(checkpoint.digest(views), "views after an alignment")
        return devices.place(views, built.mesh)

    def explain(state, views):
        options = {
            "steps": job.schedule_steps,
            "seed": job.seed,
            "micro_batches": built.micro_batches,
        }
        return diagnose.explain(
            method, *devices.local((state, views)), names, **options
        )

    schedule = program.schedule_of(job, built.mesh)

    def step(state, views):
        return built.step(state, views, schedule)

    loop = {"save": save, "explain": explain, "note": note}
    loop |= {"align": align, "places": aligner.places}
    state, numbers = run_steps(job, step, state, placed.pop(), **loop)
    # A finished training that was resumed made no step.
    numbers = numbers or last
    return devices.local(state.params), facts | {
        "train_time_s": time_s(),
        "compile_time_s": round(built.compile_time_s + aligner.compile_time_s, 3),
        "micro_batches": built.micro_batches,
        "final": numbers,
        **({"alignments": aligner.report} if aligner.report else {}),
    }


def in_budget(job, method, built, params, views, checkpoints, data):
    """(job with its steps, program, what a table says of the budget, if there is one).

    The steps that the budget holds are those written down, or as timed now. `data`
    identifies what the job starts from.
    """
    if job.budget_min is None:
        return job, built, {}
    identity = checkpoint.fingerprint(jobs.as_dict(job), *data)
    budget = consensus.on(checkpoint.read_budget(checkpoints, identity=identity))
    if budget is None:
        # A new training begins in the usual micro-batches.
        built = with_micro_batches(built, None, job, method, params, views)
        budget = time_budget(job, built, params, views)
        if rank.is_first():
            checkpoint.save_budget(checkpoints, identity=identity, **budget)
    minutes, job = job.budget_min, jobs.with_steps(job, budget["steps"])
    speed_text = f"{budget['steps_per_s']:.3g} steps/s"
    log.info("budget %g min: %d steps at %s", minutes, job.steps, speed_text)
    return job, built, {"budget_min": minutes, "steps_per_s": budget["steps_per_s"]}


def time_budget(job, built, params, views):
    """{steps, steps_per_s} of the whole training's budget, at this stage's speed.

    The steps that are timed change a copy of the parameters, which is thrown away.
    """
    most_s = min(TIMING_S, TIMING_SHARE * 60 * job.budget_min)
    copy = jax.tree.map(jnp.copy, params)
    time_s = step_time_s(job, built, copy, views, most_s=most_s)
    steps = jobs.steps_in(job, time_s)
    return {"steps": steps, "steps_per_s": round(1 / time_s, 4)}


def step_time_s(job, built, params, views, *, most_s):
    """Median seconds of a job's step, timed for about `most_s`; it uses up `params`."""
    state = program.fresh_state(built.optimizer, params)
    state, views = devices.place((state, views), built.mesh)
    schedule = program.schedule_of(jobs.with_steps(job, jobs.MOST_STEPS), built.mesh)
    return program.step_time_s(
        lambda state: built.step(state, views, schedule),
        state,
        most_s=most_s,
        at_once=FETCH_EVERY,
    )


def resume(checkpoints, state, identity, steps, aligner):
    """The state to go on from, its seconds so far, micro-batches and last numbers.

    The first process reads it, whatever number of processes has written it. A state
    whose alignments are lost is of no use.
    """
    restored = None
    if rank.is_first():
        restored = checkpoint.restore(checkpoints, state, identity=identity)
    manifest = consensus.on(restored and restored[1])
    fresh = state, 0.0, None, {}
    if manifest is None:
        return fresh
    if not aligner.restore(consensus.on(restored and int(restored[0].step))):
        log.warning("%s: its alignment is lost, starting anew", checkpoints)
        return fresh
    state = consensus.on_arrays(restored[0] if restored else state)
    log.info("resuming at step %d of %d", int(state.step), steps)
    state = jax.tree.map(jnp.asarray, state)
    return state, manifest["time_s"], manifest["parts"], manifest["final"]


def with_micro_batches(built, micro_batches, job, method, params, views):
    """The program in the micro-batches that the resumed training had, if they fit.

    micro_batches: how many; None where nothing is resumed, which takes the usual ones.
    """
    first = program.first_micro_batches(job, method, built.mesh, micro_batches)
    if first != built.first_micro_batches:
        # Built for a checkpoint that turned out to be another job's. Only this case
        # compiles twice: a new training begins with the usual ones, whatever lay there.
        # A CPU takes the photos as they lie in memory.
        on_cpu = jax.local_devices()[0].platform == "cpu"
        to_come = 0 if on_cpu else memory.tree_bytes(views)
        before_s = built.compile_time_s
        built = program.build(
            job, method, params, views, micro_batches=micro_batches, to_come=to_come
        )
        built = built._replace(compile_time_s=before_s + built.compile_time_s)
    if micro_batches not in (None, built.micro_batches):
        log.warning(
            "resuming in %d micro-batches instead of %d: other rounding",
            *(built.micro_batches, micro_batches),
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
        "processes": rank.here().count,
        **provenance.facts(),
    }


def run_steps(job, step, state, views, *, save, explain, note, align, places):
    """The loop: step, look at the numbers, save now and then.

    Before the steps of `places` it saves, and goes on with the views of align(state).
    Returns the last state and the numbers of the last steps (none where a finished
    training was resumed). Raises ValueError(explain(state, views)), with the state
    before it, for the first step that is not finite.
    """
    done = int(state.step)
    pending, history = [], {}
    saved = fetched = time.perf_counter()
    options = {"done": done, "note": note, "silent": not rank.is_first()}
    bar = progress.Progress(job.stage, job.steps, **options)
    with contextlib.closing(bar):
        while done < job.steps:
            if done in places:
                save(state, history)
                views = align(state)
                saved = fetched = time.perf_counter()
            state, stats = step(state, views)
            pending.append(stats)
            done += 1
            if len(pending) < FETCH_EVERY and done not in {*places, job.steps}:
                continue
            numbers = jax.device_get(pending)
            if not all(is_finite(stats) for stats in numbers):
                raise ValueError(explain(state, views))
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
                save(state, history)
                saved = time.perf_counter()
    return state, history


def is_finite(stats):
    """Whether a step had a finite loss and gradient, and so changed the state."""
    return np.isfinite(stats["loss"]) and stats["nonfinite_gradients"] == 0
