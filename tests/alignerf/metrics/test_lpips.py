"""LPIPS: published values, and each network against a slow float64 twin."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from alignerf.metrics import lpips
from alignerf.networks import backbones

DISTANCE = jax.jit(lpips.distance, static_argnums=0)


def of_alex(shared_data):
    return lpips.read("alex", shared_data / "weights" / "lpips_alex_v0.1.npz")


def distance(net, weights, *images):
    pair = [jnp.asarray(image[None], jnp.float32) for image in images]
    return float(DISTANCE(net, weights, *pair)[0])


@pytest.mark.parametrize(("image", "published"), [("ex_p0", 0.7219), ("ex_p1", 0.1376)])
def test_the_published_values(shared_data, image, published):
    weights = of_alex(shared_data)
    pair = [
        np.asarray(Image.open(shared_data / "weights" / f"{name}.png")) / 255.0
        for name in ("ex_ref", image)
    ]
    assert distance("alex", weights, *pair) == pytest.approx(published, abs=5e-5)


def convolve_twin(w, x, name, *, stride=1, padding=0):
    """ReLU of a convolution of x [h, w, c] by its sum over windows."""
    kernel = w[f"{name}_w"]
    x = np.pad(x, [(padding, padding)] * 2 + [(0, 0)])
    windows = np.lib.stride_tricks.sliding_window_view(x, kernel.shape[:2], (0, 1))
    x = np.einsum("hwcij,ijco->hwo", windows[::stride, ::stride], kernel, optimize=True)
    return np.maximum(x + w[f"{name}_b"], 0)


def pool_twin(x, size):
    """Maximum over each window of stride 2."""
    windows = np.lib.stride_tricks.sliding_window_view(x, (size, size), (0, 1))
    return windows[::2, ::2].max((-2, -1))


def alex_twin(w, x):
    x1 = convolve_twin(w, x, "conv1", stride=4, padding=2)
    x2 = convolve_twin(w, pool_twin(x1, 3), "conv2", padding=2)
    x3 = convolve_twin(w, pool_twin(x2, 3), "conv3", padding=1)
    x4 = convolve_twin(w, x3, "conv4", padding=1)
    return x1, x2, x3, x4, convolve_twin(w, x4, "conv5", padding=1)


def vgg_twin(w, x):
    taps = []
    for block, count in enumerate((2, 2, 3, 3, 3), start=1):
        x = pool_twin(x, 2) if taps else x
        for i in range(1, count + 1):
            x = convolve_twin(w, x, f"conv{block}_{i}", padding=1)
        taps.append(x)
    return taps


TWINS = {"alex": alex_twin, "vgg": vgg_twin}


def lpips_twin(net, weights, *images):
    """The equation, term by term, in float64."""
    w = {name: np.asarray(array, np.float64) for name, array in weights.items()}
    shift, scale = [-0.030, -0.088, -0.188], [0.458, 0.448, 0.450]
    pair = [TWINS[net](w, (2 * x - 1 - shift) / scale) for x in images]
    total = 0.0
    for k, taps in enumerate(zip(*pair, strict=True)):
        a, b = (x / (np.linalg.norm(x, axis=-1, keepdims=True) + 1e-10) for x in taps)
        total += ((a - b) ** 2 @ w[f"lin{k}"]).mean()
    return total


def random_weights(net, rng):
    """He-normal kernels, small biases, positive heads."""
    weights = {}
    for name, shape in backbones.shapes(net).items():
        sigma = np.sqrt(2 / np.prod(shape[:-1])) if len(shape) > 1 else 0.1
        array = rng.normal(size=shape) * sigma
        weights[name] = np.abs(array) if name.startswith("lin") else array
    return {name: jnp.asarray(a, jnp.float32) for name, a in weights.items()}


@pytest.mark.parametrize(
    "size", [pytest.param((53, 66), marks=pytest.mark.whole), (31, 31)]
)
@pytest.mark.parametrize("net", backbones.NETS)
def test_a_network_equals_its_twin(net, size, rng, shared_data):
    weights = of_alex(shared_data) if net == "alex" else random_weights(net, rng)
    pair = rng.uniform(size=(2, *size, 3)).astype(np.float32)
    found = distance(net, weights, *pair)
    assert found == pytest.approx(lpips_twin(net, weights, *pair), rel=1e-4)


def test_it_is_a_distance_that_grows_with_distortion(shared_data, rng):
    net, weights = "alex", of_alex(shared_data)
    image = ndimage.gaussian_filter(rng.uniform(size=(64, 64, 3)), (1, 1, 0))
    blurred = [ndimage.gaussian_filter(image, (s, s, 0)) for s in (0, 1, 2, 4)]
    found = [distance(net, weights, image, b) for b in blurred]
    assert found[0] < 1e-12
    assert found == sorted(found)
    assert found[-1] > 0.2
    other = distance(net, weights, blurred[2], image)
    assert other == pytest.approx(found[2], rel=1e-5)


@pytest.mark.parametrize("net", backbones.NETS)
def test_images_too_small_are_refused(net, rng):
    arrays = {
        name: jax.ShapeDtypeStruct(shape, jnp.float32)
        for name, shape in backbones.shapes(net).items()
    }

    def min_side(height):
        rgb = jax.ShapeDtypeStruct((1, height, 99, 3), jnp.float32)
        taps = jax.eval_shape(
            lambda w, x: list(backbones.NETS[net].taps(w, x)), arrays, rgb
        )
        return min(tap.shape[1] for tap in taps)

    smallest = backbones.NETS[net].smallest_px
    assert (min_side(smallest - 1), min_side(smallest)) == (0, 1)
    pair = rng.uniform(size=(2, smallest - 1, 99, 3))
    with pytest.raises(ValueError, match=f"under {smallest} pixels"):
        distance(net, {}, *pair)


@pytest.mark.parametrize("net", backbones.NETS)
def test_other_weights_are_refused_by_name(net, tmp_path):
    whole = {
        name: np.zeros(shape, "f4") for name, shape in backbones.shapes(net).items()
    }
    path = tmp_path / "net.npz"

    def refused(arrays, reason):
        np.savez(path, **arrays)
        with pytest.raises(ValueError, match=rf"net\.npz: .*{reason}"):
            lpips.read(net, path)

    refused({k: v for k, v in whole.items() if k != "lin3"}, "lin3")
    refused(whole | {"lin0": np.zeros((1, 64), "f4")}, r"lin0 is \(1, 64\) instead of")
    refused(whole | {"lin1": whole["lin1"] + np.inf}, "lin1 is not of finite")
    refused(whole | {"lin1": whole["lin1"].astype("U9")}, "lin1 is not of finite")
