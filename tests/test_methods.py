"""Training's parts: rays and patches drawn, one step, clipping, schedule."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf import cameras, fields, frequency_loss, methods, train_step
from alignerf.mipnerf360 import losses
from alignerf.mipnerf360 import model as mipnerf360

WEIGHTS = {"interlevel": 1.0, "distortion": 0.01}


def tiny_model(outputs=3):
    grid = {"levels": 2, "log2_entries": 8, "finest": 32, "width": 8}
    return mipnerf360.Model(
        proposal=fields.make("grid", **grid),
        field=fields.make("grid", **grid, outputs=outputs),
        samples=(8, 4),
        near=0.2,
        far=1e3,
    )


@pytest.fixture
def views(rng):
    pixtocams = np.stack([cameras.intrinsics(30.0, 40, 36)] * 3)
    camtoworlds = np.concatenate([np.eye(3), [[0.0], [0.0], [1.0]]], axis=1)
    return methods.Views(
        photos=jnp.asarray(rng.integers(0, 256, (3, 36, 40, 3)), jnp.uint8),
        valid=jnp.asarray(rng.uniform(size=(3, 36, 40)) < 0.7),
        pixtocams=jnp.asarray(pixtocams, jnp.float32),
        camtoworlds=jnp.asarray(np.stack([camtoworlds] * 3), jnp.float32),
    )


def pixel_of(rays):
    """(x, y) of rays of the cameras above, which look down -z without turning."""
    x = np.asarray(rays.directions[..., 0]) * 30 + 20 - 0.5
    y = -np.asarray(rays.directions[..., 1]) * 30 + 18 - 0.5
    return np.round(x).astype(int), np.round(y).astype(int)


def test_drawn_rays_show_their_pixels(views):
    rays, colour, weight = methods.draw_rays(jax.random.key(0), views, 500)
    x, y = pixel_of(rays)
    photos, valid = np.asarray(views.photos), np.asarray(views.valid)
    same = np.abs(photos[:, y, x] / 255.0 - np.asarray(colour)[None]).max(-1) < 1e-6
    assert np.all(same.any(axis=0))
    assert np.all(
        (valid[:, y, x] == np.asarray(weight)[None])[same.argmax(0), range(500)]
    )
    assert set(x) == set(range(40))
    assert set(y) == set(range(36))


def test_drawn_patches_show_their_pixels_and_nothing_beyond_the_border(views):
    rays, photo, exists = methods.draw_patches(jax.random.key(1), views, 40, 12, 5)
    x, y = (v.reshape(40, 12, 12) for v in pixel_of(rays))
    photos = np.asarray(views.photos) / 255.0
    inner = np.asarray(photo)[:, 5:-5, 5:-5]
    error = np.abs(photos[:, y, x] - inner[None]).max(axis=(2, 3, 4))
    assert np.all(error.min(axis=0) < 1e-6)
    rows, columns = (
        y[:, 0, 0, None] + np.arange(-5, 17),
        x[:, 0, 0, None] + np.arange(-5, 17),
    )
    inside = ((rows >= 0) & (rows < 36))[:, :, None] & (
        (columns >= 0) & (columns < 40)
    )[:, None]
    np.testing.assert_array_equal(inside, exists > 0)
    assert inside.min() == 0
    assert y.min() <= 3
    assert x.max() >= 36


def test_pixels_of_weight_zero_change_nothing(rng):
    colour, photo = jnp.asarray(rng.uniform(size=(2, 50, 3)), jnp.float32)
    weight = jnp.asarray(np.arange(50) % 2, jnp.float32)
    spoilt = jnp.where(weight[:, None] > 0, photo, 7.0)
    loss = losses.charbonnier(colour, photo, weight)
    assert loss == losses.charbonnier(colour, spoilt, weight)
    wanted = np.sqrt(np.asarray(colour - photo)[1::2] ** 2 + 1e-6).mean()
    assert float(loss) == pytest.approx(wanted, rel=1e-5)
    assert losses.charbonnier(colour, photo, jnp.zeros(50)) == 0.0


def make(method, steps=50):
    optimizer = train_step.make_optimizer(
        learning_rates=(1e-2, 1e-3), steps=steps, warmup_steps=5, eps=1e-15
    )
    params = method.init(jax.random.key(0))
    state = train_step.State(jnp.zeros((), jnp.int32), params, optimizer.init(params))
    step = train_step.make_step(
        method, optimizer, steps=steps, gradient_norm=None, seed=0
    )
    return state, step


def test_the_baseline_learns_and_stays_finite(views):
    method = methods.mipnerf360(tiny_model(), batch_rays=128, loss_weights=WEIGHTS)
    grey = views._replace(photos=jnp.full_like(views.photos, 60))
    state, step = make(method)
    history = []
    for _ in range(50):
        state, stats = step(state, grey)
        history.append(float(stats["psnr_db"]))
        assert stats["nonfinite_gradients"] == 0
    assert history[-1] > history[0] + 10


def alignerf_method(**options):
    settings = {
        "patches": 2,
        "patch_px": 12,
        "radius_px": 3,
        "align_penalty": 0.01,
        "frequency_weight": 0.05,
        "frequency_features": frequency_loss.bank_features,
        "loss_weights": WEIGHTS,
    }
    return methods.alignerf(tiny_model(outputs=6), **settings | options)


def test_alignerf_takes_a_step_on_every_network(views):
    state, step = make(alignerf_method())
    before = jax.tree.map(np.asarray, state.params)
    state, stats = step(state, views)
    assert stats["nonfinite_gradients"] == 0
    assert 0 <= stats["offset_px"] <= 3 * np.sqrt(2)
    for name in ("model", "head"):
        changed = jax.tree.map(
            lambda a, b: float(jnp.abs(a - b).max()), before[name], state.params[name]
        )
        assert max(jax.tree.leaves(changed)) > 0


def test_aligned_and_frequency_loss_keep_the_printed_ratio(views):
    """Eq. 4 sums over the patch, Eq. 5 averages; one divisor for both."""
    method = alignerf_method(radius_px=0, align_penalty=0.0)
    params = method.init(jax.random.key(0))
    key = jax.random.key(5)
    _, terms = method.loss(params, views, key, 1.0)
    _, photo, _ = methods.draw_patches(jax.random.split(key)[0], views, 2, 12, 0)
    rays = methods.draw_patches(jax.random.split(key)[0], views, 2, 12, 0)[0]
    values = (
        tiny_model(outputs=6)
        .apply({"params": params["model"]}, rays, key=jax.random.split(key)[1])
        .values
    )
    rgb = method.colours(params, values.reshape(2, 12, 12, 6))
    squared = np.sum(np.asarray(photo - rgb, np.float64) ** 2, axis=(1, 2, 3)).mean()
    bank = frequency_loss.bank_features
    features = np.asarray(bank(photo) - bank(rgb), np.float64)
    elements = 12 * 12 * 3
    assert float(terms["data"]) == pytest.approx(squared / elements, rel=1e-4)
    wanted = 0.05 * np.mean(features**2) / elements
    assert float(terms["frequency"]) == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("level", [0, 255])
def test_black_and_white_photos_train_finitely(views, level):
    flat = views._replace(photos=jnp.full_like(views.photos, level))
    state, step = make(alignerf_method())
    for _ in range(3):
        state, stats = step(state, flat)
    assert all(np.isfinite(float(value)) for value in stats.values())


def test_clipping_is_per_network_and_keeps_direction():
    grads = {
        "model": {"field": jnp.array([3.0, 4.0]), "proposal": jnp.array([1e-5, 0.0])},
        "head": jnp.array([1e30, 1e30]),
    }
    clipped = train_step.clip_per_network(grads, 1e-3)
    np.testing.assert_allclose(clipped["model"]["field"], [6e-4, 8e-4], rtol=1e-5)
    np.testing.assert_allclose(clipped["model"]["proposal"], [1e-5, 0.0])
    assert float(jnp.linalg.norm(clipped["head"])) == pytest.approx(1e-3, rel=1e-5)
    zero = train_step.clip_per_network({"model": {"field": jnp.zeros(2)}}, 1e-3)
    np.testing.assert_array_equal(zero["model"]["field"], 0.0)


def test_the_schedule_is_the_published_one():
    """jaxnerf's formula, in float64."""
    for step in (0, 1, 100, 511, 512, 1000, 125_000, 250_000):
        t = step / 250_000
        delay = 0.01 + 0.99 * np.sin(0.5 * np.pi * min(step / 512, 1))
        wanted = delay * np.exp(np.log(2e-3) * (1 - t) + np.log(2e-5) * t)
        found = train_step.learning_rate(
            step, first=2e-3, last=2e-5, steps=250_000, warmup_steps=512
        )
        assert float(found) == pytest.approx(wanted, rel=1e-5)


def test_nonfinite_entries_are_counted():
    tree = {"a": jnp.array([1.0, jnp.nan]), "b": jnp.array([[jnp.inf, 0.0]])}
    assert train_step.count_nonfinite(tree) == 2
