"""The learning rate, and Adam with entries that rest."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from alignerf.training import step as train_step
from tests import twins


def test_the_schedule_is_the_published_one(rng):
    steps = np.concatenate([np.arange(600), rng.integers(0, 250_001, 1000), [250_000]])
    for first, last, warmup in ((2e-3, 2e-5, 512), (1e-2, 1e-3, 30_000)):
        rate = jax.vmap(
            functools.partial(
                train_step.learning_rate,
                first=first,
                last=last,
                steps=250_000,
                warmup_steps=warmup,
            )
        )
        wanted = twins.learning_rate(steps, first, last, 250_000, warmup)
        twins.assert_close(rate(steps), wanted)


@pytest.mark.parametrize("hold_fraction", [0.25, 0.5, 0.9])
def test_a_rate_is_held_and_then_falls_as_the_published_one(hold_fraction):
    rate = functools.partial(train_step.learning_rate, first=3e-2, last=3e-3)
    steps = np.arange(1001)
    found = jax.vmap(
        lambda step: rate(step, steps=1000, warmup_steps=0, hold_fraction=hold_fraction)
    )(steps)
    held = round(1000 * hold_fraction)
    np.testing.assert_allclose(found[: held + 1], 3e-2, rtol=1e-5)
    falling = jax.vmap(lambda step: rate(step, steps=1000 - held, warmup_steps=0))
    np.testing.assert_allclose(found[held:], falling(np.arange(1001 - held)), rtol=1e-4)
    assert float(found[-1]) == pytest.approx(3e-3, rel=1e-5)


def make_adam():
    return train_step.make_optimizer(
        learning_rates=(1e-2, 1e-3),
        betas=(0.9, 0.99),
        eps=1e-15,
        steps=10,
        warmup_steps=2,
    )


def run(optimizer, params, gradients):
    state = optimizer.init(params)
    for grads in gradients:
        updates, state = optimizer.update(grads, state, params)
        params = optax.apply_updates(params, updates)
    return params, state


def test_rows_that_no_ray_touched_rest(rng):
    """As if their steps had not been, but for the count that all entries share."""
    params = {"table": jnp.asarray(rng.normal(size=(4, 2)), jnp.float32)}
    touched = jnp.asarray([[1.0], [0.0], [1.0], [0.0]])
    first, second, third = (
        jnp.asarray(rng.normal(size=(4, 2)), jnp.float32) for _ in range(3)
    )
    before, state = run(make_adam(), params, [{"table": first}])
    after, later = run(
        make_adam(), params, [{"table": first}, {"table": second * touched}]
    )
    for new, old in (
        (after["table"], before["table"]),
        (later[0].mu["table"], state[0].mu["table"]),
        (later[0].nu["table"], state[0].nu["table"]),
    ):
        np.testing.assert_array_equal(new[1::2], old[1::2])
        assert (np.asarray(new[::2]) != np.asarray(old[::2])).all()
    again, _ = run(
        make_adam(),
        params,
        [{"table": first}, {"table": second * touched}, {"table": third}],
    )
    assert (np.asarray(again["table"]) != np.asarray(after["table"])).all()


def test_other_parameters_follow_adam_to_the_last_bit(rng):
    """A zero gradient of a network is a gradient like any other."""
    params = {"kernel": jnp.asarray(rng.normal(size=(4, 3)), jnp.float32)}
    params["table"] = params["kernel"] + 1
    gradients = [
        jax.tree.map(lambda x: jnp.asarray(rng.normal(size=x.shape), x.dtype), params)
        for _ in range(3)
    ]
    gradients[1]["kernel"] = jnp.zeros((4, 3))
    rate = functools.partial(
        train_step.learning_rate, first=1e-2, last=1e-3, steps=10, warmup_steps=2
    )
    wanted, _ = run(optax.adam(rate, 0.9, 0.99, eps=1e-15), params, gradients)
    found, _ = run(make_adam(), params, gradients)
    jax.tree.map(np.testing.assert_array_equal, found, wanted)
