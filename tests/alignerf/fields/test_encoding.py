"""The MLP's input against the papers' formulas: basis, projection, encoding."""

import jax
import numpy as np

from alignerf.fields import mlp, shading
from alignerf.mipnerf360 import coord
from tests import twins

DEGREES = 12


def encode(means, variances):
    """[2, degrees, ...] from arrays of any shape."""
    found = jax.jit(mlp.integrated_encoding, static_argnums=2)(
        means.reshape(1, -1), variances.reshape(1, -1), DEGREES
    )
    return np.stack(found).reshape(2, DEGREES, *means.shape)


def test_basis_is_the_icosahedrons_21_axes():
    """Each axis once, in either direction."""
    cosines = np.abs(mlp.icosahedral_basis().T @ twins.icosahedral_directions().T)
    assert cosines.shape == (21, 21)
    np.testing.assert_allclose(cosines.max(axis=0), 1.0, rtol=1e-12)
    np.testing.assert_allclose(cosines.max(axis=1), 1.0, rtol=1e-12)


def test_sine_and_cosine(rng):
    angles = rng.uniform(-1, 1, 20_000) * 10 ** rng.uniform(-30, 4.7, 20_000)
    angles = np.concatenate([angles, np.arange(-16, 17) * np.pi / 4, [0.0, 1e-38]])
    (angles,) = twins.f32(angles)
    # Just beside half a turn, many turns on: where the last digit decides which turn.
    angles = np.append(angles, np.float32([38368.2734375, 48396.24, 33015.0]))
    sine_and_cosine = jax.jit(mlp.sine_and_cosine)
    found = np.stack(sine_and_cosine(angles))
    exact = np.float64(angles)
    twins.assert_close(found, [np.sin(exact), np.cos(exact)], rtol=0, atol=3e-7)
    assert np.all(np.abs(sine_and_cosine(np.float32([1e9, -1e30]))) <= 1 + 1e-6)


def test_integrated_encoding(rng):
    """From points to Gaussians as wide as the scene, in all degrees."""
    mean = rng.uniform(-2, 2, 3000)
    variance = 10 ** rng.uniform(-12, 2, 3000)
    variance[:300] = 0
    mean, variance = twins.f32(mean, variance)
    found = encode(mean, variance)
    mean, variance = twins.f64(mean, variance)
    wanted = twins.integrated_encoding(mean, variance, DEGREES)
    scale = 2.0 ** np.arange(DEGREES)[:, None]
    damp = np.exp(-(scale**2) * variance / 2)
    # Relative to the sinusoid's height.
    twins.assert_close(found, wanted, scale=damp, atol=1e-30)


def test_projected_gaussians(rng):
    """p . x and p^T J Sigma J^T p of each axis p, from a Gaussian on a ray."""
    x = rng.normal(size=(2000, 3)) * 10 ** rng.uniform(-1, 4, (2000, 1))
    d = rng.normal(size=x.shape)
    size = np.linalg.norm(x, axis=-1) * 10 ** rng.uniform(-4, 0, (2, 2000))
    gaussians = coord.Gaussians(*twins.f32(x, d, *size))
    project = jax.jit(lambda given: mlp.project(*coord.contract_gaussians(given)))
    means, variances = project(gaussians)
    x, d, t_std, r_std = twins.f64(*gaussians)
    axes = mlp.icosahedral_basis().T
    pushed = twins.push_forward(x, twins.ray_covariance(d, t_std, r_std))
    twins.assert_close(means, axes @ twins.contract(x).T, rtol=1e-6, scale=2.0)
    wanted = np.einsum("pi,nij,pj->pn", axes, pushed, axes)
    scale = np.linalg.norm(pushed, axis=(-1, -2))
    twins.assert_close(variances, wanted, scale=scale)


def test_encoded_directions(rng):
    """Section 5.3 of arXiv 2003.08934, with the direction itself."""
    v = rng.normal(size=(1000, 3))
    (v,) = twins.f32(v / np.linalg.norm(v, axis=-1, keepdims=True))
    found = jax.jit(shading.encode_direction, static_argnums=1)(v, 4)
    (v,) = twins.f64(np.asarray(v).T)
    waves = twins.integrated_encoding(v, 0 * v, 4)
    twins.assert_close(found, np.concatenate([v, waves.reshape(24, -1)]), scale=1.0)


def test_density(rng):
    (raw,) = twins.f32(rng.normal(size=2000) * 10 ** rng.uniform(-2, 2, 2000))
    wanted = np.logaddexp(0, np.float64(raw) - 1)
    twins.assert_close(shading.density_of(raw), wanted, atol=1e-37)
