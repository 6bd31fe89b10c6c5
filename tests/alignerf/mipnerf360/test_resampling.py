"""Dilated, annealed and stratified resampling against its formulas."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.mipnerf360 import stepfun
from tests import twins

BINS, COUNT = 12, 16
# The rounding of a sum of masses near one: what a quantile is known to.
QUANTILE = 2e-6


def histograms(rng, count, *, grid):
    """Masses over 30 decades and a third of none, edges on a grid; no empty ray."""
    cells = np.array(
        [rng.choice(grid - 1, BINS - 1, replace=False) for _ in range(count)]
    )
    t = np.pad(np.sort(cells + 1), ((0, 0), (1, 1)), constant_values=(0, grid)) / grid
    w = 10 ** rng.uniform(-30, 0, (count, BINS)) * (
        rng.uniform(size=(count, BINS)) < 0.7
    )
    w[:, 5] += rng.uniform(size=count)
    return t, w / w.sum(axis=-1, keepdims=True)


@functools.partial(jax.jit, static_argnums=(3, 4))
def resample(jitter, t, w, dilation, count, anneal):
    if dilation > 0:
        t, w = stepfun.max_dilate(t, w, dilation=dilation)
    logits = stepfun.annealed_logits(t, w, anneal)
    return stepfun.sample_intervals(jitter, t, logits, count)


def assert_edges(found, u, t, w, anneal):
    """Edges midway between samples whose quantiles are u [rays, count], all but."""
    for edges, share, *ray in zip(found, u, t, w, strict=True):
        low = twins.samples(*ray, anneal, share - QUANTILE)
        high = twins.samples(*ray, anneal, share + QUANTILE)
        lowest, highest = ((x[1:] + x[:-1]) / 2 for x in (low, high))
        # The outer edges are the outer midpoints mirrored at the outer samples.
        ends = [0, -1]
        lowest, highest = (
            np.concatenate([outer[:1], inner, outer[1:]])
            for outer, inner in (
                (2 * low[ends] - highest[ends], lowest),
                (2 * high[ends] - lowest[ends], highest),
            )
        )
        assert np.all(edges >= lowest.clip(0, 1) - 1e-6)
        assert np.all(edges <= highest.clip(0, 1) + 1e-6)


@pytest.mark.parametrize("anneal", [0.0, 0.1, 0.6, 1.0])
@pytest.mark.parametrize("dilation", [0.0, 2.0**-9, 2.0**-5, 0.25])
def test_resampling(rng, anneal, dilation):
    """On a grid that float32 holds, so that edges which meet do so in both."""
    t, w = histograms(rng, 250, grid=2**14)
    t, w = twins.f32(t, w)
    found = np.asarray(resample(None, t, w, dilation, COUNT, anneal), np.float64)
    assert np.all(np.diff(found) >= 0)
    rays = list(zip(*twins.f64(t, w), strict=True))
    if dilation > 0:
        rays = [twins.dilated_histogram(*ray, dilation) for ray in rays]
    u = np.broadcast_to((np.arange(COUNT) + 0.5) / COUNT, (250, COUNT))
    assert_edges(found, u, *zip(*rays, strict=True), anneal)


def test_one_jitter_a_ray_in_every_stratum(rng):
    t, w = twins.f32(*histograms(rng, 1000, grid=2**20))
    jitter = rng.uniform(size=1000).astype(np.float32)
    jitter[:2] = 0.0, 1 - 2.0**-24
    found = np.asarray(resample(jitter, t, w, 0.0, COUNT, 1.0), np.float64)
    u = (np.arange(COUNT) + np.float64(jitter)[:, None]) / COUNT
    assert_edges(found, u, *twins.f64(t, w), 1.0)


def test_annealed_weights(rng):
    t, w = twins.f32(*histograms(rng, 1000, grid=2**20))
    found = jax.jit(lambda *x: jax.nn.softmax(stepfun.annealed_logits(*x)))(t, w, 0.25)
    rays = zip(*twins.f64(t, w), strict=True)
    wanted = np.array([np.diff(twins.annealed_cdf(*ray, 0.25)) for ray in rays])
    twins.assert_close(found, wanted, atol=1e-12)


def test_the_anneal_exponent(rng):
    share = np.append(rng.uniform(size=1000), [0.0, 1.0]).astype(np.float32)
    for slope in (1.0, 10.0, 1e3):
        found = stepfun.anneal_exponent(share, slope=slope)
        twins.assert_close(found, twins.anneal_exponent(np.float64(share), slope))


def test_dilation_conserves_the_mass(rng):
    t, w = twins.f32(*histograms(rng, 1000, grid=2**20))
    dilate = jax.jit(functools.partial(stepfun.max_dilate, dilation=0.02))
    t_wide, w_wide = dilate(t, w)
    assert np.all(np.diff(t_wide) >= 0)
    twins.assert_close(jnp.sum(w_wide, axis=-1), 1.0)


def rays(rng, bins):
    """Edges, masses: drawn, on a grid, at one place; of none, one, tiny, huge, NaN."""
    drawn = np.sort(rng.uniform(size=(4, bins + 1)), axis=-1)
    met = np.round(4 * drawn[:1]) / 4
    edges = np.concatenate([drawn, met, np.full((1, bins + 1), 0.25)])
    masses = 10 ** rng.uniform(-3, 0, (8, bins))
    masses[1], masses[2], masses[3] = 0.0, np.eye(bins)[bins // 2], 1e-38
    masses[4] *= 1e30
    masses[5, bins // 2] = np.nan
    t = np.repeat(edges, 8, axis=0)
    return twins.f32(t, np.tile(masses, (6, 1)))


@pytest.mark.parametrize(("bins", "few"), [(1, 9), (7, 99), (7, 9)])
def test_an_accelerator_finds_what_a_cpu_does(rng, bins, few, both_ways, monkeypatch):
    """Also with more edges than a CPU compares with one by one."""
    monkeypatch.setattr(stepfun, "FEW_EDGES", few)
    t, w = rays(rng, bins)
    even = jnp.broadcast_to(jnp.linspace(0, 1, 9), (len(t), 9))
    weights = jnp.asarray(rng.normal(size=(4, 3 * bins - 2)), jnp.float32)

    def every(t, w, x):
        dilate = functools.partial(stepfun.max_dilate, dilation=0.02)
        loss, of_loss = jax.vjp(
            lambda w: stepfun.interlevel_loss(x, jnp.diff(x), t, w), w
        )
        # Of equal masses a maximum has no one gradient: of those drawn.
        _, of_drawn = jax.vjp(lambda w: dilate(t[:32:8], w)[1], w[:32:8])
        return (
            *(stepfun.count_below(t, x, or_equal=equal) for equal in (False, True)),
            stepfun.merge(t, x),
            *dilate(t, w),
            stepfun.resample(t, w, None, 0.5, 16, dilation=0.02),
            *(loss, of_loss(jnp.ones(len(t))), of_drawn(weights)),
        )

    for values in zip(*map(jax.tree.leaves, both_ways(every, t, w, even)), strict=True):
        np.testing.assert_allclose(*values, rtol=1e-4, atol=1e-5)


def test_a_nan_among_the_edges_spoils_its_ray_alone_on_an_accelerator(rng, both_ways):
    t = rays(rng, 7)[0][::8][:3].at[1, 3].set(jnp.nan)
    _, found = both_ways(
        lambda t, w: stepfun.resample(t, w, None, 0.7, 5, dilation=0.01),
        t,
        jnp.ones((3, 7)) / 7,
    )
    np.testing.assert_array_equal(np.isnan(found).all(axis=-1), [False, True, False])
    assert np.isfinite(found[jnp.array([0, 2])]).all()
