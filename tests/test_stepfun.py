"""Histograms on rays: brute-force twins, conservation, and the extremes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.mipnerf360 import stepfun


def random_histogram(rng, bins, batch=()):
    edges = np.sort(rng.uniform(size=(*batch, bins + 1)), axis=-1)
    edges[..., 0], edges[..., -1] = 0, 1
    w = rng.exponential(size=(*batch, bins)) ** 3
    return edges, w / w.sum(axis=-1, keepdims=True)


def f32(*arrays):
    return [jnp.asarray(a, jnp.float32) for a in arrays]


def test_interlevel_loss_equals_a_double_loop(rng):
    for _ in range(200):
        t, w = random_histogram(rng, 7)
        t_other, w_other = random_histogram(rng, 11)
        bound = np.array(
            [
                sum(
                    w_other[j]
                    for j in range(11)
                    if t_other[j] < t[i + 1] and t_other[j + 1] > t[i]
                )
                for i in range(7)
            ]
        )
        wanted = (np.maximum(0, w - bound) ** 2 / w).sum()
        found = stepfun.interlevel_loss(*f32(t, w, t_other, w_other))
        assert found == pytest.approx(wanted, rel=1e-4, abs=1e-6)


def test_interlevel_loss_of_a_histogram_with_itself_is_zero(rng):
    t, w = f32(*random_histogram(rng, 16, (50,)))
    assert jnp.max(stepfun.interlevel_loss(t, w, t, w)) < 1e-7


def test_interlevel_loss_teaches_the_proposal_only(rng):
    t, w = f32(*random_histogram(rng, 8))
    t_other, w_other = f32(*random_histogram(rng, 8))
    grads = jax.grad(stepfun.interlevel_loss, argnums=(0, 1, 3))(t, w, t_other, w_other)
    assert not jnp.any(grads[0])
    assert not jnp.any(grads[1])
    assert jnp.any(grads[2])


def test_distortion_loss_equals_the_integral(rng):
    """Eq. 14: the double integral of p(u) p(v) |u - v| by a fine grid."""
    u = (np.arange(4000) + 0.5) / 4000
    for _ in range(20):
        t, w = random_histogram(rng, 5)
        density = (w / np.diff(t))[np.clip(np.searchsorted(t, u) - 1, 0, 4)] / 4000
        wanted = density @ np.abs(u[:, None] - u[None]) @ density
        found = stepfun.distortion_loss(*f32(t, w))
        assert found == pytest.approx(wanted, rel=2e-2)


def test_the_inverse_cdf_follows_the_histogram(rng):
    t, w = random_histogram(rng, 6, (20,))
    cdf = np.concatenate([np.zeros((20, 1)), np.cumsum(w, axis=-1)], axis=-1)
    u = np.broadcast_to((np.arange(2000) + 0.5) / 2000, (20, 2000))
    found = np.asarray(stepfun.invert_cdf(*f32(u, t, cdf)))
    for x, edges, mass in zip(found, t, w, strict=True):
        shares = np.histogram(x, bins=edges)[0] / 2000
        np.testing.assert_allclose(shares, mass, atol=2e-3)


def test_stratified_edges_are_ordered_and_inside(rng):
    t, w = random_histogram(rng, 6)
    keys = jax.random.split(jax.random.key(0), 400)
    logits = np.log(w)
    edges = jax.vmap(lambda k: stepfun.sample_intervals(k, *f32(t, logits), 32))(keys)
    assert jnp.all(jnp.diff(edges, axis=-1) >= 0)
    assert jnp.min(edges) >= 0
    assert jnp.max(edges) <= 1
    assert jnp.std(edges[:, 16]) > 1e-4


def test_samples_without_a_key_are_reproducible_quantiles():
    edges = stepfun.sample_intervals(None, *f32([0.0, 1.0], [0.0]), 4)
    np.testing.assert_allclose(edges, [0, 0.25, 0.5, 0.75, 1], atol=1e-6)


@pytest.mark.parametrize("anneal", [0.0, 1e-3, 0.5, 1.0])
def test_resampling_never_collapses_on_zero_weights(anneal):
    t = jnp.linspace(0, 1, 9)
    logits = stepfun.annealed_logits(t, jnp.zeros(8), anneal)
    edges = stepfun.sample_intervals(None, t, logits, 8)
    np.testing.assert_allclose(edges, t, atol=1e-5)


def test_annealing_to_zero_is_uniform_even_where_a_weight_is_zero():
    t = jnp.linspace(0, 1, 5)
    w = jnp.array([0.0, 1.0, 0.0, 0.0])
    value, gradient = jax.vjp(lambda w: stepfun.annealed_logits(t, w, 0.0), w)
    np.testing.assert_allclose(jax.nn.softmax(value), 0.25)
    assert jnp.all(jnp.isfinite(gradient(jnp.ones(4))[0]))


def test_all_weight_in_one_bin_is_sampled_there():
    t = jnp.linspace(0, 1, 9)
    w = jnp.zeros(8).at[3].set(1.0)
    edges = stepfun.sample_intervals(None, t, stepfun.annealed_logits(t, w, 1.0), 16)
    assert jnp.min(edges) >= t[3] - 1e-6
    assert jnp.max(edges) <= t[4] + 1e-6


def test_intervals_of_no_width_get_no_samples():
    t = jnp.array([0.0, 0.3, 0.3, 0.3, 1.0])
    logits = stepfun.annealed_logits(t, jnp.array([0.5, 0.5, 0.5, 0.5]), 1.0)
    np.testing.assert_array_equal(jnp.isinf(logits), [False, True, True, False])


def test_dilation_covers_and_conserves(rng):
    t, w = f32(*random_histogram(rng, 12, (100,)))
    t_wide, w_wide = stepfun.max_dilate(t, w, dilation=0.02)
    np.testing.assert_allclose(jnp.sum(w_wide, axis=-1), 1.0, rtol=1e-5)
    # Every interval of the original lies under its own dilated density.
    p = np.asarray(w / jnp.diff(t))
    p_wide = np.asarray(w_wide / jnp.maximum(jnp.diff(t_wide), 1e-9))
    ratio = p_wide.max(axis=-1) / p.max(axis=-1)
    assert np.all(ratio <= 1.0 + 1e-3)


def test_dilation_equals_a_maximum_over_a_window(rng):
    for _ in range(50):
        t, w = random_histogram(rng, 6)
        t_wide, w_wide = map(np.asarray, stepfun.max_dilate(*f32(t, w), dilation=0.05))
        middle = (t_wide[1:] + t_wide[:-1]) / 2
        p = w / np.diff(t)
        near = (t[None, :-1] - 0.05 <= middle[:, None]) & (
            t[None, 1:] + 0.05 > middle[:, None]
        )
        mass = np.where(near, p[None], 0).max(axis=-1) * np.diff(t_wide)
        np.testing.assert_allclose(w_wide, mass / mass.sum(), atol=1e-5)


def test_dilation_of_zero_weights_is_uniform():
    t_wide, w_wide = stepfun.max_dilate(
        jnp.linspace(0, 1, 5), jnp.zeros(4), dilation=0.1
    )
    np.testing.assert_allclose(w_wide, jnp.diff(t_wide), atol=1e-6)


def test_anneal_exponent_is_schlicks_bias():
    x = np.linspace(0, 1, 11)
    found = stepfun.anneal_exponent(x, slope=10.0)
    np.testing.assert_allclose(found, 10 * x / (9 * x + 1))
