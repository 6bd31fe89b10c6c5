"""Patch convolution and high-frequency loss, against slow twins and at the extremes."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import ndimage

from alignerf.contributions import frequency_loss, patch_conv
from alignerf.experiment import jobs
from alignerf.fields import shading
from alignerf.methods.staged import Finetuning
from alignerf.networks import convnet
from alignerf.training import compose
from tools.bench import cases

# Patch convolution


HEAD = patch_conv.PatchConv()


def feature_image(rng, features=6, size=(20, 17)):
    low, high = -shading.PADDING, 1 + shading.PADDING
    return np.float32(rng.uniform(low, high, (*size, features)))


def test_patch_convolution_starts_as_the_identity_on_colour(rng):
    f = feature_image(rng)
    f[0, 0], f[5, 5] = -shading.PADDING, 1 + shading.PADDING
    rgb = jax.jit(HEAD.apply)(jax.jit(HEAD.init)(jax.random.key(0), f), f)
    np.testing.assert_allclose(rgb, f[..., :3], atol=1e-5)


def test_patch_convolution_learns_from_all_features(rng):
    f = feature_image(rng)
    params = jax.jit(HEAD.init)(jax.random.key(0), f)

    def first_step(params):
        return jnp.sum(HEAD.apply(params, f) ** 2)

    grads = jax.jit(jax.grad(first_step))(params)
    params = jax.tree.map(lambda p, g: np.asarray(p) - 1e-3 * g, params, grads)
    to_features = jax.jit(jax.grad(lambda f: jnp.sum(HEAD.apply(params, f))))(f)
    assert np.all(np.abs(to_features).max(axis=(0, 1)) > 0)


def test_patch_convolution_equals_scipy_with_mirrored_borders(rng):
    f = feature_image(rng, features=4, size=(9, 11))
    params = jax.jit(HEAD.init)(jax.random.key(3), f)
    params = jax.tree.map(
        lambda p: np.float32(p + 0.1 * rng.normal(size=p.shape)), params
    )
    x = np.pad(np.asarray(f, np.float64), ((3, 3), (3, 3), (0, 0)), mode="reflect")
    for layer in range(3):
        kernel = np.asarray(params["params"][f"Conv_{layer}"]["kernel"], np.float64)
        bias = np.asarray(params["params"][f"Conv_{layer}"]["bias"], np.float64)
        x = np.stack(
            [
                sum(
                    ndimage.correlate(x[..., i], kernel[..., i, o], mode="constant")
                    for i in range(4)
                )[1:-1, 1:-1]
                for o in range(4)
            ],
            axis=-1,
        )
        x = np.maximum(x + bias, 0)
    dense = params["params"]["Dense_0"]
    wanted = x @ np.asarray(dense["kernel"]) + np.asarray(dense["bias"])
    np.testing.assert_allclose(jax.jit(HEAD.apply)(params, f), wanted, atol=1e-4)


def test_patch_convolution_refuses_what_cannot_be_reflected(rng):
    with pytest.raises(ValueError, match="too small"):
        HEAD.init(jax.random.key(0), feature_image(rng, size=(3, 9)))


def test_published_size_of_the_contribution():
    """+0.5M at N = 128: three convolutions, the linear layer, a wider last layer."""
    chosen = dict.fromkeys(Finetuning.model_fields, 1) | {
        "learning_rates": [0.002, 0.00002],
        "patch_px": 32,
        "convolution": True,
        "features": 128,
        "frequency_weights": None,
    }
    training = cases.TRAINING | {"steps": 1, "batch_rays": 1}
    own = {"pretrain": {"pretrain_fraction": 0.6}, "finetune": {"alignerf": chosen}}
    sizes = {}
    for stage, keys in own.items():
        job = {"seed": 0, "stage": stage, "model": cases.PUBLISHED} | keys
        job |= {"training": training}
        method = compose.make_method(jobs.parse(job))
        shapes = jax.eval_shape(method.init, jax.random.key(0))
        sizes[stage] = sum(np.prod(leaf.shape) for leaf in jax.tree.leaves(shapes))
    assert sizes["pretrain"] == 9_007_493
    assert sizes["finetune"] - sizes["pretrain"] == 459_264


# High-frequency loss

of_the_bank = jax.jit(
    functools.partial(frequency_loss.frequency_loss, frequency_loss.bank_features)
)


def test_bank_is_blind_to_brightness_and_sees_edges(rng):
    features = jax.jit(frequency_loss.bank_features)
    flat = np.full((1, 16, 16, 3), 0.7, np.float32)
    # At the borders of a patch too, which are most of it.
    np.testing.assert_allclose(features(flat), 0.0, atol=1e-6)
    flat[:, :, 8:] = 0.2
    assert np.abs(features(flat)).max() > 0.1


def test_the_loss_of_the_bank_equals_a_float64_twin(rng):
    photo, render = rng.uniform(size=(2, 3, 14, 11, 3))
    found = of_the_bank(*np.float32([photo, render]))
    kernels = [
        frequency_loss.derivative_kernel(sigma, np.pi * k / 4)
        for sigma in (0.7, 1.4)
        for k in range(4)
    ]
    assert [np.abs(kernel).sum() for kernel in kernels] == pytest.approx([1.0] * 8)
    # The derivative of a ramp along x, and none across it.
    ramp = np.tile(np.arange(30.0), (30, 1))
    along, across = (ndimage.correlate(ramp, kernels[k])[15, 15] for k in (4, 6))
    assert along > 0.5
    assert across == pytest.approx(0.0, abs=1e-12)
    squares = [
        ndimage.correlate(image, kernel, mode="nearest") ** 2
        for images in photo - render
        for image in np.moveaxis(images, -1, 0)
        for kernel in kernels
    ]
    assert float(found) == pytest.approx(np.mean(squares), rel=1e-5)


def test_frequency_loss_prefers_the_sharper_render(rng):
    photo = rng.uniform(size=(1, 24, 24, 3))
    renders = [
        ndimage.gaussian_filter(photo, (0, s, s, 0)) for s in (0.0, 0.5, 1.0, 2.0)
    ]
    found = [float(of_the_bank(*np.float32([photo, r]))) for r in renders]
    assert found[0] == 0
    assert found == sorted(found)


def test_vgg_features_equal_a_float64_twin(shared_data, rng):
    path = shared_data / "weights" / "vgg19_block1.npz"
    rgb = rng.uniform(size=(1, 10, 12, 3))
    with np.load(path) as stored:
        w = {key: stored[key].astype(np.float64) for key in stored}
    x = (rgb[0] - w["mean"]) / w["std"]
    for layer in ("conv1_1", "conv1_2"):
        padded = np.pad(x, ((1, 1), (1, 1), (0, 0)))
        windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(0, 1))
        x = np.einsum("hwcij,ijco->hwo", windows, w[f"{layer}_w"]) + w[f"{layer}_b"]
        x = np.maximum(x, 0)
    found = jax.jit(convnet.vgg19_features(path))(jnp.asarray(rgb, jnp.float32))
    np.testing.assert_allclose(found[0], x, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("content", [None, b"", b"no archive", "other"])
def test_bad_weights_are_named(tmp_path, content):
    path = tmp_path / "vgg.npz"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content:
        np.savez(path, something=np.zeros(3))
    with pytest.raises(ValueError, match=r"vgg\.npz"):
        convnet.vgg19_features(path)
