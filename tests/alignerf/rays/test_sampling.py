"""The systems' parts one by one: twins in float64, and what lies at the ends."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.fields import encoding, space
from alignerf.mipnerf360 import coord
from alignerf.rays import sampling
from tests import system_twins, twins

stratified = jax.jit(sampling.stratified, static_argnums=(1, 2, 3, 4, 5))
sample_pdf = jax.jit(sampling.sample_pdf, static_argnums=3)
COUNT = 500
EPS = np.finfo(np.float32).eps


@pytest.mark.parametrize("far", [6.0, 1e6])
@pytest.mark.parametrize("spacing", ["linear", "inverse"])
def test_stratified_distances(rng, spacing, far):
    """In their order, from near to far, each within its own share of the way."""
    wanted = system_twins.spread(0.2, far, 32, spacing == "inverse")
    found = stratified(None, 0.2, far, 1, 32, spacing)[0]
    twins.assert_close(found, wanted, rtol=1e-6, scale=wanted)
    jitter = rng.uniform(size=(COUNT, 32))
    jitter[:2] = [[0.0], [1.0 - EPS]]
    jitter = twins.f32(jitter)[0]
    found = np.asarray(stratified(jitter, 0.2, far, COUNT, 32, spacing))
    assert (np.diff(found, axis=-1) >= 0).all()
    middle = (wanted[1:] + wanted[:-1]) / 2
    low, high = np.append(wanted[0], middle), np.append(middle, wanted[-1])
    twins.assert_close(found, low + (high - low) * np.float64(jitter), rtol=3e-6)


WEIGHTS = {
    "random": lambda rng, bins: rng.uniform(size=bins),
    "all in one bin": lambda rng, bins: np.eye(bins)[bins // 2],
    "nearly all in one bin": lambda rng, bins: np.eye(bins)[0] + 1e-5,
    "tiny": lambda rng, bins: 1e-20 * rng.uniform(0.5, 1, size=bins),
    "even": lambda rng, bins: np.ones(bins),
}


@pytest.mark.parametrize("kind", WEIGHTS)
@pytest.mark.parametrize(("bins", "count"), [(1, 1), (1, 7), (30, 1), (30, 64)])
def test_samples_fall_where_the_weights_are(rng, kind, bins, count):
    """Inversion of the CDF, from one bin and one sample on; edges up to 1e6."""
    edges = np.append(0.2, 0.2 + np.cumsum(10 ** rng.uniform(-3, 5, bins)))
    edges, weights = twins.f32(edges, WEIGHTS[kind](rng, bins))
    found = np.asarray(sample_pdf(None, edges[None], weights[None], count))[0]
    u = np.linspace(0, 1 - EPS, count)
    wide = twins.f64(edges, weights)
    # A rounding of u is a place as far away as the CDF is flat there.
    near = [
        system_twins.inverse_cdf(np.clip(u + step, 0, 1 - EPS), *wide)
        for step in (-1e-5, 1e-5)
    ]
    slack = 1e-5 * np.abs(near[1])
    assert (found >= near[0] - slack).all()
    assert (found <= near[1] + slack).all()
    jitter = twins.f32(rng.uniform(size=(1, count)))[0]
    moved = np.asarray(sample_pdf(jitter, edges[None], weights[None], count))
    assert (np.diff(moved[0]) >= 0).all()
    assert edges[0] <= moved.min()
    assert moved.max() <= edges[-1]


def test_a_first_look_that_saw_nothing_is_followed_by_even_samples():
    """Empty space: NeRF pads the weights, so that no mass is divided by zero."""
    t = jnp.linspace(1.0, 5.0, 9)[None]
    fine = jax.jit(lambda t, w: sampling.fine_samples(None, t, w, 15))
    found = np.asarray(fine(t, jnp.zeros((1, 9))))[0]
    even = np.linspace(1.25, 4.75, 15)
    np.testing.assert_allclose(
        found, np.sort([*np.linspace(1, 5, 9), *even]), rtol=1e-5
    )


def test_weights_and_what_passes(rng):
    """Free space, fog, walls and an endless last interval: they add up to one."""
    density = 10 ** rng.uniform(-6, 6, (COUNT, 12)) * rng.choice([0, 1], (COUNT, 12))
    density[:3] = [[0.0], [1e30], [np.finfo(np.float32).max]]
    length = 10 ** rng.uniform(-6, 3, (COUNT, 12))
    length[:, -1] = sampling.ENDLESS
    length[3:6] = 0.0
    density, length = twins.f32(density, length)
    weights, passed = jax.jit(sampling.weights_of)(density, length)
    rays = zip(*twins.f64(density, length), strict=True)
    wanted = [system_twins.composite(*ray) for ray in rays]
    own, through = (np.array(part) for part in zip(*wanted, strict=True))
    twins.assert_close(weights, own, scale=np.maximum(own, 1e-10))
    twins.assert_close(passed, through, rtol=2e-5, atol=1e-30)
    twins.assert_close(np.sum(weights, axis=-1) + passed, 1.0)
    slope = jax.grad(lambda d: jnp.sum(sampling.weights_of(d, length)[0][:, ::2]))
    assert np.isfinite(jax.jit(slope)(density)).all()


def test_one_sample_sees_what_there_is():
    weights, passed = jax.jit(sampling.weights_of)(
        jnp.array([[2.0]]), jnp.array([[0.5]])
    )
    np.testing.assert_allclose(weights, [[1 - np.exp(-1)]], rtol=1e-6)
    np.testing.assert_allclose(passed, [np.exp(-1)], rtol=1e-6)


@pytest.mark.parametrize("bins", [1, 2, 33])
def test_mip_nerfs_blur(rng, bins):
    """Means of the larger of neighbours, and a little: as written, bin by bin."""
    blurred = jax.jit(sampling.blurred)
    for weights in (rng.uniform(size=bins), np.zeros(bins), np.eye(bins)[-1]):
        padded = [weights[0], *weights, weights[-1]]
        larger = [max(pair) for pair in itertools.pairwise(padded)]
        wanted = [(a + b) / 2 + 0.01 for a, b in itertools.pairwise(larger)]
        found = blurred(jnp.asarray(weights[None], jnp.float32))[0]
        np.testing.assert_allclose(found, wanted, rtol=1e-6)


def test_integrated_axes_from_points_to_the_widest_gaussians(rng):
    """No variance: NeRF's sines themselves. Far wider than the scene: nothing."""
    mean, direction = twins.f32(*rng.normal(size=(2, COUNT, 3)))
    scale = 10 ** rng.uniform(-6, 2, (2, COUNT))
    scale[:, :100], scale[:, 100:200] = 0.0, 1e6
    t_std, r_std = twins.f32(*scale)
    gaussians = coord.Gaussians(mean, direction, t_std, r_std)
    found = np.asarray(
        jax.jit(encoding.integrated_axes, static_argnums=1)(gaussians, 8)
    )
    assert found.shape == (48, COUNT)
    positional = jax.jit(encoding.positional, static_argnums=1)
    points = np.asarray(positional(np.asarray(mean).T, 8))[3:]
    np.testing.assert_allclose(found[:, :100], points[:, :100], atol=1e-6)
    np.testing.assert_allclose(found[:, 100:200], 0.0, atol=1e-30)
    wide = twins.f64(direction, t_std, r_std)
    variances = np.diagonal(twins.ray_covariance(*wide), axis1=-2, axis2=-1)
    wanted = twins.integrated_encoding(np.float64(mean).T, variances.T, 8)
    wanted = wanted.reshape(48, COUNT)
    # The rounding of a small variance beside large ones, by the highest degree.
    np.testing.assert_allclose(found, wanted, atol=2e-5)


