"""Training's parts: rays and patches drawn, one step, clipping, schedule."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.contributions import frequency_loss, patch_conv
from alignerf.mipnerf360 import losses
from alignerf.scenes import prepared
from alignerf.training import batches, methods
from alignerf.training import step as train_step
from tests import training_cases as cases
from tests import twins


@pytest.fixture
def views():
    return cases.make_views()


def everywhere(views):
    """The views with a mask in which every pixel counts."""
    return views._replace(valid=jnp.asarray(batches.all_valid(*views.photos.shape[:3])))


def pixel_of(rays, width=cases.WIDTH, height=cases.HEIGHT):
    """(x, y) of rays of the cases' cameras, which look down -z without turning."""
    x = np.asarray(rays.directions[..., 0]) * cases.FOCAL_PX + width / 2 - 0.5
    y = -np.asarray(rays.directions[..., 1]) * cases.FOCAL_PX + height / 2 - 0.5
    return np.round(x).astype(int), np.round(y).astype(int)


def test_drawn_rays_show_their_pixels(views):
    draw = jax.jit(lambda key, views: batches.draw_rays(key, 3, views, 500, 2))
    batch = draw(jax.random.key(0), views)
    x, y = pixel_of(batch.rays)
    photo = np.asarray(views.photos)[batch.view, y, x] / 255.0
    np.testing.assert_allclose(photo, batch.photo, atol=1e-6)
    valid = np.unpackbits(views.valid, axis=-1, count=40)[batch.view, y, x]
    np.testing.assert_allclose(batch.weight, valid / valid.mean(), rtol=1e-5)
    assert 0 < valid.mean() < 1
    assert set(np.asarray(batch.view)) == {0, 1, 2}
    assert set(x) == set(range(40))
    assert set(y) == set(range(36))


def test_drawn_patches_show_their_pixels_and_nothing_beyond_the_border(views):
    draw = jax.jit(
        lambda key, views: batches.draw_patches(
            key, 0, views, batches.Patches(40, 12, 5), 2
        )
    )
    batch = draw(jax.random.key(1), views)
    x, y = (v.reshape(40, 12, 12) for v in pixel_of(batch.rays))
    photos = np.asarray(views.photos)[batch.view[:, None, None], y, x] / 255.0
    np.testing.assert_allclose(photos, batch.photo[:, 5:-5, 5:-5], atol=1e-6)
    rows, columns = (
        y[:, 0, 0, None] + np.arange(-5, 17),
        x[:, 0, 0, None] + np.arange(-5, 17),
    )
    inside = ((rows >= 0) & (rows < 36))[:, :, None] & (
        (columns >= 0) & (columns < 40)
    )[:, None]
    valid = np.unpackbits(views.valid, axis=-1, count=40)[
        batch.view[:, None, None],
        rows.clip(0, 35)[:, :, None],
        columns.clip(0, 39)[:, None, :],
    ]
    np.testing.assert_array_equal(inside & (valid > 0), batch.exists > 0)
    assert inside.min() == 0
    assert y.min() <= 3
    assert x.max() >= 36


def test_pixels_beyond_two_thousand_million_are_found():
    """170 photos of 2560 x 1680 have 2.2e9 numbers: 32-bit offsets wrap round.

    Pages never written are not in memory, so that the test is small.
    """
    n, h, w = 170, 1680, 2560
    assert n * h * w * 3 > 2**31
    photos = prepared.empty_images((n, h, w, 3))
    photos[-1] = np.random.default_rng(0).integers(1, 256, (h, w, 3))
    camera = cases.make_views(1, h, w)
    views = batches.Views(
        photos=jax.device_put(photos),
        valid=batches.all_valid(n, h, w),
        pixtocams=jnp.tile(camera.pixtocams, (n, 1, 1)),
        camtoworlds=jnp.tile(camera.camtoworlds, (n, 1, 1)),
    )
    draw = jax.jit(lambda key, views: batches.draw_rays(key, 0, views, 3000, 2))
    rays = draw(jax.random.key(0), views)
    draw = jax.jit(
        lambda key, views: batches.draw_patches(
            key, 0, views, batches.Patches(600, 4, 1), 2
        )
    )
    patches = draw(jax.random.key(1), views)
    assert np.all(np.asarray(rays.weight) == 1.0)
    for batch, inner in ((rays, rays.photo), (patches, patches.photo[:, 1:-1, 1:-1])):
        assert np.any(batch.view == n - 1)
        x, y = (v.reshape(inner.shape[:-1]) for v in pixel_of(batch.rays, w, h))
        view = np.asarray(batch.view).reshape(-1, *[1] * (x.ndim - 1))
        np.testing.assert_allclose(photos[view, y, x] / 255.0, inner, atol=1e-6)


