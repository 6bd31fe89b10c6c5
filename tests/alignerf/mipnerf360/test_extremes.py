"""Finite values and gradients, and the right limits, at every extreme."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.fields import mlp
from alignerf.mipnerf360 import coord, losses, render, stepfun
from tests import twins


def finite(function, *arguments):
    """The value, which is finite, as is the gradient of sums of its entries."""
    value, pull = jax.vjp(jax.jit(function), *twins.f32(*arguments))
    leaves, structure = jax.tree.flatten(value)
    rng = np.random.default_rng(0)
    for draw in (np.ones, lambda shape: rng.normal(size=shape)):
        cotangent = [jnp.asarray(draw(leaf.shape), jnp.float32) for leaf in leaves]
        for leaf in (*leaves, *pull(jax.tree.unflatten(structure, cotangent))):
            assert np.all(np.isfinite(leaf))
    return jax.tree.map(np.asarray, value)


# Along the axes and between them, at all distances.
AXES = np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1], [1, 1, 1], [-1, 0, 1]], float)
AXES /= np.linalg.norm(AXES, axis=-1, keepdims=True)
SIZES = np.array([0, 1e-38, 1e-10, 1 - 1e-7, 1, 1 + 1e-6, 1e6, 2e19, 1e30, 1e37])
POINTS = SIZES[:, None, None] * AXES


def test_contraction():
    found = finite(coord.contract, POINTS)
    twins.assert_close(
        found, twins.contract(*twins.f64(*twins.f32(POINTS))), atol=1e-37
    )
    radius = np.linalg.norm(np.float64(found), axis=-1)
    wanted = np.where(SIZES < 1, SIZES, 2 - 1 / SIZES.clip(1))
    twins.assert_close(radius, np.broadcast_to(wanted[:, None], radius.shape))


@pytest.mark.parametrize("spread", [0.0, 1e-3, 1.0])
def test_contracted_gaussians(spread):
    """Points, needles and blobs, as large as far away; contracted they stay small."""
    d = np.broadcast_to(1.3 * AXES[::-1], POINTS.shape)
    std = np.broadcast_to(spread * SIZES.clip(1)[:, None], POINTS.shape[:-1])
    given = POINTS, d, std, std
    root = finite(lambda *g: coord.contract_gaussians(coord.Gaussians(*g))[1], *given)
    assert np.max(np.abs(root)) <= 4 * spread
    if spread > 0:
        # A volume has no cube root's gradient at nothing: up to 1e30.
        given = [x[:-1] for x in given]
        radius = finite(
            lambda *g: coord.contract_spheres(coord.Gaussians(*g))[1], *given
        )
        assert np.max(radius) <= 4 * spread
        assert np.all(np.diff(radius[5:], axis=0) < 0)


def test_encoding():
    """A point's sines as they are; of what is larger than all waves, nothing."""
    variances = np.array([0.0, 1e-38, 1e12, 1e30, 3e38])
    means = np.array([-2.0, -1e-3, 0.0, 1e-38, 2.0])
    mean, variance = (x.reshape(1, -1) for x in np.meshgrid(means, variances))
    found = finite(lambda m, v: mlp.integrated_encoding(m, v, 12), mean, variance)
    found = np.stack(found).reshape(2, 12, 5, 5)
    wanted = twins.integrated_encoding(np.float64(np.float32(means)), 0 * means, 12)
    np.testing.assert_allclose(found[:, :, 0], wanted, atol=5e-4)
    np.testing.assert_allclose(found[:, :, 1], wanted, atol=5e-4)
    np.testing.assert_allclose(found[:, :, 2:], 0.0, atol=1e-30)


@pytest.mark.parametrize(("near", "far"), [(0.2, 1e6), (0.2, 1e8), (1.0, 1e10)])
def test_ray_distance(near, far):
    s = np.array([0.0, 1e-7, 1 - 6e-8, 1.0], np.float32)
    t = finite(lambda s: coord.s_to_t(s, near, far), s)
    assert np.all(np.diff(t) > 0)
    np.testing.assert_allclose(t[np.array([0, -1])], [near, far], rtol=1e-6)
    np.testing.assert_allclose(
        t, twins.ray_distance(np.float64(s), near, far), rtol=1e-6
    )
    back = twins.normalised_distance(np.float64(t), near, far)
    np.testing.assert_allclose(back, s, atol=1e-6)


@pytest.mark.parametrize(
    "edges", [(0, 1e-9), (1e-9, 1e-8), (1, 1), (1, 1 + 1e-6), (1e9, 1e10), (1e17, 1e18)]
)
def test_frustums(edges):
    d, zero = np.array([0.0, 0.0, -1.0]), np.zeros(3)
    found = finite(
        lambda t, r: tuple(render.cast_cones(t, *twins.f32(zero, d), r)), edges, [0.1]
    )
    if edges[0] < edges[1]:
        edges = twins.f64(*twins.f32(*edges, 0.1))
        mean, t_var, r_var = twins.frustum_moments(*edges)
        wanted = mean, np.sqrt(t_var), np.sqrt(r_var)
        for value, exact in zip(
            (-found[0][0, 2], found[2], found[3]), wanted, strict=True
        ):
            np.testing.assert_allclose(value, exact, rtol=1e-5)


