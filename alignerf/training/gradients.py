"""The mean gradient of a batch: in micro-batches, and shared by several devices.

Notation: a batch has u units (rays or patches), with which each of its arrays
begins; all terms are means over them. The micro-batches come one after the other, so
that the activations of one are in memory at a time; the devices of `mesh` take
u / devices units each, with the parameters and photos whole on all of them.
"""

import functools
import logging

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

log = logging.getLogger("alignerf")

AXIS = "units"
# Points of a micro-batch on a CPU, of networks and of tables: few enough for what they
# need to stay in its caches. The published MLP then takes half the time; more
# micro-batches bring no more. A grid needs little for a point, and each micro-batch
# adds up a table of gradients.
CACHED_POINTS, CACHED_LOOKUPS = 12288, 49152


def make_mesh(units, devices):
    """The mesh of as many devices as share the units evenly; None for one device."""
    count = max(n for n in range(1, len(devices) + 1) if units % n == 0)
    if count < len(devices):
        log.warning(
            "%d of %d devices are used: no more share %d units evenly",
            count,
            len(devices),
            units,
        )
    return None if count == 1 else Mesh(np.array(devices[:count]), (AXIS,))


def by_units(mesh):
    """The sharding of a batch, whose arrays begin with its units."""
    return NamedSharding(mesh, PartitionSpec(AXIS))


def micro_batches_for_caches(units, points_a_unit, device, hashed):
    """Micro-batches to begin with: one, but on a CPU as many as its caches ask for."""
    if device.platform != "cpu":
        return 1
    fitting = max(1, (CACHED_LOOKUPS if hashed else CACHED_POINTS) // points_a_unit)
    return next(
        n for n in range(1, units + 1) if units % n == 0 and units <= n * fitting
    )


def mean(terms, params, batch, share, *, micro_batches=1, mesh=None):
    """((loss, {term or number: mean}), gradient of the loss) of a batch.

    terms(params, batch, share) -> ({term: mean}, {number to show: mean}); the
    loss is the sum of the terms. Micro-batches and devices change only its rounding.
    """
    local = functools.partial(accumulate, terms, micro_batches=micro_batches)
    if mesh is None:
        return local(params, batch, share)
    # Each device runs the program of one: left to itself, the compiler would gather
    # all updates of a hash grid on every device before it adds them up.
    whole, shared = PartitionSpec(), PartitionSpec(AXIS)
    return jax.shard_map(
        lambda *arguments: jax.lax.pmean(local(*arguments), AXIS),
        mesh=mesh,
        in_specs=(whole, shared, whole),
        out_specs=whole,
        check_vma=False,
    )(params, batch, share)


def accumulate(terms, params, batch, share, *, micro_batches):
    """`mean` of the batch of one device, one micro-batch after the other."""

    def loss(params, batch):
        values, shown = terms(params, batch, share)
        return sum(values.values()), {**values, **shown}

    of = functools.partial(jax.value_and_grad(loss, has_aux=True), params)
    if micro_batches == 1:
        return of(batch)
    split = jax.tree.map(lambda x: x.reshape(micro_batches, -1, *x.shape[1:]), batch)
    shapes = jax.eval_shape(of, jax.tree.map(lambda x: x[0], split))
    zero = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)

    def add(total, part):
        return jax.tree.map(jnp.add, total, of(part)), None

    total, _ = jax.lax.scan(add, zero, split)
    return jax.tree.map(lambda x: x / micro_batches, total)
