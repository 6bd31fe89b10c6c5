"""The aligned loss of single rays: offsets, aligned photos, running costs."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import ndimage

from alignerf.contributions import aligned_loss
from alignerf.training import batches
from tests import training_cases as cases

RADIUS, PENALTY, RAYS = 4, 0.01, 256
SIZE = 60, 80


@pytest.fixture
def views(rng):
    """Two photos of smooth noise, in which every pixel counts."""
    made = cases.make_views(2, *SIZE)
    noise = rng.uniform(size=(2, *SIZE, 3))
    smooth = ndimage.gaussian_filter(noise, (0, 2, 2, 0), mode="wrap")
    smooth = (smooth - smooth.min()) / np.ptp(smooth)
    photos = jnp.asarray(np.round(255 * smooth), jnp.uint8)
    valid = jnp.asarray(batches.all_valid(2, *SIZE))
    return made._replace(photos=photos, valid=valid)


def tiles(patch_px=40):
    return aligned_loss.tiles_of(SIZE, 2, patch_px, RADIUS)


@functools.partial(jax.jit, static_argnums=(1, 2))
def drawn(views, count=4000, patch_px=40):
    """Rays with their surroundings."""
    rays = batches.draw_rays(jax.random.key(0), 0, views, count, 1)
    return aligned_loss.with_photo_around(
        rays, views, tiles(patch_px), batches.is_valid
    )


def shifted(views, batch, offset_px):
    """What the rays show of the photos moved by (dx, dy): photo(x + d)."""
    photos = np.asarray(views.photos, np.float64) / 255
    x, y = pixels_of(batch)
    at = [np.asarray(batch.view), y + offset_px[1], x + offset_px[0]]
    return np.stack(
        [
            ndimage.map_coordinates(
                photos[..., c], at, order=3, mode="nearest", prefilter=True
            )
            for c in range(3)
        ],
        axis=-1,
    )


def pixels_of(batch):
    x = np.asarray(batch.rays.directions[..., 0]) * cases.FOCAL_PX + SIZE[1] / 2 - 0.5
    y = -np.asarray(batch.rays.directions[..., 1]) * cases.FOCAL_PX + SIZE[0] / 2 - 0.5
    return np.round(x).astype(int), np.round(y).astype(int)


@jax.jit
def found(batch, rgb):
    sums, rays = aligned_loss.summed(rgb.astype(jnp.float32), batch, tiles(), 8)
    costs = sums / jnp.maximum(rays, 1)[:, None, None]
    return aligned_loss.offsets_px(costs, RAYS, PENALTY)


offsets_px = jax.jit(aligned_loss.offsets_px)
aligned_photo = jax.jit(aligned_loss.aligned_photo)


@pytest.mark.parametrize(
    "offset_px", [(0, 0), (1, -2), (0.4, 0.3), (-2.3, 1.7), (4, -4), (0, 3.5)]
)
def test_the_offset_of_a_render_is_found(views, offset_px):
    """To a tenth of a pixel, and never beyond the rim of the search."""
    batch = drawn(views)
    offsets = found(batch, shifted(views, batch, offset_px))
    assert offsets.shape == (8, 2)
    np.testing.assert_allclose(offsets, [offset_px] * 8, atol=0.15)
    assert np.abs(offsets).max() <= RADIUS


def test_each_tile_has_an_offset_of_its_own(views):
    batch = drawn(views)
    moves = np.array(
        [(1, 0), (0, -2), (2, 2), (-1, 1), (0, 0), (3, 0), (0, 3), (-2, -2)]
    )
    rgb = np.empty((len(batch.tile), 3))
    for tile, move in enumerate(moves):
        own = np.asarray(batch.tile) == tile
        rgb[own] = shifted(views, batch, move)[own]
    np.testing.assert_allclose(found(batch, rgb), moves, atol=0.2)


def test_errors_are_those_of_float64_on_bright_flat_photos(views, rng):
    """Differences are taken directly: the expanded square loses all digits there."""
    batch = drawn(views, 50)
    around = rng.integers(252, 256, batch.around.shape).astype(np.uint8)
    rgb = np.float32(1 - 1e-4 * rng.uniform(size=(50, 3)))
    errors = jax.jit(aligned_loss.squared_errors)(
        jnp.asarray(rgb), batch._replace(around=jnp.asarray(around))
    )
    wanted = around / 255.0 - np.float64(rgb)[:, None, None]
    np.testing.assert_allclose(errors, (wanted**2).sum(-1), rtol=1e-3, atol=1e-11)


def test_nothing_to_tell_moves_nothing(views):
    """Tiles without rays, and flat photos, where all offsets are alike."""
    zeros = jnp.zeros((5, 9, 9))
    np.testing.assert_array_equal(offsets_px(zeros, RAYS, PENALTY), 0)
    np.testing.assert_array_equal(offsets_px(zeros, RAYS, 0.0), 0)
    flat = views._replace(photos=jnp.full_like(views.photos, 200))
    batch = drawn(flat)
    rgb = jnp.full((len(batch.tile), 3), 0.5)
    np.testing.assert_allclose(found(batch, rgb), 0, atol=1e-6)


@pytest.mark.parametrize("scale", [0.0, 1e-30, 1e-12, 1.0, 3.0])
def test_offsets_stay_within_the_search_at_any_scale(rng, scale):
    costs = jnp.asarray(scale * rng.uniform(size=(200, 9, 9)), jnp.float32)
    for penalty in (0.0, PENALTY, 1e6):
        offsets = np.asarray(offsets_px(costs, RAYS, penalty))
        assert np.isfinite(offsets).all()
        assert np.abs(offsets).max() <= RADIUS


def test_where_nothing_moves_the_photo_is_the_baselines_to_the_bit(views):
    batch = drawn(views)
    photo, weight = aligned_photo(batch, jnp.zeros((4000, 2)))
    np.testing.assert_array_equal(photo, batch.photo)
    np.testing.assert_array_equal(weight, batch.weight)


@pytest.mark.parametrize("offset_px", [(2, -3), (1.5, 0.25), (-0.4, -3.6)])
def test_the_aligned_photo_is_the_photo_at_the_offset(views, offset_px):
    batch = drawn(views)
    offsets = jnp.tile(jnp.asarray(offset_px, jnp.float32), (4000, 1))
    photo, weight = map(np.asarray, aligned_photo(batch, offsets))
    wanted = shifted(views, batch, offset_px)
    x, y = pixels_of(batch)
    x, y = x + offset_px[0], y + offset_px[1]
    height, width = SIZE
    within = (x >= 2) & (x <= width - 3) & (y >= 2) & (y <= height - 3)
    assert np.all(weight[within] == 1)
    np.testing.assert_allclose(photo[within], wanted[within], atol=0.03)
    beyond = (x < -1) | (x > width) | (y < -1) | (y > height)
    assert beyond.sum() > 0
    assert np.all(weight[beyond] == 0)


@pytest.mark.parametrize("offset_px", [(4, 0), (-4, -4), (6, 1)])
def test_tiles_at_the_rim_of_the_search_keep_their_rays(views, offset_px):
    """Also where the best place lies beyond it."""
    batch = drawn(views)
    offsets = found(batch, shifted(views, batch, offset_px))
    photo, weight = aligned_photo(batch, jnp.asarray(offsets)[batch.tile])
    x, y = pixels_of(batch)
    inside = (abs(x - 39.5) < 34) & (abs(y - 29.5) < 24)
    assert np.all(np.asarray(weight)[inside] == 1)
    assert np.isfinite(photo).all()


def test_pixels_that_do_not_count_are_seen_by_nobody(views, rng):
    """What stands in them changes no cost and no colour."""
    mask = rng.uniform(size=(2, *SIZE)) < 0.97
    masked = views._replace(valid=jnp.asarray(batches.pack_valid(mask)))
    wild = rng.integers(0, 256, (*mask.shape, 3)).astype(np.uint8)
    other = jnp.where(mask[..., None], views.photos, wild)
    batch, spoilt = (
        drawn(masked._replace(photos=photos)) for photos in (views.photos, other)
    )
    rgb = shifted(views, batch, (1, 1))
    np.testing.assert_array_equal(found(batch, rgb), found(spoilt, rgb))
    np.testing.assert_allclose(found(batch, rgb), 1, atol=0.5)
    offsets = jnp.full((4000, 2), 0.5)
    ours, theirs = (aligned_photo(b, offsets) for b in (batch, spoilt))
    np.testing.assert_array_equal(ours[1], theirs[1])
    seen = np.asarray(ours[1]) > 0
    np.testing.assert_array_equal(ours[0][seen], theirs[0][seen])
    assert 0 < np.mean(np.asarray(ours[1]) == 0) < 0.2


@pytest.mark.parametrize(("count", "patch_rays"), [(500, 4000), (500, 16), (8, 16)])
def test_costs_become_the_mean_of_the_last_rays(views, count, patch_rays):
    """Also where one step brings a tile more rays than that: no step overshoots."""
    shape = tiles()
    rate = aligned_loss.rate_of(count, 8, patch_rays)
    assert rate * (1 / 8) <= count * (1 / 8)
    costs = jnp.full((8, shape.side, shape.side), 7.0)
    rgb = jnp.full((count, 3), 0.5)

    @jax.jit
    def step(costs, number):
        rays = batches.draw_rays(jax.random.key(0), number, views, count, 1)
        batch = aligned_loss.with_photo_around(rays, views, shape, batches.is_valid)
        value, grad = jax.value_and_grad(
            lambda c: aligned_loss.gathering(c, rgb, batch, shape)
        )(costs)
        return costs - rate * grad, value

    far = []
    wanted = None
    for number in range(max(40, 16 * patch_rays * 8 // count // 4)):
        costs, value = step(costs, number)
        assert value == 0
        if wanted is None:
            batch = drawn(views, 4800)
            grey = jnp.full((4800, 3), 0.5)
            sums, rays = jax.jit(lambda *of: aligned_loss.summed(*of, shape, 8))(
                grey, batch
            )
            wanted = sums / rays[:, None, None]
        far.append(float(jnp.max(jnp.abs(costs - wanted))))
    assert far[-1] < 0.1 * 7
    assert max(far) <= 7.5


def test_photos_smaller_than_the_search_are_refused():
    with pytest.raises(ValueError, match=r"radius_px: 8 searches 17 px .* 30x16"):
        aligned_loss.tiles_of((16, 30), 5, 100, 8)
    assert aligned_loss.tiles_of((17, 30), 5, 100, 8) == (1, 1, 8)


@pytest.mark.parametrize(
    ("size", "views", "wanted"),
    [
        ((150, 200), 42, (2, 2)),
        ((480, 270), 43, (5, 3)),
        ((3000, 4000), 300, (2, 3)),
        ((17, 17), 10**6, (1, 1)),
        ((20000, 17), 1, (200, 1)),
    ],
)
def test_tiles_are_larger_where_there_are_many_photos(size, views, wanted):
    found = aligned_loss.tiles_of(size, views, 100, 8)
    assert found[:2] == wanted
    assert found.rows * found.columns * views <= max(
        views, 1.3 * aligned_loss.MAX_TILES
    )