def test_the_outside_of_a_sphere_to_infinity(rng):
    """|x| = 1 / u on the ray, and at u = 0 the ray's own direction (NeRF++)."""
    origins = rng.normal(size=(COUNT, 3))
    origins *= rng.uniform(0, 0.99, (COUNT, 1)) / np.linalg.norm(
        origins, axis=-1, keepdims=True
    )
    origins[0] = 0.0
    directions = rng.normal(size=(COUNT, 3)) * 10 ** rng.uniform(-3, 3, (COUNT, 1))
    u = np.concatenate([[0.0], 10 ** rng.uniform(-6, 0, 6), [1.0]])
    u = np.broadcast_to(u, (COUNT, len(u)))
    u, origins, directions = twins.f32(u, origins, directions)
    found = np.asarray(jax.jit(space.invert_sphere)(u, origins, directions))
    np.testing.assert_array_equal(found[..., 3], u)
    u, origins, directions = twins.f64(u, origins, directions)
    unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    np.testing.assert_allclose(found[:, 0, :3], unit, atol=1e-6)
    along = np.sum(origins * unit, axis=-1, keepdims=True)
    rest = np.sum(origins**2, axis=-1, keepdims=True)
    at = np.sqrt(along**2 + 1 / u[:, 1:] ** 2 - rest) - along
    x = origins[:, None] + at[..., None] * unit[:, None]
    np.testing.assert_allclose(found[:, 1:, :3], x * u[:, 1:, None], atol=3e-6)


def test_where_rays_leave_a_sphere(rng):
    origins, directions = twins.f32(
        rng.uniform(-1, 1, (COUNT, 3)),
        rng.normal(size=(COUNT, 3)) * 10 ** rng.uniform(-3, 3, (COUNT, 1)),
    )
    t = np.asarray(
        jax.jit(space.sphere_exit, static_argnums=2)(origins, directions, 1.75),
        np.float64,
    )
    origins, directions = twins.f64(origins, directions)
    reached = np.linalg.norm(origins + t * directions, axis=-1)
    np.testing.assert_allclose(reached, 1.75, rtol=1e-5)
    assert (t > 0).all()