def test_pixels_of_weight_zero_change_nothing(rng):
    colour, photo = jnp.asarray(rng.uniform(size=(2, 50, 3)), jnp.float32)
    weight = jnp.asarray(np.arange(50) % 2, jnp.float32)
    spoilt = jnp.where(weight[:, None] > 0, photo, 7.0)
    loss = losses.charbonnier(colour, photo, weight)
    assert loss == losses.charbonnier(colour, spoilt, weight)
    wanted = np.sqrt(np.asarray(colour - photo)[1::2] ** 2 + 1e-6).mean()
    assert float(loss) == pytest.approx(wanted, rel=1e-5)
    assert losses.charbonnier(colour, photo, jnp.zeros(50)) == 0.0


def test_the_baseline_learns_and_stays_finite(views):
    method = cases.baseline(batch_rays=128)
    grey = views._replace(photos=jnp.full_like(views.photos, 60))
    state, step = cases.start(method)
    history = []
    for _ in range(50):
        state, stats = step(state, grey)
        history.append(float(stats["psnr_db"]))
        assert stats["nonfinite_gradients"] == 0
    assert history[-1] > history[0] + 10


@pytest.fixture(scope="module")
def tuning():
    """(fresh state, step) of AligNeRF, compiled once."""
    return cases.start(cases.alignerf())


@pytest.mark.whole
def test_a_share_of_the_rays_teaches_the_proposal(views):
    """Loss and field see all rays; the proposal's gradient is that of the first."""
    options = {"batch_rays": 96, "loss_weights": cases.WEIGHTS}
    gradients, losses = {}, {}
    for share in (1.0, 0.25):
        method = methods.mipnerf360(
            cases.tiny_model(), proposal_fraction=share, **options
        )
        # Of fields that are alike the proposal learns nothing.
        params = cases.varied(jax.jit(method.init)(jax.random.key(1)))
        batch = jax.jit(method.draw)(jax.random.key(2), 0, everywhere(views))

        def loss(params, batch, method=method):
            return sum(method.terms(params, batch, 0.5)[0].values())

        of = jax.jit(jax.value_and_grad(loss))
        losses[share], found = of(params, batch)
        gradients[share] = found["model"]
        if share == 1.0:
            _, alone = of(params, jax.tree.map(lambda x: x[:24], batch))
    assert float(losses[1.0]) == pytest.approx(float(losses[0.25]), rel=1e-5)
    for name, wanted, factor in (
        ("field", gradients[1.0]["field"], 1.0),
        ("proposal", alone["model"]["proposal"], 0.25),
    ):
        pairs = zip(*map(jax.tree.leaves, (gradients[0.25][name], wanted)), strict=True)
        for part, other in pairs:
            # Two programs, of other shapes, round otherwise.
            atol = 1e-4 * factor * np.abs(other).max()
            np.testing.assert_allclose(part, factor * other, rtol=0, atol=atol)
        assert any(np.any(leaf) for leaf in jax.tree.leaves(wanted))


def test_alignerf_takes_a_step_on_every_network(tuning, views):
    fresh, step = tuning
    state = jax.tree.map(jnp.copy, fresh)
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
    method = cases.alignerf(radius_px=0, align_penalty=0.0)
    params = jax.jit(method.init)(jax.random.key(0))
    batch = jax.jit(method.draw)(jax.random.key(4), 0, everywhere(views))
    terms, _ = jax.jit(method.terms)(params, batch, 1.0)
    photo = batch.photo
    rays, jitter = jax.tree.map(
        lambda x: x.reshape(-1, x.shape[-1]), (batch.rays, batch.jitter)
    )
    apply = jax.jit(cases.tiny_model(outputs=6).apply)
    values = apply({"params": params["model"]}, rays, jitter=jitter).values
    rgb = method.colours(params, patch_conv.pad(values.reshape(2, 12, 12, 6)))
    squared = np.sum(np.asarray(photo - rgb, np.float64) ** 2, axis=(1, 2, 3)).mean()
    bank = frequency_loss.bank_features
    features = np.asarray(bank(photo) - bank(rgb), np.float64)
    elements = 12 * 12 * 3
    assert float(terms["data"]) == pytest.approx(squared / elements, rel=1e-4)
    wanted = 0.05 * np.mean(features**2) / elements
    assert float(terms["frequency"]) == pytest.approx(wanted, rel=1e-4)


