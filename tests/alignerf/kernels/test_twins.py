"""Each kernel agrees with its twin in JAX to rounding: values, gradients, extremes."""

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from alignerf.fields import grid
from alignerf.kernels import build, calls
from alignerf.mipnerf360 import stepfun
from alignerf.training import step as train_step
from tests import twins

pytestmark = pytest.mark.skipif(
    build.library() is None, reason="no C++ compiler: the kernels cannot be made"
)


@pytest.fixture(autouse=True)
def registered():
    assert calls.use("native")


def close(found, wanted, *, to=1e-5):
    np.testing.assert_allclose(found, wanted, rtol=to, atol=to)


# Dense levels and hashed ones; sizes beside those of a block of points.
LEVELS = grid.Levels.geometric(4, 3, 50, 2**10)


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize(
    ("features", "points"), [(1, 1), (2, 63), (2, 64), (3, 65), (4, 200)]
)
def test_what_is_looked_up_and_its_gradients(rng, features, points, moving):
    table = rng.normal(size=(sum(LEVELS.entries), features)).astype(np.float32)
    at = rng.random((3, points)).astype(np.float32)
    # On the rim, on a corner, and by rounding beside the box.
    at[:, 0] = [0.0, 1.0, 1.0 + 1e-6]
    share = rng.random((4, points)).astype(np.float32)
    weights = rng.normal(size=(4 * features, points)).astype(np.float32)

    def of(native):
        def total(table, at, share):
            how = {"moving": moving, "native": native}
            found = grid.features_of(table, at, share, LEVELS, **how)
            return jnp.sum(found * weights), found

        learnt = (0, 1, 2) if moving else (0,)
        arrays = map(jnp.asarray, (table, at, share))
        return jax.jit(jax.value_and_grad(total, learnt, has_aux=True))(*arrays)

    ((_, found), grads), ((_, wanted), wanted_grads) = of(True), of(False)
    close(found, wanted)
    for grad, wanted_grad in zip(grads, wanted_grads, strict=True):
        # A slope is as many times larger as its level has cells.
        close(grad / 50, wanted_grad / 50)


# Within a cell, on its face, at its corner, on the rim, and beside the box.
PLACES = [(0.1, 0.61, 0.37), (0.5, 0.61, 0.37), (0.0, 0.5, 1 / 3), (1.0, 1.0, 1.0)]
PLACES += [(1.0 + 1e-6, 0.21, 0.71), (-1e-6, 0.21, 0.71)]


