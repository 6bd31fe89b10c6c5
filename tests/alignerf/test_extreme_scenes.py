"""The whole model where scenes are extreme, and in bfloat16."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf import fields
from alignerf.mipnerf360 import coord
from alignerf.mipnerf360 import model as mipnerf360
from alignerf.scenes import cameras
from alignerf.training import batches, methods, renderer
from tests import twins

SMALL = {
    "grid": {"levels": 2, "log2_hashmap_size": 8, "max_resolution": 32, "width": 16},
    "mlp": {"width": 16, "depth": 6, "bottleneck": 8, "view_width": 16},
}


def baseline(kind, precision="float32"):
    options = SMALL[kind] | {"precision": precision}
    model = mipnerf360.Model(
        proposal=fields.make(kind, **options),
        field=fields.make(kind, **options),
        samples=(8, 4),
        near=0.2,
        far=1e6,
    )
    weights = methods.LossWeights(interlevel=1.0, distortion=0.01)
    return methods.mipnerf360(model, batch_rays=64, loss_weights=weights)


def scene(photos):
    """Views of these photos [n, h, w, 3], side by side, on a circle."""
    n, height, width, _ = photos.shape
    angle = 2 * np.pi * np.arange(n) / n
    poses = np.zeros((n, 3, 4))
    poses[:, [0, 2], [0, 2]] = np.cos(angle)[:, None]
    poses[:, 1, 1] = 1
    poses[:, 0, 2], poses[:, 2, 0] = np.sin(angle), -np.sin(angle)
    poses[:, :, 3] = poses[:, :, 2]
    pixtocams = np.repeat(cameras.intrinsics(30.0, width, height)[None], n, axis=0)
    return batches.Views(
        photos=jnp.asarray(photos, jnp.uint8),
        valid=batches.all_valid(n, height, width),
        pixtocams=jnp.asarray(pixtocams, jnp.float32),
        camtoworlds=jnp.asarray(poses, jnp.float32),
    )


def parameters(init, *arguments):
    """Small random ones: compiling an initialisation takes seconds."""
    rng = np.random.default_rng(1)
    return jax.tree.map(
        lambda leaf: jnp.asarray(0.3 * rng.normal(size=leaf.shape), jnp.float32),
        jax.eval_shape(init, jax.random.key(1), *arguments),
    )


def loss(params, batch, share, method):
    terms, _ = method.terms(params, batch, share)
    return sum(terms.values())


@pytest.fixture(scope="module")
def learner():
    """A method, its parameters and its gradient, compiled once for all scenes."""
    method = baseline("mlp")
    gradient = jax.jit(jax.value_and_grad(loss), static_argnums=3)
    return method, parameters(method.init), gradient


SCENES = {
    "one black view": np.zeros((1, 9, 9, 3)),
    "white views": np.full((2, 9, 9, 3), 255),
    "columns": np.full((2, 9, 1, 3), 99),
    "rows": np.full((2, 1, 9, 3), 99),
    "1e5 views of one pixel": np.full((100_000, 1, 1, 3), 255),
}


@pytest.mark.parametrize("photos", SCENES.values(), ids=SCENES.keys())
def test_loss_and_gradient(learner, photos):
    method, params, gradient = learner
    batch = jax.jit(method.draw)(jax.random.key(0), 0, scene(photos))
    np.testing.assert_allclose(batch.photo, photos.max() / 255, rtol=1e-6)
    length = np.linalg.norm(batch.rays.viewdirs, axis=-1)
    np.testing.assert_allclose(length, 1.0, rtol=1e-6)
    for share in (0.0, 0.5):
        value, grads = gradient(params, batch, share, method)
        leaves = list(map(np.asarray, jax.tree.leaves(grads)))
        assert np.isfinite(value)
        assert all(np.all(np.isfinite(leaf)) for leaf in leaves)
        assert any(np.any(leaf != 0) for leaf in leaves)


@pytest.mark.parametrize(("width", "height"), [(1, 7), (7, 1), (1, 1), (3, 2)])
def test_images_one_pixel_wide_are_rendered(width, height):
    """By a method whose colour tells where a ray goes."""

    def render(params, rays):
        values = (rays.viewdirs + 1) / 2
        return mipnerf360.Rendering(values, rays.radii[:, 0], [])

    unused = methods.Method(1, None, None, None, render, lambda params, values: values)
    pixtocam, pose = cameras.intrinsics(2.0, width, height), np.eye(4)[:3]
    render_view = renderer.make_renderer(unused, {}, width, height)
    image, depth = render_view(pixtocam, pose)
    y, x = np.indices((height, width))
    rays = cameras.pixels_to_rays(x, y, pixtocam, pose)
    wanted = rays.viewdirs
    assert image.shape == (height, width, 3)
    np.testing.assert_allclose(image, (wanted + 1) / 2 * 255, atol=0.51)
    assert depth.dtype == np.float32
    np.testing.assert_allclose(depth, rays.radii[..., 0], rtol=1e-5)


def equations(jaxpr):
    """All equations of a program, those of the functions it calls included."""
    for equation in jaxpr.eqns:
        yield equation
        for value in jax.tree.leaves(
            list(equation.params.values()), is_leaf=lambda v: hasattr(v, "eqns")
        ):
            inner = getattr(value, "jaxpr", value)
            if hasattr(inner, "eqns"):
                yield from equations(inner)


@pytest.mark.parametrize("kind", ["grid", "mlp"])
def test_bfloat16_is_that_of_the_layers_products(kind):
    """Nothing else is rounded, on any device.

    Positions, encodings, densities and weights are sums and phases: the eight bits
    of bfloat16 are two radians at degree 8 and twenty at degree 11.
    """
    method = baseline(kind, "bfloat16")
    batch = jax.eval_shape(
        method.draw, jax.random.key(0), 0, scene(SCENES["white views"])
    )
    params = jax.eval_shape(method.init, jax.random.key(1))
    gradient = jax.value_and_grad(functools.partial(loss, method=method))
    program = jax.make_jaxpr(gradient)(params, batch, 1.0)
    rounded = set()
    for equation in equations(program.jaxpr):
        name = equation.primitive.name
        types = {v.aval.dtype.name for v in equation.invars if hasattr(v.aval, "dtype")}
        if name == "dot_general" and "float32" in types:
            # Of what is left in float32 a GPU would keep 11 bits by default.
            highest = jax.lax.Precision.HIGHEST
            assert equation.params["precision"] == (highest, highest)
        if "bfloat16" in types:
            rounded.add(name)
    assert "dot_general" in rounded
    phases_and_sums = {
        "sin",
        "cos",
        "exp",
        "log",
        "sqrt",
        "round",
        "cumsum",
        "logistic",
    }
    assert not rounded & phases_and_sums


@pytest.mark.parametrize("kind", ["grid", "mlp"])
def test_bfloat16_is_near_float32(kind):
    mean, direction = np.random.default_rng(0).normal(size=(2, 50, 4, 3))
    viewdirs = direction[:, 0] / np.linalg.norm(direction[:, 0], axis=-1, keepdims=True)
    std = np.full((50, 4), 0.01)
    mean, direction, std, viewdirs = twins.f32(mean, direction, std, viewdirs)
    gaussians = coord.Gaussians(mean, direction, std, std)
    field, exact = (
        fields.make(kind, **SMALL[kind], precision=precision)
        for precision in ("bfloat16", "float32")
    )
    params = parameters(exact.init, gaussians, viewdirs)
    found, wanted = jax.jit(
        lambda *given: [f.apply(params, *given) for f in (field, exact)]
    )(gaussians, viewdirs)
    for value, precise in zip(found, wanted, strict=True):
        assert value.dtype == jnp.float32
        # Products of 8 bits, through a handful of layers.
        np.testing.assert_allclose(value, precise, atol=0.03 * np.abs(precise).max())
        assert np.any(np.asarray(value) != precise)
