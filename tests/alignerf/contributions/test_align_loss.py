"""The alignment-aware loss against a float64 twin, at extremes, and its gradient."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import ndimage

from alignerf.contributions import align_loss, patch_losses

# The paper's sizes.
SIZE, AROUND, RADIUS = 32, 48, 8
align = jax.jit(align_loss.align, static_argnames="penalty")


@functools.partial(jax.jit, static_argnums=3)
def loss_of(render, photo, valid, penalty=0.01):
    """L_PM of one patch."""
    parts = (part[None] for part in (render, photo, valid))
    _, of_a_value, _ = patch_losses.match_patches(*parts, penalty)
    return of_a_value * render.size


def brute_force(render, photo, valid, penalty=0.01):
    """Eq. 4 by a double loop in float64: {(dx, dy): cost}, the shortest first."""
    render, photo = np.float64(render), np.float64(photo)
    size, radius = len(render), (len(photo) - len(render)) // 2
    wanted = (valid[radius : radius + size, radius : radius + size] > 0).sum()
    costs = {}
    for dx, dy in align_loss.offsets_px(radius):
        part = np.s_[radius + dy : radius + dy + size, radius + dx : radius + dx + size]
        seen = valid[part] > 0
        if seen.sum() >= wanted:
            error = ((photo[part] - render)[seen] ** 2).sum()
            scale = wanted / max(seen.sum(), 1)
            costs[dx, dy] = error * scale + penalty * np.hypot(dx, dy)
    return costs


def float32(*arrays):
    return [np.asarray(a, np.float32) for a in arrays]


def whole(around=AROUND):
    return np.ones((around, around), np.float32)


def make_patches(kind, contrast, rng):
    """(render, photo) of the paper's sizes; `contrast` scales both."""
    size = (AROUND, AROUND, 3)
    texture = ndimage.gaussian_filter(rng.normal(size=size), (2, 2, 0))
    noise = rng.normal(size=size)
    photo = (
        contrast
        * {
            "dark": np.maximum(texture, 0),
            "bright": 1e3 + texture,
            "flat": 100 + 1e-3 * noise,
            "noisy": texture + noise,
            "constant": np.full(size, 0.7),
        }[kind]
    )
    level = {"constant": 0.3, "flat": 1e-3}.get(kind, 0.1)
    cut = np.s_[RADIUS + 3 : RADIUS + 3 + SIZE, RADIUS - 2 : RADIUS - 2 + SIZE]
    render = photo[cut] + level * contrast * rng.normal(size=(SIZE, SIZE, 3))
    return float32(photo[cut] - level if kind == "constant" else render, photo)


@pytest.mark.parametrize("contrast", [1e-4, 1e-2, 1.0, 1e2, 1e4])
@pytest.mark.parametrize("kind", ["dark", "bright", "flat", "noisy", "constant"])
def test_alignment_equals_brute_force(rng, kind, contrast):
    for _ in range(3):
        render, photo = make_patches(kind, contrast, rng)
        costs = brute_force(render, photo, whole())
        wanted = min(costs, key=costs.get)
        found = align(render, photo, whole())
        assert float(found.cost) == pytest.approx(costs[wanted], rel=1e-5)
        offset = tuple(found.offset_px.tolist())
        assert costs[offset] <= (1 + 1e-5) * costs[wanted]
        if kind == "constant":
            assert offset == wanted == (0, 0)
        x, y = np.array(offset) + RADIUS
        np.testing.assert_array_equal(found.patch, photo[y : y + SIZE, x : x + SIZE])
        loss = float(loss_of(render, photo, whole()))
        assert loss == pytest.approx(costs[wanted], rel=1e-5)


@pytest.mark.parametrize("offset", [0.0, 0.5, 100.0])
@pytest.mark.parametrize("contrast", [1e-4, 1e-2, 1.0, 1e4])
def test_the_offset_of_random_patches_is_the_twins(rng, offset, contrast):
    for _ in range(5):
        # Half an ulp of 100 is 4e-6: what contrast is left, both see alike.
        render, photo = float32(
            offset + contrast * rng.uniform(size=(12, 12, 3)),
            offset + contrast * rng.uniform(size=(20, 20, 3)),
        )
        valid = whole(20)
        valid[:, : rng.integers(0, 4)] = 0
        costs = brute_force(render, photo, valid, 0.0)
        found = align(render, photo, valid, penalty=0.0)
        wanted = min(costs, key=costs.get)
        assert float(found.cost) == pytest.approx(costs[wanted], rel=1e-5)
        assert tuple(found.offset_px.tolist()) == wanted