@pytest.mark.parametrize("place", PLACES)
def test_the_gradient_in_a_point_is_its_cell_s_slope(rng, place):
    """Of the twin in float64: features are linear along each axis of a cell."""
    table = rng.normal(size=(sum(LEVELS.entries), 2)).astype(np.float32)
    at = np.array(place, np.float32)
    share, step = rng.random(4).astype(np.float32), 1e-8
    here, *moved = (
        twins.look_up(table.astype(np.float64), np.float64(at) + step * shift, LEVELS)
        for shift in [np.zeros(3), *np.eye(3)]
    )

    weights = rng.normal(size=(4, 2)).astype(np.float32)

    def total(at, share):
        columns = at[:, None], share[:, None]
        found = calls.look_up(jnp.asarray(table), *columns, LEVELS, True)
        return jnp.sum(found.reshape(4, 2) * weights)

    slopes = jax.jit(jax.grad(total, (0, 1)))
    of_at, of_share = slopes(jnp.asarray(at), jnp.asarray(share))
    along = [np.sum((one - here) / step * weights * share[:, None]) for one in moved]
    np.testing.assert_allclose(of_at, along, rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(of_share, (here * weights).sum(-1), atol=1e-5)


def test_a_point_that_is_none_is_looked_up_nowhere():
    """It reads no memory but the table's, and spoils its own features alone."""
    at = np.full((3, 3), 0.5, np.float32)
    at[:, 1] = [np.nan, np.inf, -np.inf]
    table = np.ones((sum(LEVELS.entries), 2), np.float32)
    share = np.ones((4, 3), np.float32)
    found = np.asarray(calls.look_up(table, at, share, LEVELS))
    np.testing.assert_array_equal(found[:, [0, 2]], 1.0)
    assert np.isnan(found[:, 1]).all()


def edges_and_mass(rng, rays, bins):
    t = np.sort(rng.random((rays, bins + 1)), axis=-1)
    t[:, 0], t[:, -1] = 0.0, 1.0
    w = rng.random((rays, bins)) ** 4
    w = w / w.sum(axis=-1, keepdims=True)
    return np.float32(t), np.float32(w)


def arrays(*every):
    """As JAX has them: the twins ask for nothing else."""
    return [x if x is None else jnp.asarray(x, jnp.float32) for x in every]


def resampled(count, dilation):
    """(t, w, jitter, anneal) -> what the kernel samples, and what its twin does."""
    ways = calls.resample, stepfun.resample
    return jax.jit(lambda *of: [way(*of, count, dilation=dilation) for way in ways])


@pytest.mark.parametrize(
    ("bins", "count", "jittered", "dilation"),
    [
        *((1, 1, True, None), (1, 1, True, 2.0), (1, 8, False, 0.01)),
        *((32, 16, True, dilation) for dilation in (None, 0.0, 0.01, 2.0)),
        *((200, 33, False, None), (200, 33, False, 0.01)),
    ],
)
def test_resampling(rng, bins, count, jittered, dilation):
    t, w = edges_and_mass(rng, 16, bins)
    jitter = rng.random(16).astype(np.float32) if jittered else None
    both = resampled(count, dilation)
    for anneal in (0.0, 0.4, 1.0):
        found, wanted = both(*arrays(t, w, jitter, anneal))
        close(found, wanted, to=2e-5)


@pytest.mark.parametrize("dilation", [None, 0.02])
@pytest.mark.parametrize("anneal", [0.0, 0.5, 1.0])
def test_histograms_at_their_extremes_are_resampled_alike(dilation, anneal):
    t = np.linspace(0, 1, 5).astype(np.float32)
    same = np.array([0, 0.5, 0.5, 0.5, 1], np.float32)
    point = np.full(5, 0.25, np.float32)
    rays = [
        (t, [0, 0, 0, 0]),
        (t, [0, 1, 0, 0]),
        (t, [1e-38, 0, 0, 1e-38]),
        (t, [1e-30, 1, 1e-30, 1e-30]),
        (t, [1e30, 1, 1, 1e30]),
        (same, [0.2, 0.5, 0.1, 0.2]),
        (same, [0, 1, 1, 0]),
        (point, [0.1, 0.2, 0.3, 0.4]),
        (np.float32([0, 1e-9, 2e-9, 3e-9, 1]), [0.2, 0.3, 0.5, 0]),
        (t, [0.25, 0.25, 0.25, 0.25]),
    ]
    t, w = (np.array(part, np.float32) for part in zip(*rays, strict=True))
    jitter = np.full(len(t), 0.37, np.float32)
    found, wanted = map(
        np.asarray, resampled(6, dilation)(*arrays(t, w, jitter, anneal))
    )
    np.testing.assert_array_equal(np.isnan(found), np.isnan(wanted))
    close(found, wanted, to=2e-5)
    assert (np.diff(found[np.isfinite(found).all(axis=-1)]) >= 0).all()


@pytest.mark.parametrize("where", ["edges", "mass"])
def test_a_nan_spoils_its_own_ray_alone(rng, where):
    t, w = edges_and_mass(rng, 3, 8)
    (t if where == "edges" else w)[1, 3] = np.nan
    found = np.asarray(calls.resample(t, w, None, 0.7, 5, dilation=0.01))
    assert np.isnan(found[1]).all()
    assert np.isfinite(found[[0, 2]]).all()


@pytest.mark.parametrize(("bins", "others"), [(1, 1), (12, 32), (40, 3)])
def test_the_loss_of_proposals_and_its_gradient(rng, bins, others):
    t, w = edges_and_mass(rng, 20, bins)
    t_other, w_other = edges_and_mass(rng, 20, others)
    # Edges that fall together, a proposal that knows nothing, and one that knows all.
    t_other[0, : min(bins, others)] = t[0, : min(bins, others)]
    t_other[0].sort()
    w_other[1], w_other[2] = 0.0, 1.0
    weights = rng.random(20).astype(np.float32)

    t, w, t_other, w_other = arrays(t, w, t_other, w_other)

    def of(loss):
        total = lambda w_other: jnp.sum(weights * loss(t, w, t_other, w_other))  # noqa: E731
        return jax.jit(loss)(t, w, t_other, w_other), jax.jit(jax.grad(total))(w_other)

    for found, wanted in zip(
        of(calls.interlevel), of(stepfun.interlevel_loss), strict=True
    ):
        close(found, wanted, to=3e-5)


def test_the_loss_says_that_weights_are_none(rng):
    t, w = edges_and_mass(rng, 2, 4)
    w[1, 2] = np.nan
    found = calls.interlevel(t, w, *edges_and_mass(rng, 2, 4))
    assert np.isfinite(found[0])
    assert np.isnan(found[1])


def optimizer(native, betas):
    return train_step.make_optimizer(
        learning_rates=(1e-2, 1e-3),
        betas=betas,
        eps=1e-15,
        steps=10,
        warmup_steps=2,
        native=native,
    )


@pytest.mark.parametrize("betas", [(0.9, 0.99), (0.9, 0.999999), (0.0, 0.0)])
def test_adam_on_a_table(rng, betas):
    """Also of gradients that are tiny, huge, or nothing."""
    params = {"field": {"table": jnp.asarray(rng.normal(size=(33, 4)), jnp.float32)}}
    params["field"]["kernel"] = jnp.ones((3, 2))
    sizes = np.array([1, 0, 1e-18, 1e18] * 33).reshape(33, 4)

    def grads(rng, values):
        return {
            "field": {
                "table": jnp.asarray(values * rng.normal(size=(33, 4)), jnp.float32),
                "kernel": jnp.asarray(rng.normal(size=(3, 2)), jnp.float32),
            }
        }

    every = [grads(rng, sizes * (rng.random((33, 4)) < 0.7)) for _ in range(5)]

    def run(native):
        chosen, now = optimizer(native, betas), params
        state, update = chosen.init(params), jax.jit(chosen.update)
        for one in every:
            updates, state = update(one, state, now)
            now = optax.apply_updates(now, updates)
        return now, state

    (found, of_found), (wanted, of_wanted) = run(True), run(False)
    assert jax.tree.structure(of_found) == jax.tree.structure(of_wanted)
    close(found["field"]["table"], wanted["field"]["table"])
    np.testing.assert_array_equal(found["field"]["kernel"], wanted["field"]["kernel"])
    for moment in ("mu", "nu"):
        one, other = (getattr(s[0], moment)["field"] for s in (of_found, of_wanted))
        np.testing.assert_allclose(one["table"], other["table"], rtol=1e-5)
    # What had no gradient is where it was, to the last bit.
    still = np.asarray(sizes == 0)
    kept, before = (p["field"]["table"][still] for p in (found, params))
    np.testing.assert_array_equal(kept, before)
