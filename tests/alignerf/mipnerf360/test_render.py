"""Volume rendering against the papers' formulas, moments against Monte Carlo."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.mipnerf360 import render
from tests import twins

COUNT = 2000


def cone(t0, t1, radius=0.1):
    return jax.jit(render.cast_cones)(
        jnp.array([t0, t1], jnp.float32),
        jnp.zeros(3),
        jnp.array([0.0, 0.0, -1.0]),
        jnp.array([radius]),
    )


def test_frustums_have_the_moments_of_a_cone(rng):
    t0, t1, radius = 1.0, 2.5, 0.2
    # Uniform in the conical frustum: t with density t^2, then a disc of radius r t.
    t = np.cbrt(rng.uniform(t0**3, t1**3, 400_000))
    across = radius * t * np.sqrt(rng.uniform(size=t.size))
    x = across * np.cos(rng.uniform(0, 2 * np.pi, t.size))
    g = cone(t0, t1, radius)
    assert float(-g.mean[0, 2]) == pytest.approx(t.mean(), rel=2e-3)
    assert float(g.t_std[0]) == pytest.approx(t.std(), rel=5e-3)
    assert float(g.r_std[0]) == pytest.approx(x.std(), rel=5e-3)


def test_frustums(rng):
    """Thick and thin ones, and the tip of the cone, in exact arithmetic."""
    t1 = 10 ** rng.uniform(-3, 6, COUNT)
    t0 = t1 * (1 - 10 ** rng.uniform(-6, 0, COUNT))
    t0[:100] = 0
    radius = 10 ** rng.uniform(-5, -1, COUNT)
    o, d = rng.normal(size=(2, COUNT, 3))
    t0, t1, radius, o, d = twins.f32(t0, t1, radius, o, d)
    found = jax.jit(render.cast_cones)(
        np.stack([t0, t1], axis=-1), o, d, radius[:, None]
    )
    mean, t_var, r_var = twins.frustum_moments(*twins.f64(t0, t1, radius))
    along = mean[:, None] * d
    scale = np.abs(along) + np.abs(o)
    twins.assert_close(found.mean[:, 0], o + along, rtol=1e-6, scale=scale)
    twins.assert_close(found.t_std[:, 0], np.sqrt(t_var), rtol=1e-6)
    twins.assert_close(found.r_std[:, 0], np.sqrt(r_var), rtol=1e-6)


@pytest.mark.parametrize("opaque", [True, False])
def test_weights(rng, opaque):
    """Free space, fog and walls; intervals from a millionth to a thousand."""
    density = 10 ** rng.uniform(-6, 6, (COUNT, 12)) * rng.choice([0, 1], (COUNT, 12))
    t = np.cumsum(10 ** rng.uniform(-6, 3, (COUNT, 13)), axis=-1)
    density, t, d = twins.f32(density, t, rng.normal(size=(COUNT, 3)))
    weights = functools.partial(render.alpha_weights, opaque=opaque)
    found = jax.jit(weights)(density, t, d)
    # exp(-x) makes float32's rounding of x, x 2^-24, relative: 1e-5 below 1e-12.
    wanted = twins.alpha_weights(*twins.f64(density, t, d), opaque=opaque)
    twins.assert_close(found, wanted, scale=np.maximum(wanted, 1e-12))
    if opaque:
        twins.assert_close(jnp.sum(found, axis=-1), 1.0)


@pytest.mark.parametrize("background", ["black", "white"])
def test_what_passes_shows_the_background(rng, background):
    """From all to nothing; values that are no colours have no background."""
    kept = 10 ** rng.uniform(-6, 0, COUNT)
    kept[:2] = 0, 1
    weights, values = twins.f32(
        kept[:, None] * rng.dirichlet(np.ones(8), COUNT), rng.uniform(size=(COUNT, 5))
    )
    before = jax.jit(functools.partial(render.before, background))
    found = before(jnp.asarray(values), weights)
    light = {"black": 0.0, "white": 1.0}[background]
    weights, values = twins.f64(weights, values)
    passed = 1 - weights.sum(axis=-1, keepdims=True)
    wanted = values + light * np.maximum(passed, 0) * np.array([1, 1, 1, 0, 0])
    np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_the_gradient_of_the_weights(rng):
    density = 10 ** rng.uniform(-2, 1, (COUNT, 8))
    t = np.cumsum(10 ** rng.uniform(-2, 0, (COUNT, 9)), axis=-1)
    density, t, d, cotangent = twins.f32(
        density, t, rng.normal(size=(COUNT, 3)), rng.normal(size=density.shape)
    )
    _, pull = jax.vjp(jax.jit(lambda x: render.alpha_weights(x, t, d)), density)
    (found,) = pull(cotangent)
    density, t, d, cotangent = twins.f64(density, t, d, cotangent)
    wanted = twins.gradient(
        lambda x: (twins.alpha_weights(x, t, d) * cotangent).sum(axis=-1), density
    )
    # Behind e^(-tau) < 1e-7 only the rounding of 1 - e^(-tau) is left: it is small
    # beside what an interval of this length does elsewhere.
    length = np.diff(t) * np.linalg.norm(d, axis=-1, keepdims=True)
    scale = np.abs(wanted) + 0.1 * length * np.abs(cotangent).max()
    twins.assert_close(found, wanted, scale=scale)


def test_values_and_depth_are_integrated(rng):
    weights = rng.dirichlet(np.ones(16), COUNT)
    t = np.cumsum(10 ** rng.uniform(-3, 3, (COUNT, 17)), axis=-1)
    values = rng.normal(size=(3, COUNT, 16))
    weights, t, values = twins.f32(weights, t, values)
    found = jax.jit(render.integrate)(weights, values)
    wanted = np.einsum("rs,crs->rc", *twins.f64(weights, values))
    twins.assert_close(found, wanted, scale=np.abs(values).max())
    wanted = twins.median_distance(*twins.f64(weights, t))
    twins.assert_close(jax.jit(render.median_distance)(weights, t), wanted)
