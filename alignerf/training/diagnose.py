"""Why a step is not finite: which terms, which networks, the rays of which views.

Slow, and run once: the batch of the step is drawn again and searched in small parts of
one size, so that the code is compiled once.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.io import faults
from alignerf.training import step as train_step

# Parts that a batch is cut into, and views that are looked at one by one.
PARTS = 32
VIEWS = 256


def explain(method, state, views, names, *, steps, seed, micro_batches=1) -> str:
    """One line: why the step that starts from `state` is not finite.

    names [n]: of the views. micro_batches: of the training's own steps.
    """
    where = f"training diverged at step {int(state.step)}: not finite: "
    if spoilt := spoilt_parameters(state.params):
        return where + ", ".join(spoilt)
    schedule = train_step.Schedule(steps, 0, jnp.uint32(seed))
    batch, share = train_step.make_draw(method.draw)(views, state.step, schedule)
    size = -(-method.units // max(PARTS, micro_batches))

    def look(units):
        """Faults of some units, padded by the last one to the size of a part."""
        units = np.pad(units, (0, size - len(units)), mode="edge")
        part = jax.tree.map(lambda x: x[units], batch)
        spoilt = spoilt_terms(method.terms, state.params, part, share)
        return {name for name, bad in spoilt.items() if bad}

    view = np.asarray(batch.view)
    what, guilty = search(look, view, size)
    if not what:
        return where + "the sum over the batch, though no part of it alone"
    who = faults.some_names([names[number] for number in guilty]) or "no single view"
    if len(guilty) == len(np.unique(view)):
        who += f", all that were drawn; the parameters reach {largest(state.params):g}"
    return f"{where}{', '.join(sorted(what))}; in rays of {who}"


def spoilt_parameters(params):
    """A text for each network with parameters that are not finite."""
    return [
        f"{count} parameters of the {name}"
        for name, network in train_step.networks(params).items()
        if (
            count := sum(
                int(jnp.sum(~jnp.isfinite(x))) for x in jax.tree.leaves(network)
            )
        )
    ]


def largest(tree):
    """Largest absolute value in a tree."""
    return max(float(jnp.max(jnp.abs(leaf))) for leaf in jax.tree.leaves(tree))


@functools.partial(jax.jit, static_argnames="terms")
def spoilt_terms(terms, params, part, share):
    """{what: whether it is not finite} of each term's value and gradients."""
    is_spoilt = {}
    values, _ = terms(params, part, share)
    for name, value in values.items():
        # One gradient a term: a zero times another term's infinity is not finite.
        grads = jax.grad(lambda p, name=name: terms(p, part, share)[0][name])(params)
        bad = ~jnp.isfinite(value)
        is_spoilt[f"{name} loss"] = bad
        for network, tree in train_step.networks(grads).items():
            # As in the step: Adam keeps squares.
            spoilt = train_step.count_nonfinite_squares(tree) > 0
            where = f"gradient of the {name} loss in the {network}"
            is_spoilt[where] = spoilt & ~bad
    return is_spoilt


def search(look, view, size):
    """(all faults, views at fault) of a batch; view [units]: the view of each unit.

    look(units) gives the faults of at most `size` units. Views in a part with a fault
    are searched one by one, VIEWS of them at most.
    """
    what, suspects = set(), set()
    for units in parts_of(np.argsort(view, kind="stable"), size):
        if spoilt := look(units):
            what |= spoilt
            suspects |= set(view[units].tolist())
    guilty = [
        number
        for number in sorted(suspects)[:VIEWS]
        if any(look(units) for units in parts_of(np.flatnonzero(view == number), size))
    ]
    return what, guilty


def parts_of(units, size):
    """Arrays of at most `size` units."""
    return np.split(units, range(size, len(units), size))
