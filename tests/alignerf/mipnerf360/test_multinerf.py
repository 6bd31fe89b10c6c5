"""The released code beside ours, function by function and as a whole.

ALIGNERF_MULTINERF names a checkout of google-research/multinerf, which needs
gin-config beside our environment; without it all of this is skipped. Both run in
float32, so that a tolerance is the larger of the two codes' errors: those of ours
against the formulas are in the other tests, theirs are given here.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.mipnerf360 import coord, render, stepfun
from alignerf.scenes import cameras
from alignerf.training import step as train_step
from tests import twins

# Its code warns of what has changed in NumPy and JAX since.
pytestmark = pytest.mark.filterwarnings("ignore")
COUNT = 1000


def unit_vectors(rng, *shape):
    x = rng.normal(size=(*shape, 3))
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def rays_of(rng, count):
    d = unit_vectors(rng, count)
    length, radii = rng.uniform(1, 1.5, (count, 1)), rng.uniform(1e-4, 1e-2, (count, 1))
    return cameras.Rays(*twins.f32(rng.normal(size=d.shape) / 3, length * d, d, radii))


def histograms(rng, bins):
    t = np.sort(rng.uniform(size=(COUNT, bins + 1)), axis=-1)
    w = rng.exponential(size=(COUNT, bins)) ** 2
    return twins.f32(t, w / w.sum(axis=-1, keepdims=True))


def test_contraction(peer, rng):
    (x,) = twins.f32(unit_vectors(rng, COUNT) * 10 ** rng.uniform(-3, 6, (COUNT, 1)))
    wanted = np.float64(peer.coord.contract(x))
    twins.assert_close(coord.contract(x), wanted, rtol=1e-6)


def test_ray_distance(peer, rng):
    near, far = twins.f32(rng.uniform(0.1, 1, COUNT), 10 ** rng.uniform(1, 6, COUNT))
    (s,) = twins.f32(rng.uniform(size=COUNT))
    _, s_to_t = peer.coord.construct_ray_warps(jnp.reciprocal, near, far)
    # It takes 1 / t from 1 / near: what is left has as few digits as s is small.
    t = np.float64(s_to_t(s))
    twins.assert_close(coord.s_to_t(s, near, far), t, rtol=1e-6)


def frustums(peer, rng, furthest):
    """Edges and rays; means and covariances of the frustums, theirs and ours."""
    rays = rays_of(rng, COUNT)
    # Below 2e-4 it divides by a constant that keeps it from dividing by zero.
    t = 0.1 * (10 * furthest) ** rng.uniform(size=(COUNT, 9))
    (t,) = twins.f32(np.sort(t, axis=-1))
    theirs = peer.render.cast_rays(t, *rays[:2], rays.radii, "cone", diag=False)
    return theirs, render.cast_cones(t, *rays[:2], rays.radii)


def test_frustums(peer, rng):
    (means, covs), ours = frustums(peer, rng, 1e4)
    scale = np.linalg.norm(means, axis=-1, keepdims=True)
    twins.assert_close(ours.mean, np.float64(means), rtol=1e-6, scale=scale)
    ours = twins.ray_covariance(*twins.f64(*ours[1:]))
    scale = np.abs(covs).max(axis=(-1, -2), keepdims=True)
    twins.assert_close(ours, np.float64(covs), scale=scale)


def test_gaussians_through_the_contraction(peer, rng):
    (means, covs), ours = frustums(peer, rng, 100)
    means, covs = peer.coord.track_linearize(peer.coord.contract, means, covs)
    mean, root = coord.contract_gaussians(ours)
    twins.assert_close(mean, np.float64(means), rtol=1e-6, scale=2.0)
    (root,) = twins.f64(root)
    found = np.swapaxes(root, -1, -2) @ root
    # It multiplies covariances by Jacobians: what is left of a long Gaussian on its
    # way out is a difference of terms |x|^2 as large. At 1e4 its variances are off
    # by their own size and may be negative; ours, by 2e-4.
    known = 1e-6 + 8 * 2.0**-23 * np.sum(ours.mean**2, axis=-1)[..., None, None]
    scale = np.abs(found).max(axis=(-1, -2), keepdims=True)
    twins.assert_close(found, np.float64(covs), rtol=0, atol=scale * known)


def test_weights(peer, rng):
    density = rng.exponential(size=(COUNT, 32)) * 10 ** rng.uniform(-2, 2, (COUNT, 1))
    t = np.sort(rng.uniform(0.2, 10, (COUNT, 33)), axis=-1)
    density, t, d = twins.f32(density, t, rng.normal(size=(COUNT, 3)))
    theirs, _, _ = peer.render.compute_alpha_weights(
        density, t, d, opaque_background=True
    )
    # Its 1 - exp(-x) is known to the rounding of one.
    found = render.alpha_weights(density, t, d)
    twins.assert_close(found, np.float64(theirs), atol=2e-7)


@pytest.mark.parametrize("seed", [None, 0])
@pytest.mark.parametrize("share", [1e-3, 0.1, 1.0])
def test_resampling(peer, rng, share, seed):
    t, w = histograms(rng, 24)
    dilation = 0.0025 + 0.5 / 24
    t_wide, w_wide = peer.stepfun.max_dilate_weights(
        t, w, dilation, domain=(0.0, 1.0), renormalize=True
    )
    t_wide, w_wide = t_wide[..., 1:-1], w_wide[..., 1:-1]
    anneal = stepfun.anneal_exponent(share, slope=10.0)
    logits = jnp.where(jnp.diff(t_wide) > 0, anneal * jnp.log(w_wide), -jnp.inf)
    key = None if seed is None else jax.random.PRNGKey(seed)
    theirs = peer.stepfun.sample_intervals(
        key, t_wide, logits, 32, single_jitter=True, domain=(0.0, 1.0)
    )
    t_wide, w_wide = stepfun.max_dilate(t, w, dilation=dilation)
    logits = stepfun.annealed_logits(t_wide, w_wide, anneal)
    # What the peer draws of this key: one number a ray.
    jitter = key if key is None else jax.random.uniform(key, (len(t), 1))[:, 0]
    ours = np.asarray(stepfun.sample_intervals(jitter, t_wide, logits, 32))
    # Where the density is low a quantile's rounding of 1e-6 moves a sample far.
    error = np.abs(ours - theirs)
    assert np.quantile(error, 0.999) < 1e-5
    assert np.mean(error > 1e-4) < 1e-4


def test_losses(peer, rng):
    t, w = histograms(rng, 32)
    t_other, w_other = histograms(rng, 64)
    theirs = np.float64(peer.stepfun.lossfun_outer(t, w, t_other, w_other).sum(axis=-1))
    twins.assert_close(
        stepfun.interlevel_loss(t, w, t_other, w_other), theirs, atol=1e-5
    )
    theirs = np.float64(peer.stepfun.lossfun_distortion(t, w))
    twins.assert_close(stepfun.distortion_loss(t, w), theirs)


def test_schedule(peer, rng):
    theirs = functools.partial(
        peer.math.learning_rate_decay,
        lr_init=2e-3,
        lr_final=2e-5,
        max_steps=250_000,
        lr_delay_steps=512,
        lr_delay_mult=0.01,
    )
    ours = functools.partial(
        train_step.learning_rate, first=2e-3, last=2e-5, steps=250_000, warmup_steps=512
    )
    steps = np.concatenate([np.arange(600), rng.integers(0, 250_001, COUNT)])
    twins.assert_close(jax.vmap(ours)(steps), np.float64(jax.vmap(theirs)(steps)))


def test_clipping(peer, rng):
    config = peer.configs.Config(grad_max_norm=1e-3)
    for scale in 10 ** rng.uniform(-2, 3, 100):
        a, b = twins.f32(*(scale * rng.normal(size=(2, 7))))
        theirs = peer.train_utils.clip_gradients({"params": {"a": a, "b": b}}, config)
        ours = train_step.clip_per_network({"model": {"a": a, "b": b}}, 1e-3)
        for name in "ab":
            # It divides by the norm + 1.2e-7.
            wanted = np.float64(theirs["params"][name])
            twins.assert_close(ours["model"][name], wanted, rtol=2e-5)


def test_poses(peer, rng):
    for _ in range(100):
        poses = np.linalg.qr(rng.normal(size=(12, 3, 3)))[0]
        poses *= np.sign(np.linalg.det(poses))[:, None, None]
        centres = rng.normal(size=(12, 3, 1)) * 3 + rng.normal(size=(3, 1))
        poses = np.concatenate([poses, centres], axis=-1)
        theirs, transform = peer.camera_utils.transform_poses_pca(poses)
        own = cameras.frame_of(poses)
        ours, similarity = own.normalised(poses), own.transform()
        # Their axes' signs are those that the eigenvectors happen to have.
        turn = np.diag([-1.0, -1.0, 1.0])
        frames = [np.eye(3), turn]
        near = [np.abs(frame @ theirs - ours).max() for frame in frames]
        assert min(near) < 1e-9
        frame = frames[int(np.argmin(near))]
        np.testing.assert_allclose(frame @ transform[:3], similarity[:3], atol=1e-9)


def test_rays(peer, rng):
    focal, size = rng.uniform(500, 3000, COUNT), rng.uniform(800, 3000, (COUNT, 2))
    pixtocams = np.stack(
        [cameras.intrinsics(f, *wh) for f, wh in zip(focal, size, strict=True)]
    )
    poses = np.concatenate(
        [
            np.linalg.qr(rng.normal(size=(COUNT, 3, 3)))[0],
            rng.normal(size=(COUNT, 3, 1)),
        ],
        axis=-1,
    )
    x, y = np.floor(rng.uniform(size=(2, COUNT)) * size.T).astype(int)
    theirs = peer.camera_utils.pixels_to_rays(x, y, pixtocams, poses)
    ours = cameras.pixels_to_rays(x, y, pixtocams, poses)
    for value, wanted in zip(ours, theirs[:4], strict=True):
        np.testing.assert_allclose(value, wanted, rtol=1e-9, atol=1e-12)
    ours = cameras.pixels_to_rays(
        jnp.asarray(x), jnp.asarray(y), *twins.f32(pixtocams, poses)
    )
    for value, wanted in zip(ours, theirs[:4], strict=True):
        np.testing.assert_allclose(value, wanted, rtol=1e-6, atol=1e-6)
