"""A training's compiled step: fitted to the memory and to the devices.

Micro-batches and devices change the rounding of a step alone (see gradients.py).
"""

import logging
import statistics
import time
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from alignerf.kernels import calls
from alignerf.processes import devices
from alignerf.training import gradients, memory
from alignerf.training import step as train_step

log = logging.getLogger("alignerf")

KINDS = train_step.Schedule(jnp.int32, jnp.int32, jnp.uint32)
SCALARS = train_step.Schedule(*(jax.ShapeDtypeStruct((), kind) for kind in KINDS))


class Program(NamedTuple):
    """A compiled step, its micro-batches and its devices.

    The length of the training is an input of the step: (state, views, Schedule).
    first_micro_batches: the number that was tried first; micro_batches are more where
    these did not fit.
    """

    optimizer: Any
    step: Any
    first_micro_batches: int
    micro_batches: int
    mesh: Any
    compile_time_s: float


def build(job, method, params, views, *, micro_batches=None, to_come=0) -> Program:
    """Compile a job's step; views: their shapes suffice.

    A compiler's memory can thus be given back before the photos are loaded, and a
    training that does not fit is refused before. to_come: bytes that will yet be taken.
    micro_batches: those of the training that is resumed; None for the device's own.
    """
    start = time.perf_counter()
    optimizer_of = adam_of(job, method)
    # What it keeps does not depend on how long a training is.
    optimizer = optimizer_of(train_step.Schedule(1, 0, 0))
    mesh = gradients.make_mesh(method.units, jax.devices())
    shapes = jax.tree.map(
        lambda leaf: jax.ShapeDtypeStruct(
            leaf.shape, leaf.dtype, sharding=devices.everywhere(mesh)
        ),
        (jax.eval_shape(lambda p: fresh_state(optimizer, p), params), views, SCALARS),
    )
    # Adam's two moments are only shapes yet.
    to_come += memory.tree_bytes(shapes[0].optimizer)
    first = first_micro_batches(job, method, mesh, micro_batches)
    step, micro_batches = compile_step(
        job,
        method,
        optimizer_of,
        *shapes,
        micro_batches=first,
        mesh=mesh,
        to_come=to_come,
    )
    memory.give_back()
    compile_time_s = round(time.perf_counter() - start, 3)
    return Program(optimizer, step, first, micro_batches, mesh, compile_time_s)


def refitted(built, micro_batches, job, method, params, views) -> Program:
    """The program in the micro-batches that the resumed training had, if they fit.

    micro_batches: None where nothing is resumed, which takes the device's own.
    """
    first = first_micro_batches(job, method, built.mesh, micro_batches)
    if first != built.first_micro_batches:
        # Built for a checkpoint that turned out to be another job's. Only this case
        # compiles twice: a new training begins with the usual ones, whatever lay there.
        # A CPU takes the photos as they lie in memory.
        to_come = 0 if calls.on_cpu() else memory.tree_bytes(views)
        before_s = built.compile_time_s
        built = build(
            job, method, params, views, micro_batches=micro_batches, to_come=to_come
        )
        built = built._replace(compile_time_s=before_s + built.compile_time_s)
    if micro_batches not in (None, built.micro_batches):
        log.warning(
            "resuming in %d micro-batches instead of %d: other rounding",
            *(built.micro_batches, micro_batches),
        )
    return built


def fresh_state(optimizer, params):
    """The state before the first step."""
    return train_step.State(jnp.zeros((), jnp.int32), params, optimizer.init(params))


def adam_of(job, method) -> train_step.Adam:
    """Adam on the learning rates of the job's stage."""
    return train_step.Adam(
        learning_rates=tuple(job.learning_rates),
        betas=tuple(job.training.adam_betas),
        eps=job.training.adam_eps,
        hold_fraction=job.training.hold_fraction,
        cameras=job.learns,
        native=calls.use(job.training.kernels),
        running_means=method.running_means,
    )