@pytest.mark.parametrize(("dx", "dy"), [(3, -2), (-4, 0), (0, 4), (1, 1), (0, 0)])
def test_a_known_shift_is_found(rng, dx, dy):
    big = ndimage.gaussian_filter(rng.uniform(size=(60, 60, 3)), (1, 1, 0))
    photo = big[10:42, 10:42]
    render = big[10 + 4 + dy : 10 + 4 + dy + 24, 10 + 4 + dx : 10 + 4 + dx + 24]
    found = align(*float32(render, photo), whole(32))
    assert found.offset_px.tolist() == [dx, dy]
    np.testing.assert_allclose(found.patch, render, atol=1e-6)


@pytest.mark.parametrize(
    ("shift", "wanted"), [(0, 0), (1, 1), (2, 2), (3, -2), (4, -1)]
)
def test_ties_go_to_the_smallest_offset(rng, shift, wanted):
    """A photo that repeats every 5 px fits at every fifth offset equally well."""
    photo = np.tile(rng.uniform(size=(AROUND, 5, 3)), (1, 10, 1))[:, :AROUND]
    render = photo[RADIUS:-RADIUS, RADIUS + shift : RADIUS + shift + SIZE]
    found = align(*float32(render, photo), whole(), penalty=0.0)
    assert found.offset_px.tolist() == [wanted, 0]


def test_pixels_that_do_not_exist_are_never_read(rng):
    render, photo = float32(rng.uniform(size=(8, 8, 3)), rng.uniform(size=(12, 12, 3)))
    photo[2:10, 0:8] = render
    assert align(render, photo, whole(12)).offset_px.tolist() == [-2, 0]
    valid = whole(12)
    valid[:, :2] = 0
    photo[:, :2] = np.nan
    costs = brute_force(render, photo, valid)
    found = align(render, photo, valid)
    assert tuple(found.offset_px.tolist()) == min(costs, key=costs.get)
    assert found.offset_px[0] >= 0
    assert np.all(np.isfinite(found.patch))


@pytest.mark.parametrize("share", [0.02, 0.5, 0.98])
def test_holes_of_a_mask_are_left_out(rng, share):
    gradient = jax.jit(jax.grad(loss_of))
    for _ in range(5):
        render, photo = float32(
            rng.uniform(size=(12, 12, 3)), rng.uniform(size=(18, 18, 3))
        )
        valid = np.float32(rng.uniform(size=(18, 18)) < share)
        photo[valid == 0] = np.nan
        costs = brute_force(render, photo, valid)
        found = jax.tree.map(np.asarray, align(render, photo, valid))
        x, y = offset = tuple(found.offset_px.tolist())
        assert costs[offset] == min(costs.values())
        assert float(found.cost) == pytest.approx(costs[offset], rel=1e-5, abs=1e-12)
        part = np.s_[3 + y : 15 + y, 3 + x : 15 + x]
        seen = valid[part] > 0
        np.testing.assert_array_equal(found.patch[seen], photo[part][seen])
        np.testing.assert_array_equal(found.patch[~seen], render[~seen])
        loss = float(loss_of(render, photo, valid))
        assert loss == pytest.approx(costs[offset], rel=1e-5, abs=1e-12)
        slope = np.asarray(gradient(render, photo, valid))
        scale = (valid[3:15, 3:15] > 0).sum() / max(seen.sum(), 1)
        wanted = 2 * scale * (render - photo[part])[seen]
        np.testing.assert_allclose(slope[seen], wanted, rtol=1e-5, atol=1e-6)
        assert not slope[~seen].any()


def test_without_any_pixel_there_is_no_loss_and_no_gradient(rng):
    render = np.float32(rng.uniform(size=(8, 8, 3)))
    photo, valid = np.full((12, 12, 3), np.nan, np.float32), 0 * whole(12)
    assert align(render, photo, valid).offset_px.tolist() == [0, 0]
    value, slope = jax.jit(jax.value_and_grad(loss_of))(render, photo, valid)
    assert value == 0
    assert not np.any(slope)


@pytest.mark.parametrize("contrast", [1e-4, 1.0, 1e4])
def test_the_gradient_is_that_of_the_best_patch_and_of_the_render_alone(rng, contrast):
    render, photo = make_patches("noisy", contrast, rng)
    best = np.float64(align(render, photo, whole()).patch)
    both = jax.jit(jax.grad(loss_of, argnums=(0, 1)))
    of_render, of_photo = both(render, photo, whole())
    scale = contrast * 1e-6
    np.testing.assert_allclose(of_render, 2 * (render - best), rtol=1e-5, atol=scale)
    assert not np.any(of_photo)
    of_search = jax.grad(lambda r: jnp.sum(align(r, photo, whole()).patch))
    assert not np.any(jax.jit(of_search)(render))


def test_sizes_that_leave_no_offset_are_refused(rng):
    for around in (7, 9):
        parts = float32(np.ones((8, 8, 3)), np.ones((around, around, 3)))
        with pytest.raises(ValueError, match=f"{around} px of photo"):
            align(*parts, whole(around))
