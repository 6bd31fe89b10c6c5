"""Fields: sizes as published, hash grid against a slow twin, extremes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf import fields
from alignerf.fields import grid, nerf, shading
from alignerf.mipnerf360 import coord, model
from alignerf.scenes import cameras
from tests import twins


def gaussians(count=5, scale=1.0):
    mean, direction = np.random.default_rng(0).normal(size=(2, count, 7, 3))
    std = np.full((count, 7), 0.01)
    return coord.Gaussians(*twins.f32(scale * mean, direction, std, std))


def parameters(module, *args):
    shapes = jax.eval_shape(module.init, jax.random.key(0), *args)
    return sum(np.prod(leaf.shape) for leaf in jax.tree.leaves(shapes))


@pytest.mark.parametrize(("width", "count"), [(1024, 9_007_493), (4096, 123_018_629)])
def test_published_parameter_counts(width, count):
    published = model.Model(
        proposal=fields.make("mlp", width=256, depth=4),
        field=fields.make("mlp", width=width, depth=8),
        samples=(64, 64, 32),
        near=0.2,
        far=1e6,
    )
    ones = jnp.ones((2, 3))
    assert parameters(published, cameras.Rays(ones, ones, ones, ones[:, :1])) == count


def test_barfs_parameter_count():
    """530,052, and six for each view beside them."""
    barf = model.Model(
        proposal=None, field=fields.make("nerf"), samples=(128,), near=0.2, far=4.0
    )
    ones = jnp.ones((2, 3))
    assert parameters(barf, cameras.Rays(ones, ones, ones, ones[:, :1])) == 530_052


def test_barfs_encoding_is_its_formula(rng):
    """Eqs. 3 and 14 of arXiv 2104.06405, number by number."""
    x, degrees = rng.uniform(-1, 1, size=(3, 4)).astype(np.float32), 5
    encode = jax.jit(nerf.encode, static_argnums=1)
    for fineness, alpha in (
        (0.0, 0.0),
        (0.5, 2.5),
        (0.7, 3.5),
        (1.0, 5.0),
        (None, 5.0),
    ):
        found = np.asarray(encode(jnp.asarray(x), degrees, fineness))
        assert found.shape == (3 + 6 * degrees, 4)
        np.testing.assert_array_equal(found[:3], x)
        for place, wave in enumerate((np.sin, np.cos)):
            for k in range(degrees):
                weight = (1 - np.cos(np.pi * min(max(alpha - k, 0), 1))) / 2
                start = 3 + (place * degrees + k) * 3
                wanted = weight * wave(2.0**k * np.pi * x.astype(np.float64))
                np.testing.assert_allclose(found[start : start + 3], wanted, atol=2e-5)


@pytest.fixture
def levels():
    return grid.Levels.geometric(4, 4, 60, 2**9)


def test_look_up_equals_the_slow_twin(rng, levels):
    table = rng.normal(size=(sum(levels.entries), 2))
    points = rng.uniform(0, 1, size=(3, 300))
    points[:, 0], points[:, 1], points[:, 2] = 0.0, 1.0, 0.5
    look_up = jax.jit(grid.look_up, static_argnums=2)
    found = look_up(*twins.f32(table, points), levels)
    wanted = [twins.look_up(table, point, levels) for point in points.T.astype("f4")]
    np.testing.assert_allclose(found, np.stack(wanted, axis=1), atol=2e-4)


def test_moving_points_have_the_slope_of_finite_differences(rng, levels):
    """In a cell the look-up is linear along each axis: differences are exact."""
    table = rng.normal(size=(sum(levels.entries), 3)).astype("f4")
    points = rng.uniform(0.02, 0.98, size=(3, 200))
    step = 1e-4
    # Both ends of a difference lie in one cell of every level.
    faces = points[None] * np.array(levels.resolutions)[:, None, None] % 1
    sides = np.array(levels.resolutions)[:, None, None] * step
    inside = ((faces > 2 * sides) & (faces < 1 - 2 * sides)).all(axis=(0, 1))
    points = points[:, inside]
    assert points.shape[1] > 50
    weights = rng.normal(size=(len(levels.resolutions), points.shape[1], 3))

    def value(points):
        found = [twins.look_up(table, point, levels) for point in points.T]
        return (np.stack(found, axis=1) * weights).sum(axis=(0, 2))

    def loss(table, points, moving):
        found = grid.look_up(table, points, levels, moving)
        return jnp.sum(found * weights.astype("f4"))

    arguments = twins.f32(table, points)
    slopes = jax.jit(jax.grad(loss, argnums=(0, 1)), static_argnums=2)
    both = slopes(*arguments, True)
    for axis in range(3):
        shift = np.zeros((3, 1))
        shift[axis] = step
        wanted = (value(points + shift) - value(points - shift)) / (2 * step)
        scale = np.abs(wanted).max()
        np.testing.assert_allclose(both[1][axis], wanted, atol=1e-4 * scale)
    # The table's gradient is the same, and points at rest have none.
    still = slopes(*arguments, False)
    np.testing.assert_array_equal(both[0], still[0])
    assert not np.any(still[1])


def test_look_ups_gradient_is_its_transpose(rng, levels):
    table, other = rng.normal(size=(2, sum(levels.entries), 2)).astype("f4")
    points = jnp.asarray(rng.uniform(size=(3, 200)), jnp.float32)
    look_up = jax.jit(lambda table: grid.look_up(table, points, levels))
    out, pull = jax.vjp(look_up, jnp.asarray(table))
    cotangent = jnp.asarray(rng.normal(size=out.shape), jnp.float32)
    # <look_up(other), c> = <other, look_up^T(c)> for every c, as it is linear.
    left = np.vdot(look_up(jnp.asarray(other)), cotangent)
    right = np.vdot(other, pull(cotangent)[0])
    assert left == pytest.approx(right, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("moving", [False, True])
def test_an_accelerator_adds_up_the_gradient_of_a_grid(rng, levels, moving, both_ways):
    """In one scatter; all corners of points at one place are the same rows."""
    points = rng.random((3, 40))
    points[:, :9], points[:, 9] = 0.5, 1.0
    table = rng.normal(size=(sum(levels.entries), 2))
    weights = rng.normal(size=(len(levels.entries), 40, 2)) * 10 ** rng.uniform(-20, 20)

    def pull(table, points, weights):
        look_up = lambda *given: grid.look_up(*given, levels, moving)  # noqa: E731
        return jax.vjp(look_up, table, points)[1](weights)

    found = both_ways(pull, *twins.f32(table, points, weights))
    for wanted, grad in zip(*found, strict=True):
        twins.assert_close(grad, wanted, scale=np.abs(wanted).max())


class OneLayer(shading.nn.Module):
    """A layer on what points have, and on what their rays do."""

    precision: str

    @shading.nn.compact
    def __call__(self, *inputs):
        return shading.Dense(5, self.precision)(*inputs)


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (0, 2, 1), (1,)])
def test_a_layer_has_one_product_or_several(rng, precision, order, both_ways):
    inputs = [rng.normal(size=shape) for shape in [(4, 6), (3, 6), (2, 2)]]
    inputs = twins.f32(*(inputs[which] for which in order))
    layer = OneLayer(precision)
    kernel = rng.normal(size=(5, sum(map(len, inputs))))
    params = dict(zip(["kernel", "bias"], twins.f32(kernel, np.ones(5)), strict=True))
    weights = twins.f32(rng.normal(size=(5, 6)))[0]

    def pull(params, *inputs):
        given = {"params": {"Dense_0": params}}
        value, back = jax.vjp(lambda p, *x: layer.apply(p, *x), given, *inputs)
        return value, back(weights)

    found = map(jax.tree.leaves, both_ways(pull, params, *inputs))
    for several, one in zip(*found, strict=True):
        assert one.dtype == several.dtype == jnp.float32
        twins.assert_close(one, several, scale=np.abs(several).max())


def test_gradients_by_bfloat16_are_summed_in_float32():
    """257 has no bfloat16: neither has the sum of so many points, or channels."""
    kernel, x = jnp.ones((257, 1)), jnp.ones((1, 257))
    layer = jax.jit(lambda kernel, x: shading.product(kernel, x, "bfloat16"))
    value, back = jax.vjp(layer, kernel, x)
    assert value.dtype == jnp.float32
    np.testing.assert_array_equal(back(jnp.ones((257, 257)))[0], 257.0)
    np.testing.assert_array_equal(layer(x, kernel), 257.0)


@pytest.mark.parametrize("kind", ["grid", "mlp"])
def test_fields_give_finite_values_and_gradients(kind):
    small = {
        "grid": {"levels": 3, "log2_hashmap_size": 8, "max_resolution": 64},
        "mlp": {"width": 8},
    }
    field = fields.make(kind, **small[kind])
    (viewdirs,) = twins.f32(np.full((5, 3), 3**-0.5))
    params = jax.jit(field.init)(jax.random.key(0), gaussians(), viewdirs)

    @jax.jit
    @jax.value_and_grad
    def total(params, g):
        density, values = field.apply(params, g, viewdirs)
        assert density.shape == (5, 7)
        assert values.shape == (3, 5, 7)
        return jnp.sum(density) + jnp.sum(values)

    for scale in (0.0, 1.0, 1e18):
        value, grads = total(params, gaussians(scale=scale))
        assert np.isfinite(value)
        assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(grads))


def test_a_gaussian_larger_than_all_cells_sees_nothing_of_the_grid():
    field = fields.make("grid", levels=3, log2_hashmap_size=8, max_resolution=64)
    g = gaussians(scale=0.3)
    params = jax.jit(field.init)(jax.random.key(0), g, None)
    blurred = g._replace(t_std=g.t_std * 1e5, r_std=g.r_std * 1e5)
    density, _ = jax.jit(field.apply)(params, blurred, None)
    assert np.std(density) < 1e-7


def test_an_aliased_grid_sees_the_middle_of_a_gaussian_however_large():
    found = {}
    for anti_aliased in (True, False):
        field = fields.make(
            "grid",
            levels=3,
            log2_hashmap_size=8,
            max_resolution=64,
            anti_aliased=anti_aliased,
        )
        g = gaussians(scale=0.3)
        params = jax.jit(field.init)(jax.random.key(0), g, None)
        # Features that differ, where an untrained table has hardly any.
        params = jax.tree.map(lambda leaf: 100 * leaf, params)
        apply = jax.jit(field.apply)
        for times in (1e-4, 10.0):
            sized = g._replace(t_std=g.t_std * times, r_std=g.r_std * times)
            density, _ = apply(params, sized, None)
            found[anti_aliased, times] = np.asarray(density)
    np.testing.assert_array_equal(found[False, 1e-4], found[False, 10.0])
    # A point is the same to both, a large Gaussian is not.
    np.testing.assert_array_equal(found[True, 1e-4], found[False, 1e-4])
    assert np.abs(found[True, 10.0] - found[False, 10.0]).max() > 0.01


def test_unknown_kind_or_option_is_named():
    with pytest.raises(ValueError, match="octree"):
        fields.make("octree")
    with pytest.raises(ValueError, match="depht"):
        fields.make("mlp", depht=3)