def test_without_its_parts_no_patch_moves_and_there_is_no_convolution(views):
    parts = {"convolution": False, "radius_px": 0, "frequency_weight": 0.0}
    method = cases.alignerf(outputs=3, **parts)
    params = jax.jit(method.init)(jax.random.key(0))
    assert params.keys() == {"model"}
    batch = jax.jit(method.draw)(jax.random.key(4), 0, everywhere(views))
    terms, shown = jax.jit(method.terms)(params, batch, 1.0)
    assert terms.keys() == {"data", "interlevel", "distortion"}
    assert float(terms["data"]) == pytest.approx(float(shown["mse"]), rel=1e-5)
    assert shown["offset_px"] == 0


def test_a_patch_that_may_move_matches_better(views):
    """The more that may move, the smaller the error that is left."""
    errors, params = [], None
    for radius_px in (3, 0):
        method = cases.alignerf(radius_px=radius_px, align_penalty=0.0)
        if params is None:
            # The loss has none of its own.
            params = jax.jit(method.init)(jax.random.key(0))
        batch = jax.jit(method.draw)(jax.random.key(4), 0, everywhere(views))

        # Each radius draws as much photo around the patches as it needs.
        def error(params, method=method, batch=batch):
            terms, shown = method.terms(params, batch, 1.0)
            return terms["data"], shown

        both = jax.jit(jax.value_and_grad(error, has_aux=True))
        (found, shown), grads = both(params)
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(grads))
        errors.append(float(found))
        assert (shown["offset_px"] > 0) == (radius_px > 0)
    assert errors == sorted(errors)


@pytest.mark.parametrize("level", [0, 255])
def test_black_and_white_photos_train_finitely(tuning, views, level):
    flat = views._replace(photos=jnp.full_like(views.photos, level))
    fresh, step = tuning
    state = jax.tree.map(jnp.copy, fresh)
    for _ in range(3):
        state, stats = step(state, flat)
    assert all(np.isfinite(float(value)) for value in stats.values())


def test_clipping_is_per_network_and_keeps_direction(rng):
    clip = jax.jit(lambda tree: train_step.clip_per_network(tree, 1e-3))
    for size in 10 ** rng.uniform(-20, 38, (1000, 3)):
        a, b, c, d = (s * rng.uniform(-1, 1, 3) for s in size[[0, 0, 1, 2]])
        a, b, c, d = twins.f32(a, b, c, d)
        found = clip({"model": {"field": [a, b], "proposal": c}, "head": d})
        networks = [*found["model"].values(), found["head"]]
        for network, given in zip(networks, ([a, b], [c], [d]), strict=True):
            wanted = np.concatenate(twins.clipped(twins.f64(*given), 1e-3))
            flat = np.concatenate(jax.tree.leaves(network))
            twins.assert_close(flat, wanted, scale=np.abs(wanted).max())
    zero = train_step.clip_per_network({"model": {"field": jnp.zeros(2)}}, 1e-3)
    np.testing.assert_array_equal(zero["model"]["field"], 0.0)


@pytest.mark.parametrize(
    ("entries", "count"),
    [
        ([1e18, np.nan, np.inf, 0.0, -2e19], 3),
        # Each can be squared, though not their sum.
        ([1.8e19] * 9, 0),
        ([0.0, 0.0], 0),
    ],
)
def test_entries_that_adam_cannot_square_are_counted(entries, count, both_ways):
    tree = {"a": jnp.array(entries[:2]), "b": jnp.array([entries[2:]])}
    assert [*both_ways(train_step.count_nonfinite_squares, tree)] == [count, count]
