"""Volume rendering: Monte Carlo, float64 twins and the extremes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.mipnerf360 import render

DIRECTION = jnp.array([0.0, 0.0, -1.0])


def cone(t0, t1, radius=0.1):
    return render.cast_cones(
        jnp.array([t0, t1], jnp.float32), jnp.zeros(3), DIRECTION, jnp.array([radius])
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


@pytest.mark.parametrize(
    ("t0", "t1"), [(1e-9, 1e-8), (1, 1), (1, 1 + 1e-6), (1e9, 1e10), (1e17, 1e18)]
)
def test_frustums_are_finite_at_the_extremes(t0, t1):
    value, pull = jax.vjp(lambda a, b: tuple(cone(a, b)), float(t0), float(t1))
    gradients = pull(jax.tree.map(jnp.ones_like, value))
    for leaf in jax.tree.leaves((value, gradients)):
        assert jnp.all(jnp.isfinite(leaf))


def test_weights_equal_the_product_formula(rng):
    for _ in range(100):
        density = rng.exponential(size=8) * 5
        t = np.sort(rng.uniform(1, 3, 9))
        alpha = 1 - np.exp(-density * np.diff(t))
        alpha[-1] = 1.0
        wanted = alpha * np.concatenate([[1], np.cumprod(1 - alpha[:-1])])
        found = render.alpha_weights(
            jnp.asarray(density, jnp.float32), jnp.asarray(t, jnp.float32), DIRECTION
        )
        np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-6)
        assert jnp.sum(found) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("density", [0.0, 1e-30, 1e30, np.inf])
@pytest.mark.parametrize("length", [0.0, 1e-20, 1.0, 1e6])
def test_weights_are_finite_at_the_extremes(density, length):
    t = 0.2 + jnp.arange(5) * length

    def weights(d):
        return render.alpha_weights(d, t.astype(jnp.float32), DIRECTION)

    value, pull = jax.vjp(weights, jnp.full(4, density, jnp.float32))
    assert jnp.all(jnp.isfinite(value))
    assert jnp.all(jnp.isfinite(pull(jnp.ones(4))[0]))
    assert jnp.sum(value) == pytest.approx(1.0, abs=1e-6)


def test_median_distance_is_where_half_the_weight_has_passed():
    weights = jnp.array([[0.2, 0.2, 0.2, 0.4], [0.0, 0.0, 0.0, 1.0]])
    t = jnp.array([[1.0, 2, 3, 4, 5], [1.0, 2, 3, 4, 5]])
    np.testing.assert_allclose(render.median_distance(weights, t), [3.5, 4.5])
