"""The baseline's losses and their gradients against the papers' formulas."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.mipnerf360 import losses, stepfun
from tests import twins

COUNT = 1500
EPS = 2.0**-23


def histograms(rng, bins, *, start=0.0, width=1.0, power=3):
    """Masses on intervals within [start, start + width], of sizes by `power`."""
    t = start + width * np.sort(rng.uniform(size=(COUNT, bins + 1)), axis=-1)
    w = rng.exponential(size=(COUNT, bins)) ** power
    return twins.f32(t, w / w.sum(axis=-1, keepdims=True))


def test_interlevel_loss(rng):
    histogram, proposal = histograms(rng, 9), histograms(rng, 14)
    found = jax.jit(stepfun.interlevel_loss)(*histogram, *proposal)
    wanted = twins.interlevel_loss(*twins.f64(*histogram, *proposal))
    # A bound is a sum of masses near one: known to EPS, as 2 EPS of an interval's
    # loss; the divisor w + EPS takes off as much again.
    twins.assert_close(found, wanted, atol=9 * 4 * EPS)
    # Nothing to teach where the bound is the histogram itself.
    same = jax.jit(stepfun.interlevel_loss)(*histogram, *histogram)
    assert np.max(same) < 9 * EPS


def test_interlevel_loss_teaches_the_proposal_only(rng):
    # An interval's share is 2 (w - bound) / w: of a mass near EPS nothing is known.
    histogram, (t, w) = histograms(rng, 9, power=0.3), histograms(rng, 14)
    of = jax.grad(lambda *x: jnp.sum(stepfun.interlevel_loss(*x)), argnums=(0, 1, 3))
    grads = jax.jit(of)(*histogram, t, w)
    assert not np.any(grads[0])
    assert not np.any(grads[1])
    histogram, (t, w) = twins.f64(*histogram), twins.f64(t, w)
    wanted = twins.gradient(lambda w: twins.interlevel_loss(*histogram, t, w), w)
    known = EPS / histogram[1].min(axis=-1, keepdims=True)
    twins.assert_close(grads[2], wanted, atol=9 * 4 * known)


@pytest.mark.parametrize(("start", "width"), [(0, 1), (0.5, 1e-3), (1 - 1e-5, 1e-5)])
def test_distortion_loss(rng, start, width):
    """On the whole ray, and where everything lies within a sliver of it."""
    t, w = histograms(rng, 12, start=start, width=width)
    found = jax.jit(stepfun.distortion_loss)(t, w)
    wanted = twins.distortion_loss(*twins.f64(t, w))
    twins.assert_close(found, wanted)
    of = jax.grad(lambda w, t: jnp.sum(stepfun.distortion_loss(t, w)))
    found = jax.jit(of)(w, t)
    t, w = twins.f64(t, w)
    wanted = twins.gradient(lambda w: twins.distortion_loss(t, w), w)
    twins.assert_close(found, wanted)


def test_distortion_loss_is_the_integral(rng):
    """Eq. 14: the double integral of p(u) p(v) |u - v|, 100 points a bin."""
    share = (np.arange(100) + 0.5) / 100
    histogram = twins.f64(*(x[:20] for x in histograms(rng, 5)))
    loss = jax.jit(stepfun.distortion_loss)
    for t, w in zip(*histogram, strict=True):
        u = (t[:-1, None] + share * np.diff(t)[:, None]).ravel()
        mass = np.repeat(w / 100, 100)
        wanted = mass @ np.abs(u[:, None] - u[None]) @ mass
        found = float(loss(*twins.f32(t, w)))
        assert found == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize("spread", [1.0, 1e-3, 1e-6])
def test_charbonnier(rng, spread):
    """Far from the photo, at the bend, and where colours all but agree."""
    photo = rng.uniform(size=(1000, 3))
    colour = photo + spread * rng.normal(size=photo.shape)
    colour, photo, weight = twins.f32(colour, photo, rng.uniform(size=1000))
    found = jax.jit(jax.vmap(losses.charbonnier))(
        colour[:, None], photo[:, None], weight[:, None]
    )
    each = zip(
        *twins.f64(colour[:, None], photo[:, None], weight[:, None]), strict=True
    )
    twins.assert_close(found, np.array([twins.charbonnier(*ray) for ray in each]))
    found = jax.jit(losses.charbonnier)(colour, photo, weight)
    twins.assert_close(found, twins.charbonnier(*twins.f64(colour, photo, weight)))