def schedule_of(job, mesh=None) -> train_step.Schedule:
    """The schedule of a job whose steps are known, placed as a step takes it."""
    numbers = job.schedule_steps, job.warmup_steps, job.seed
    scalars = [kind(number) for kind, number in zip(KINDS, numbers, strict=True)]
    return devices.place(train_step.Schedule(*scalars), mesh)


def first_micro_batches(job, method, mesh, micro_batches=None) -> int:
    """Micro-batches to try first: a checkpoint's, else those that suit the device.

    A checkpoint's number, from other devices, may not divide the units.
    """
    mine, units = share(method, mesh)
    if micro_batches is not None and units % micro_batches == 0:
        return micro_batches
    points = job.rays_per_step * job.model.points_a_ray // method.units
    return gradients.micro_batches_for_caches(units, points, mine[0], hashed(job.model))


def hashed(model):
    """Whether the model of these settings looks its points up in hash tables."""
    return hasattr(getattr(model, "field", model), "log2_hashmap_size")


def share(method, mesh):
    """(this process's devices in the mesh, or its only one; units of each device)."""
    if mesh is None:
        return jax.local_devices()[:1], method.units
    return list(mesh.local_devices), method.units // mesh.size


def compile_step(
    job, method, optimizer_of, *inputs, micro_batches, mesh=None, to_come=0
):
    """(compiled step, its micro-batches), which are more where the memory is short.

    inputs: shapes of the state, the views and the schedule. micro_batches: the number
    to try first.
    """
    mine, units = share(method, mesh)

    def compile_in(micro_batches):
        step = train_step.make_step(
            method,
            optimizer_of,
            gradient_norm=job.training.gradient_norm,
            micro_batches=micro_batches,
            mesh=mesh,
        )
        compiled = step.compiled(*inputs)
        return compiled, step_bytes(compiled, mine)

    free = max(0, memory.free_bytes(mine[0]) - to_come)
    return memory.compile_to_fit(compile_in, units, free, micro_batches=micro_batches)


def step_bytes(compiled, devices):
    """Memory that both programs of a step take on a device, besides their inputs."""
    return sum(memory.step_bytes(part, devices) for part in compiled)


def log_memory(job, program, state, views):
    """Log the memory that the training takes, and the free memory."""
    count = program.mesh.size if program.mesh else 1
    rays = job.rays_per_step // (program.micro_batches * count)
    params = memory.tree_bytes(state.params)
    activations = step_bytes(program.step, jax.local_devices()[:1]) - params
    sizes = {
        "parameters and gradients each": params,
        "Adam": memory.tree_bytes(state.optimizer),
        "photos": memory.tree_bytes(views),
        "activations a ray": max(0, activations) / rays,
        "free": memory.free_bytes(jax.local_devices()[0]),
    }
    log.info(
        "memory: %s; %d micro-batches of %d rays on %d devices",
        ", ".join(f"{name} {memory.text(size)}" for name, size in sizes.items()),
        *(program.micro_batches, rays, count),
    )


def step_time_s(step, state, *, max_s, at_once, clock=time.perf_counter):
    """Median seconds of a step on this machine, timed for about `max_s` seconds.

    step: state -> (state, numbers); it uses up `state`. `at_once` steps are run
    before their numbers are fetched, as in training, where there is time for that.
    """

    def run(count):
        nonlocal state
        start, numbers = clock(), []
        for _ in range(count):
            state, stats = step(state)
            numbers.append(stats)
        jax.device_get(numbers)
        return (clock() - start) / count

    # The first step waits for memory and threads; the second tells how many fit.
    run(1)
    single_s = run(1)
    if single_s >= max_s:
        return single_s
    count = at_once if at_once * single_s < max_s / 3 else 1
    start, times_s = clock(), []
    while clock() - start < max_s:
        times_s.append(run(count))
    return statistics.median(times_s)
