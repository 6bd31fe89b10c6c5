"""Instant-NGP's field against a slow twin in float64, and its parts at their edges."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import sph_harm_y

from alignerf.fields import box, encoding, space
from alignerf.mipnerf360 import coord
from alignerf.mipnerf360 import model as mipnerf360
from alignerf.rays import rendering
from tests import twins

SIDE = 4.0
FIELD = {
    "levels": 4,
    "log2_hashmap_size": 9,
    "base_resolution": 4,
    "max_resolution": 16,
    "width": 8,
}


def directions(rng, count):
    found = rng.normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def real_harmonics(v):
    """16 real spherical harmonics of a direction, by degree, then order."""
    polar, azimuth = np.arccos(v[2]), np.arctan2(v[1], v[0])
    found = []
    for degree in range(4):
        for order in range(-degree, degree + 1):
            value = sph_harm_y(degree, abs(order), polar, azimuth)
            part = value.imag if order < 0 else value.real
            found.append(part * (np.sqrt(2) if order else 1))
    return np.array(found)


def test_harmonics_are_scipys(rng):
    v = np.concatenate([directions(rng, 50), np.eye(3), -np.eye(3)])
    found = jax.jit(encoding.harmonics)(jnp.asarray(v.T, jnp.float32))
    wanted = np.stack([real_harmonics(one) for one in v], axis=-1)
    np.testing.assert_allclose(found, wanted, atol=2e-6)


def slow_box(params, levels, point, direction):
    """(density, colours) of a point, as instant-ngp's text says."""
    at = point / SIDE + 0.5
    inside = np.all((at >= 0) & (at <= 1))
    x = twins.look_up(params["table"], np.clip(at, 0, 1), levels).ravel()
    x = np.maximum(params["density_0"] @ x, 0)
    x = params["density_1"] @ x
    density = np.exp(min(x[0], 15.0)) * inside
    x = np.concatenate([x, real_harmonics(direction)])
    for layer in range(2):
        x = np.maximum(params[f"colour_{layer}"] @ x, 0)
    return density, 1 / (1 + np.exp(-(params["colour_2"] @ x)[:3]))


def test_the_field_is_its_twin(rng):
    """Also on the rim, and outside, where there is nothing."""
    rays, samples = 6, 5
    field = box.Box(side=SIDE, **FIELD)
    points = rng.uniform(-0.6 * SIDE, 0.6 * SIDE, size=(rays, samples, 3))
    points[0, :3] = [[-2, -2, -2], [2, 2, 2], [2, 0, -2]]
    points[0, 3] = [2.01, 0, 0]
    views = directions(rng, rays)
    mean = jnp.asarray(points, jnp.float32)
    none = jnp.zeros(mean.shape[:2])
    gaussians = coord.Gaussians(mean, mean, none, none)
    params = jax.jit(field.init)(jax.random.key(0), gaussians, np.float32(views))
    params = jax.tree.map(
        lambda leaf: jnp.asarray(rng.normal(size=leaf.shape), jnp.float32), params
    )
    found = jax.jit(field.apply)(params, gaussians, jnp.asarray(views, jnp.float32))
    density, colours = map(np.asarray, found)
    own = {k: np.asarray(v, np.float64) for k, v in params["params"].items()}
    levels = box.levels_of(*(FIELD[k] for k in list(FIELD)[:4]), SIDE)
    # A level at least is dense, and one is hashed.
    sides = [(side + 1) ** 3 for side in levels.resolutions]
    fits = {side <= count for side, count in zip(sides, levels.entries, strict=True)}
    assert fits == {True, False}
    assert density[0, 3] == 0 < density[0, 1]
    for ray in range(rays):
        for sample in range(samples):
            point = np.asarray(mean[ray, sample], np.float64)
            wanted = slow_box(own, levels, point, views[ray])
            np.testing.assert_allclose(density[ray, sample], wanted[0], rtol=3e-3)
            np.testing.assert_allclose(colours[:, ray, sample], wanted[1], atol=3e-3)


def test_the_layout_is_the_published_one():
    """16 levels of up to 2^21 rows, from 16 to 2048 corners a side."""
    levels = box.levels_of(16, 21, 16, 2048, 1.0)
    assert (levels.resolutions[0], levels.resolutions[-1]) == (15, 2047)
    assert levels.entries[0] == 16**3
    assert max(levels.entries) == 2**21
    growth = np.diff(np.log2(np.array(levels.resolutions) + 1.0))
    np.testing.assert_allclose(growth, np.log2(2048 / 16) / 15, atol=0.06)


@pytest.mark.parametrize("x", [0.0, -2.0, 2.0, np.nextafter(2.0, 3.0), 1e30])
def test_the_rim_belongs_to_the_box(x):
    in_box = jax.jit(space.in_box, static_argnums=1)
    at, inside = in_box(jnp.asarray([[x, 0.0, 0.0]], jnp.float32), SIDE)
    at, inside = np.asarray(at), np.asarray(inside)
    assert inside[0] == (abs(np.float32(x)) <= 2)
    assert 0 <= at.min() <= at.max() <= 1


def test_hubers_loss_is_its_formula(rng):
    """And its slope is at most one, however far a colour is off."""
    errors = np.concatenate([rng.normal(size=60), [0.1, -0.1, 0.0, 1e30, -1e30, 1e-20]])
    photo = jnp.zeros((1, 3))

    def loss(error):
        values = jnp.full((1, 3), error, jnp.float32)
        shown = mipnerf360.Rendering(values, None, None)
        return rendering.huber(shown, photo, jnp.ones(1))

    of = jax.jit(jax.value_and_grad(loss))
    for error in errors:
        size = abs(float(np.float32(error)))
        wanted = size**2 / 0.2 if size <= 0.1 else size - 0.05
        value, slope = of(np.float32(error))
        np.testing.assert_allclose(value, wanted, rtol=1e-5, atol=1e-30)
        np.testing.assert_allclose(slope, np.clip(error / 0.1, -1, 1), atol=1e-5)