def test_weights():
    """No light is lost: it ends in the first wall, else in the opaque last interval."""
    density = np.array([0.0, 1e-30, 1.0, 1e30, np.inf])[:, None]
    length = np.array([0.0, 1e-20, 1.0, 1e6])
    depth = np.array(
        [
            [0, 0, 0, 0],
            [0, 0, 0, 0],
            [0, 0, 1, 1e6],
            [0, 1e30, 1e30, 1e30],
            [0] + [1e30] * 3,
        ]
    )
    # Beside 0.2 a length of 1e-20 is none in float32.
    depth[:, 1] = 0
    t = 0.2 + np.arange(5) * length[:, None]
    t = np.broadcast_to(t, (5, 4, 5))
    d = np.broadcast_to([0.0, 0.0, -2.0], (5, 4, 3))
    density = np.broadcast_to(density[..., None], (5, 4, 4))
    found = finite(lambda x: render.alpha_weights(x, *twins.f32(t, d)), density)
    np.testing.assert_allclose(np.sum(found, axis=-1), 1.0, rtol=1e-6)
    np.testing.assert_allclose(found[..., 0], -np.expm1(-2 * depth), atol=1e-6)
    np.testing.assert_allclose(found[..., 3], np.exp(-6 * depth), atol=1e-6)


ONE_BIN = np.eye(8)[3]
WEIGHTS = np.stack([np.zeros(8), ONE_BIN, np.full(8, 1 / 8), np.full(8, 1e-38)])
EVEN = np.linspace(0, 1, 9)
MET = np.array([0, 0.3, 0.3, 0.3, 0.5, 0.5, 0.6, 0.9, 1])


ANNEALS = np.array([0.0, 1e-3, 1.0])


def resample(t, w, dilation):
    """Edges [anneals, ..., 17]."""
    if dilation:
        t, w = stepfun.max_dilate(t, w, dilation=dilation)

    def sample(anneal):
        logits = stepfun.annealed_logits(t, w, anneal)
        return stepfun.sample_intervals(None, t, logits, 16)

    return jax.vmap(sample)(*twins.f32(ANNEALS))


@pytest.mark.parametrize("dilation", [0.0, 0.0625])
def test_resampling(dilation):
    t = np.broadcast_to(np.stack([EVEN, MET])[:, None], (2, 4, 9))
    w = np.broadcast_to(WEIGHTS, (2, 4, 8))
    found = np.asarray(finite(lambda w: resample(*twins.f32(t), w, dilation), w))
    assert np.all(np.diff(found) >= 0)
    assert found.min() >= 0
    assert found.max() <= 1
    # Never one point: where all the mass is in an interval, all of that interval.
    first, last = np.zeros((3, 2, 4)), np.ones((3, 2, 4))
    first[1:, :, 1], last[1:, :, 1] = t[:, 1, 3] - dilation, t[:, 1, 4] + dilation
    assert np.all(found[..., 0] >= first - 1e-6)
    assert np.all(found[..., -1] <= last + 1e-6)
    assert np.all(found[..., -1] - found[..., 0] > 0.9 * (last - first))
    if not dilation:
        even = np.broadcast_to(np.linspace(0, 1, 17), (3, 17))
        np.testing.assert_allclose(found[:, 0, 0], even, atol=1e-5)


@pytest.mark.parametrize("dilation", [0.0, 0.0625])
def test_a_nan_among_the_weights_stays(dilation):
    """In its ray, and there alone."""
    t = np.broadcast_to(np.stack([EVEN, MET])[:, None], (2, 9, 9))
    w = np.broadcast_to(np.where(np.eye(9, 8) == 1, np.nan, 1 / 8), (2, 9, 8))
    given = twins.f32(t, w)
    found = jax.jit(resample, static_argnums=2)(*given, dilation)
    spoilt = np.isnan(found).any(axis=-1)
    # Without dilation an interval of no width has no say, and its NaN has none.
    wanted = np.isnan(w).any(axis=-1)
    wanted[:, :8] &= (np.diff(t)[:, 0] > 0) | (dilation > 0)
    np.testing.assert_array_equal(spoilt, np.broadcast_to(wanted, spoilt.shape))
    even = jnp.ones((2, 9, 8)) / 8
    for loss in (
        jax.jit(stepfun.distortion_loss)(*given),
        jax.jit(stepfun.interlevel_loss)(given[0], even, *given),
    ):
        assert np.all(np.isnan(loss[:, :8]))
        assert np.all(np.isfinite(loss[:, 8]))


def test_histogram_losses():
    t = np.broadcast_to(np.stack([EVEN, MET])[:, None], (2, 4, 9))
    w = np.broadcast_to(WEIGHTS, (2, 4, 8))
    assert np.all(finite(stepfun.distortion_loss, t, w) >= 0)
    for other in (np.zeros(8), ONE_BIN):
        given = twins.f32(t, w, t)
        other = np.broadcast_to(other, (2, 4, 8))
        loss = finite(lambda x, given=given: stepfun.interlevel_loss(*given, x), other)
        # What the proposal says nothing of costs its whole mass.
        missed = np.where(other > 0, 0, w).sum(axis=-1)
        np.testing.assert_allclose(loss[0], missed[0], rtol=1e-5, atol=1e-35)


@pytest.mark.parametrize("level", [0.0, 1.0])
@pytest.mark.parametrize("weight", [0.0, 1e-30, 1.0])
def test_charbonnier_of_black_and_white(level, weight):
    photo, weights = np.full((7, 3), level), np.full(7, weight)
    found = finite(losses.charbonnier, photo, photo, weights)
    if weight == 1:
        assert float(found) == pytest.approx(1e-3, rel=1e-5)
    finite(losses.charbonnier, 1 - photo, photo, weights)
