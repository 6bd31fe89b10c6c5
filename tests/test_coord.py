"""Contraction and ray distance: limits, inverses and float64 twins."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.mipnerf360 import coord


def contract_twin(x):
    """Eq. 10 as printed, in float64."""
    norm = np.linalg.norm(x, axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(norm <= 1, x, (2 - 1 / norm) * x / norm)


def jacobian_twin(x):
    """Eq. 10's Jacobian by float64 central differences of the twin."""
    step = 1e-6 * max(1.0, np.abs(x).max())
    columns = [
        (contract_twin(x + step * e) - contract_twin(x - step * e)) / (2 * step)
        for e in np.eye(3)
    ]
    return np.stack(columns, axis=-1)


def random_points(rng, count):
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    return direction * 10 ** rng.uniform(-3, 6, size=(count, 1))


def test_contract_equals_the_formula(rng):
    x = random_points(rng, 2000)
    found = coord.contract(jnp.asarray(x, jnp.float32))
    np.testing.assert_allclose(found, contract_twin(x), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("size", [0.0, 1e-38, 1e-10, 1 - 1e-7, 1.0, 2e19, 1e30, 1e37])
def test_contract_is_finite_and_bounded_at_the_extremes(size):
    x = jnp.array([size, 0.0, -size], jnp.float32)
    value, gradient = jax.vjp(coord.contract, x)
    assert jnp.linalg.norm(value) <= 2.0 + 1e-6
    assert jnp.all(jnp.isfinite(gradient(jnp.ones(3))[0]))


def test_gaussians_are_pushed_through_the_jacobian(rng):
    for x in random_points(rng, 1000):
        d = rng.normal(size=3)
        t_std, r_std = 10 ** rng.uniform(-3, 0, 2) * max(1, np.linalg.norm(x))
        g = coord.Gaussians(
            *(jnp.asarray(v, jnp.float32) for v in (x, d, t_std, r_std))
        )
        if abs(np.linalg.norm(x) - 1) < 1e-3:
            continue
        across = np.eye(3) - np.outer(d, d) / (d @ d)
        covariance = t_std**2 * np.outer(d, d) + r_std**2 * across
        jacobian = jacobian_twin(x)
        wanted = jacobian @ covariance @ jacobian.T
        _, root = coord.contract_gaussians(g)
        root = np.asarray(root, np.float64)
        scale = np.abs(wanted).max()
        np.testing.assert_allclose(root.T @ root / scale, wanted / scale, atol=2e-4)


def test_spheres_have_the_gaussians_volume(rng):
    # Nearer than 100: beyond, float32 leaves the root too few digits to compare.
    x = random_points(rng, 2000)
    x = x[np.linalg.norm(x, axis=-1) < 100]
    d = rng.normal(size=x.shape)
    t_std, r_std = 10 ** rng.uniform(-4, 1, (2, len(x)))
    g = coord.Gaussians(*(jnp.asarray(v, jnp.float32) for v in (x, d, t_std, r_std)))
    mean, root = coord.contract_gaussians(g)
    same_mean, radius = coord.contract_spheres(g)
    volume = np.abs(np.linalg.det(np.asarray(root, np.float64)))
    np.testing.assert_allclose(mean, same_mean)
    np.testing.assert_allclose(radius, np.cbrt(volume), rtol=5e-3)


def test_gaussians_far_out_stay_finite():
    g = coord.Gaussians(
        jnp.array([1e18, 0, 0]),
        jnp.array([1.0, 0, 0]),
        jnp.array(1e17),
        jnp.array(1e15),
    )
    for value in (*coord.contract_gaussians(g), *coord.contract_spheres(g)):
        assert jnp.all(jnp.isfinite(value))


@pytest.mark.parametrize(
    ("near", "far"), [(0.2, 1e6), (0.01, 2.0), (0.2, 1e8), (1.0, 1e10)]
)
def test_ray_distance_round_trip(near, far):
    s = jnp.array([0.0, 1e-7, 0.1, 0.5, 0.9, 1 - 6e-8, 1.0], jnp.float32)
    t = coord.s_to_t(s, near, far)
    assert jnp.all(jnp.diff(t) > 0)
    assert t[0] == pytest.approx(near, rel=1e-6)
    assert t[-1] == pytest.approx(far, rel=1e-6)
    exact = near / (1 - np.float64(s) * (1 - near / far))
    np.testing.assert_allclose(t, exact, rtol=1e-6)
    np.testing.assert_allclose(coord.t_to_s(t, near, far), s, atol=2e-7)
