"""The contextual loss against a float64 twin, its gradient, and extremes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import ndimage

from alignerf.contributions import align_loss, contextual_loss
from tests import twins

match = jax.jit(contextual_loss.match, static_argnames=("window_px", "spatial_weight"))
OPTIONS = {"window_px": 3, "spatial_weight": 0.01}


def loss_of(render, photo, valid):
    return match(render, photo, valid, **OPTIONS).loss


gradients = jax.jit(jax.grad(loss_of, argnums=(0, 1)))


def distance(render, photo, valid, x, y, dx, dy, window_px):
    """D of pixel (x, y) with that at (dx, dy) in float64; infinite without one."""
    size, radius, reach = len(render), (len(photo) - len(render)) // 2, window_px // 2
    if not valid[y + radius + dy, x + radius + dx]:
        return np.inf
    squares = [
        ((photo[v + radius + dy, u + radius + dx] - render[v, u]) ** 2).sum()
        for v in range(max(y - reach, 0), min(y + reach + 1, size))
        for u in range(max(x - reach, 0), min(x + reach + 1, size))
        if valid[v + radius + dy, u + radius + dx]
    ]
    return np.mean(squares)


def brute_force(render, photo, valid, *, window_px, spatial_weight):
    """Eq. 3 pixel by pixel: (offsets [p, p, 2], loss); ties to the smallest offset."""
    size, radius = len(render), (len(photo) - len(render)) // 2
    best, costs = np.zeros((size, size, 2), int), []
    for y, x in np.ndindex(size, size):
        found = {
            (dx, dy): distance(render, photo, valid, x, y, dx, dy, window_px)
            + spatial_weight * np.hypot(dx, dy)
            for dx, dy in align_loss.offsets_px(radius).tolist()
        }
        chosen = min(found, key=found.get)
        if found[chosen] < np.inf:
            best[y, x] = chosen
            costs.append(found[chosen])
    return best, np.mean(costs) if costs else 0.0


def float32(*arrays):
    return [np.asarray(a, np.float32) for a in arrays]


@pytest.mark.parametrize("window_px", [1, 3])
@pytest.mark.parametrize("share", [0.1, 0.7, 1.0])
@pytest.mark.parametrize(("level", "contrast"), [(0, 1e-4), (0.5, 1), (1e4, 100)])
def test_matches_and_loss_equal_brute_force(rng, window_px, share, level, contrast):
    render, photo = float32(
        level + contrast * rng.uniform(size=(7, 7, 3)),
        level + contrast * rng.uniform(size=(11, 11, 3)),
    )
    valid = np.float32(rng.uniform(size=(11, 11)) < share)
    options = {"window_px": window_px, "spatial_weight": 0.1 * contrast**2}
    best, loss = brute_force(*twins.f64(render, photo), valid, **options)
    found = match(render, photo, valid, **options)
    np.testing.assert_array_equal(found.offset_px, best)
    assert float(found.loss) == pytest.approx(loss, rel=1e-5)
    row, column = np.mgrid[:7, :7] + 2
    row, column = row + best[..., 1], column + best[..., 0]
    matched = valid[row, column] > 0
    np.testing.assert_array_equal(found.patch[matched], photo[row, column][matched])
    np.testing.assert_array_equal(found.patch[~matched], render[~matched])


def test_each_half_of_a_patch_finds_its_own_shift(rng):
    photo = ndimage.gaussian_filter(rng.uniform(size=(24, 24, 3)), (0.7, 0.7, 0))
    render = np.concatenate([photo[4:12, 6:22], photo[12:20, 1:17]])
    found = match(*float32(render, photo), np.ones((24, 24)), window_px=3)
    np.testing.assert_array_equal(
        found.offset_px[:7], np.broadcast_to([2, 0], (7, 16, 2))
    )
    np.testing.assert_array_equal(
        found.offset_px[9:], np.broadcast_to([-3, 0], (7, 16, 2))
    )


def test_the_gradient_is_that_of_the_best_matches_and_of_the_render_alone(rng):
    render, photo = float32(rng.uniform(size=(6, 6, 3)), rng.uniform(size=(10, 10, 3)))
    valid = np.float32(rng.uniform(size=(10, 10)) < 0.8)
    best, _ = brute_force(*twins.f64(render, photo), valid, **OPTIONS)
    photo64 = np.float64(photo)

    def loss_at_best(flat):
        render = flat.reshape(6, 6, 3)
        total = [
            distance(render, photo64, valid, x, y, *best[y, x], 3)
            for y, x in np.ndindex(6, 6)
        ]
        return np.array(np.mean(total))

    wanted = twins.gradient(loss_at_best, np.float64(render).ravel())
    of_render, of_photo = gradients(render, photo, valid)
    np.testing.assert_allclose(of_render.ravel(), wanted, rtol=1e-4, atol=1e-6)
    assert not np.any(of_photo)


@pytest.mark.parametrize("valid_pixels", [0, 1, 144])
@pytest.mark.parametrize(("render", "photo"), [(0, 0), (0.3, 0.3), (0, 1), (1e4, -1e4)])
def test_extremes_are_finite_and_ties_go_to_offset_zero(render, photo, valid_pixels):
    render, photo = (
        np.full((size, size, 3), value, np.float32)
        for size, value in ((8, render), (12, photo))
    )
    valid = np.zeros((12, 12), np.float32)
    # The one valid pixel is that of the patch's (2, 3).
    valid.ravel()[{0: [], 1: [4 * 12 + 5], 144: np.arange(144)}[valid_pixels]] = 1
    photo[valid == 0] = np.nan
    found = match(render, photo, valid, **OPTIONS)
    best, loss = brute_force(*twins.f64(render, photo), valid, **OPTIONS)
    np.testing.assert_array_equal(found.offset_px, best)
    assert float(found.loss) == pytest.approx(loss, rel=1e-5)
    assert found.offset_px[2, 3].tolist() == [0, 0]
    if valid_pixels == 144:
        assert not np.any(found.offset_px)
    of_render, _ = gradients(render, photo, valid)
    assert jnp.all(jnp.isfinite(of_render))
    assert np.any(of_render) == bool(valid_pixels and loss > 1)
    assert jnp.all(jnp.isfinite(found.patch))


def test_bad_sizes_are_refused():
    parts = float32(np.ones((8, 8, 3)), np.ones((12, 12, 3)), np.ones((12, 12)))
    with pytest.raises(ValueError, match="window_px: must be odd, not 2"):
        match(*parts, window_px=2)
    with pytest.raises(ValueError, match="7 px of photo"):
        match(parts[0], *float32(np.ones((7, 7, 3)), np.ones((7, 7))))
