"""Contraction, Gaussians and ray distance against the papers' formulas."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.mipnerf360 import coord
from tests import twins

COUNT = 2000
# Distances along a ray.
T = np.geomspace(0.2, 1e6, 8, dtype=np.float32)[:, None]


def unit_vectors(rng, count=COUNT):
    x = rng.normal(size=(count, 3))
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def along_rays(rng):
    """Points as far out as 1e6 on rays from near the middle, and Gaussians there."""
    d = unit_vectors(rng) * rng.uniform(1, 1.6, (COUNT, 1))
    origins = unit_vectors(rng) * 10 ** rng.uniform(-2, 0.3, (COUNT, 1))
    t = 10 ** rng.uniform(-2, 6, (COUNT, 1))
    x = origins + t * d
    t_std, r_std = t[:, 0] * 10 ** rng.uniform([[-6], [-5]], [[-0.3], [-1]], (2, COUNT))
    return coord.Gaussians(*twins.f32(x, d, t_std, r_std))


def anywhere(rng):
    """Gaussians of any orientation: no ray that passes near the middle."""
    x = unit_vectors(rng) * 10 ** rng.uniform(-3, 6, (COUNT, 1))
    scale = np.linalg.norm(x, axis=-1)
    t_std, r_std = scale * 10 ** rng.uniform(-6, 0, (2, COUNT))
    d = rng.normal(size=x.shape)
    return coord.Gaussians(*twins.f32(x, d, t_std, r_std))


def test_contraction(rng):
    size = 10 ** rng.uniform(-37, 37, (COUNT, 1))
    near_the_rim = 1 + 10 ** rng.uniform(-7, -1, size.shape) * np.sign(size - 1)
    for radius in (size, 10 ** rng.uniform(-3, 6, (COUNT, 1)), near_the_rim):
        (x,) = twins.f32(radius * unit_vectors(rng))
        found = jax.jit(coord.contract)(x)
        twins.assert_close(found, twins.contract(*twins.f64(x)), rtol=1e-6)


@pytest.mark.parametrize("draw", [along_rays, anywhere])
def test_gaussians_are_pushed_through_the_jacobian(rng, draw):
    gaussians = draw(rng)
    mean, root = jax.jit(coord.contract_gaussians)(gaussians)
    root = np.asarray(root, np.float64)
    x, d, t_std, r_std = twins.f64(*gaussians)
    covariance = twins.ray_covariance(d, t_std, r_std)
    wanted = twins.push_forward(x, covariance)
    # A long Gaussian that points at the origin turns into a short one: as much as
    # rounding x to float32 changes it, no float32 code can know it.
    ulp = 2.0**-24 * np.linalg.norm(x, axis=-1, keepdims=True)
    moved = [twins.push_forward(x + ulp * axis, covariance) for axis in np.eye(3)]
    known = np.abs(np.array(moved) - wanted).max(axis=(0, -1, -2))
    scale = np.abs(wanted).max(axis=(-1, -2))
    error = np.abs(np.swapaxes(root, -1, -2) @ root - wanted).max(axis=(-1, -2))
    assert np.all(error <= 1e-5 * scale + 2 * known)
    if draw is anywhere:
        assert np.all(error <= 1e-5 * scale)
    twins.assert_close(mean, twins.contract(x), rtol=1e-6)


@pytest.mark.parametrize("draw", [along_rays, anywhere])
def test_spheres_have_the_volume_of_the_gaussian(rng, draw):
    gaussians = draw(rng)
    mean, radius = jax.jit(coord.contract_spheres)(gaussians)
    x, d, t_std, r_std = twins.f64(*gaussians)
    # det(J Sigma J^T), Sigma's eigenvalues being those of its definition.
    root = np.linalg.det(twins.contraction_jacobian(x))
    root = root * t_std * np.linalg.norm(d, axis=-1) * r_std**2
    twins.assert_close(radius, np.cbrt(root), rtol=1e-5)
    twins.assert_close(mean, twins.contract(x), rtol=1e-6)


def test_a_cube_root_holds_in_all_of_float32(rng):
    x = np.float32(10 ** rng.uniform(-37.9, 38.5, COUNT))
    twins.assert_close(jax.jit(coord.cube_root)(x), np.cbrt(twins.f64(x)[0]), rtol=3e-6)
    slope = jax.vmap(jax.grad(coord.cube_root))(np.float32([coord.TINY, 1.0, 1e30]))
    np.testing.assert_allclose(slope, [1e20 / 3, 1 / 3, 1e-20 / 3], rtol=1e-5)


def test_ray_distance_both_ways(rng):
    near = 10 ** rng.uniform(-3, 1, COUNT)
    far = near * 10 ** rng.uniform(0.1, 9, COUNT)
    s = rng.uniform(size=COUNT) ** rng.choice([0.1, 1, 10, 30], COUNT)
    near, far, s = twins.f32(near, far, s)
    wanted = twins.ray_distance(*twins.f64(s, near, far))
    t = jax.jit(coord.s_to_t)(s, near, far)
    twins.assert_close(t, wanted, rtol=1e-6)
    back = twins.normalised_distance(*twins.f64(t, near, far))
    np.testing.assert_allclose(back, s, atol=1e-6 * np.max(far / (far - near)))


def test_points_that_are_worked_out_twice_have_a_slope(rng):
    """The compiler may round them otherwise where a gradient needs them again.

    A slope through the largest coordinate was then 0 / 0 (tests run code that is not
    optimised, where it was so on this machine).
    """
    gaussians = along_rays(rng)

    def total(origins, directions):
        x = origins[:, None] + T[None] * directions[:, None]
        moved = coord.Gaussians(x, *(jnp.asarray(y)[:, None] for y in gaussians[1:]))
        return jnp.sum(coord.contract(x)) + jnp.sum(coord.contract_spheres(moved)[1])

    origins = np.float32(rng.normal(size=(COUNT, 3)) * 1e-3 + [0, 0, 1])
    directions = np.float32(unit_vectors(rng))
    slopes = jax.jit(jax.grad(total, argnums=(0, 1)))(origins, directions)
    assert all(np.isfinite(slope).all() for slope in slopes)
