"""Released code of mip-NeRF, NeRF++ and BARF beside ours, with the same parameters.

ALIGNERF_MIPNERF names a checkout of google/mipnerf, ALIGNERF_NERFPLUSPLUS one of
Kai-46/nerfplusplus, ALIGNERF_BARF one of chenhsuanlin/bundle-adjusting-NeRF. The last
two need PyTorch beside our environment. What is not named is skipped. Both sides run
in float32.
"""

import contextlib
import importlib
import itertools
import os
import pathlib
import sys
import types
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf import fields
from alignerf.fields import shading
from alignerf.mipnerf360 import coord
from alignerf.scenes import cameras
from alignerf.training import compose
from tests import training_cases as cases

pytestmark = pytest.mark.filterwarnings("ignore")
RAYS = 60


def checkout(variable):
    """The folder that an environment variable names."""
    if not (path := os.environ.get(variable)):
        pytest.skip(f"no checkout of the released code (set {variable})")
    return pathlib.Path(path).resolve()


# Top-level names of what these checkouts import from themselves, and of stand-ins.
OF_PEERS = {"internal", "gin", "utils", "ddp_model", "nerf_network", "model", "camera"}
OF_PEERS |= {"util", "util_vis", "external"}


def take_out():
    """The loaded modules of such names, which are no longer loaded afterwards."""
    names = [name for name in sys.modules if name.split(".")[0] in OF_PEERS]
    return {name: sys.modules.pop(name) for name in names}


@contextlib.contextmanager
def module_of(path, name, **stubs):
    """A module from a checkout. Peers share their names: theirs are put back later."""
    before = take_out()
    sys.modules.update(stubs)
    sys.path.insert(0, str(path))
    try:
        yield importlib.import_module(name)
    finally:
        sys.path.remove(str(path))
        take_out()
        sys.modules.update(before)


def unit_rays(rng):
    """Rays that begin near the middle, of directions longer than one."""
    unit = rng.normal(size=(RAYS, 3))
    unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
    found = cameras.Rays(
        rng.uniform(-0.3, 0.3, (RAYS, 3)),
        rng.uniform(1.0, 1.5, (RAYS, 1)) * unit,
        unit,
        rng.uniform(1e-3, 1e-2, (RAYS, 1)),
    )
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), found)


def layers_of(network):
    """Our layers in the order in which released codes have them."""
    trunk = [network[f"Dense_{layer}"] for layer in range(8)]
    rest = ("density", "bottleneck", "Dense_8", "values")
    return trunk + [network[name] for name in rest]


@pytest.mark.parametrize("white", [False, True])
@pytest.mark.parametrize("anti_aliased", [True, False])
def test_mip_nerf(rng, white, anti_aliased):
    path = checkout("ALIGNERF_MIPNERF")
    # Of points the finest sines count in full, and by 16 degrees they tell a place by
    # its last digits, in which both codes differ.
    degrees = 16 if anti_aliased else 8
    gin = types.ModuleType("gin")
    gin.configurable = lambda kind: kind
    # Its `utils` asks for what flax has not had for years, and the model for nothing.
    utils = types.ModuleType("internal.utils")
    stubs = {"gin": gin, "internal.utils": utils}
    with (
        module_of(path, "internal.models", **stubs) as released,
        jax.numpy_rank_promotion("allow"),
    ):
        theirs = released.MipNerfModel(
            num_samples=32,
            max_deg_point=degrees,
            disable_integration=not anti_aliased,
        )
        rays = unit_rays(rng)
        job = cases.job_of(
            kind="mipnerf",
            samples=[32, 32],
            near=0.2,
            far=6.0,
            spacing="linear",
            anti_aliased=anti_aliased,
            degrees=degrees,
            background="white" if white else "black",
        )
        method = compose.make_method(job)
        params = jax.jit(method.init)(jax.random.key(1))
        params = cases.with_density(params, -1.0)
        layers = {
            f"Dense_{number}": {"kernel": layer["kernel"].T, "bias": layer["bias"]}
            for number, layer in enumerate(layers_of(params["model"]["network"]))
        }
        wanted = theirs.apply(
            {"params": {"MLP_0": layers}},
            jax.random.key(0),
            types.SimpleNamespace(
                **rays._asdict(),
                near=jnp.full((RAYS, 1), 0.2),
                far=jnp.full((RAYS, 1), 6.0),
            ),
            randomized=False,
            white_bkgd=white,
        )
    shown = method.render(params, rays)
    (early, _, _), (late, _, seen) = wanted
    assert 0.2 < np.mean(seen) < 0.95
    np.testing.assert_allclose(shown.coarse[0], early, atol=5e-5)
    np.testing.assert_allclose(shown.values, late, atol=5e-5)


def in_their_order(kernel, channels, degrees, start=0):
    """Columns of a layer: ours has all sines first, theirs a degree's sine and cosine.

    The encoding's block begins at column `start`.
    """
    size = channels * degrees
    block = start + channels
    ours = np.arange(kernel.shape[1])
    waves = np.arange(2 * size).reshape(2, degrees, channels) + block
    ours[block : block + 2 * size] = waves.transpose(1, 0, 2).ravel()
    return np.asarray(kernel)[:, ours]


def load_part(torch, part, network, channels, degrees):
    """Our network's parameters in one of NeRF++'s."""
    width = len(network["Dense_0"]["bias"])
    encoded = channels * (1 + 2 * degrees)
    layers = layers_of(network)
    kernels = [np.asarray(layer["kernel"]) for layer in layers]
    kernels[0] = in_their_order(kernels[0], channels, degrees)
    # Ours appends the encoding, theirs puts it first.
    moved = in_their_order(kernels[5], channels, degrees, start=width)
    kernels[5] = np.concatenate([moved[:, width:], moved[:, :width]], axis=1)
    assert kernels[5].shape[1] == width + encoded
    kernels[10] = in_their_order(kernels[10], 3, 4, start=kernels[10].shape[1] - 27)
    linear = [
        *(layer[0] for layer in part.base_layers),
        *(part.sigma_layers[0], part.base_remap_layers[0]),
        *(part.rgb_layers[0], part.rgb_layers[2]),
    ]
    with torch.no_grad():
        for theirs, kernel, ours in zip(linear, kernels, layers, strict=True):
            theirs.weight.copy_(torch.tensor(kernel.copy()))
            theirs.bias.copy_(torch.tensor(np.array(ours["bias"])))


def test_nerf_plus_plus(rng):
    path = checkout("ALIGNERF_NERFPLUSPLUS")
    torch = pytest.importorskip("torch")
    degrees = 10
    with module_of(path, "ddp_model") as released:
        theirs = released.NerfNet(
            types.SimpleNamespace(
                max_freq_log2=degrees,
                max_freq_log2_viewdirs=4,
                netdepth=8,
                netwidth=256,
                use_viewdirs=True,
            )
        )
        job = cases.job_of(kind="nerfpp", degrees=degrees, samples=[8, 8])
        params = jax.jit(compose.make_method(job).init)(jax.random.key(1))
        networks = cases.with_density(params, 0.7)["model"]
        load_part(torch, theirs.fg_net, networks["inside_0"], 3, degrees)
        load_part(torch, theirs.bg_net, networks["outside_0"], 4, degrees)
        rays = unit_rays(rng)
        t = np.sort(rng.uniform(0.01, 0.5, (RAYS, 32)), axis=-1).astype(np.float32)
        u = np.sort(rng.uniform(0.0, 1.0, (RAYS, 32)), axis=-1).astype(np.float32)
        leave = np.full((RAYS, 1), 0.6, np.float32)
        with torch.no_grad():
            wanted = theirs(
                *(torch.tensor(np.array(part)) for part in rays[:2]),
                *(torch.tensor(part) for part in (leave[:, 0], t, u)),
            )
    model, _ = job.model.made(rays, native=False, moving=False)
    values, _, weights = model.apply(
        {"params": networks}, 0, rays, *map(jnp.asarray, (t, u, leave)), method="look"
    )
    assert 0.2 < wanted["bg_lambda"].mean() < 0.9
    # Its products of 1 - alpha have 1e-6 added at each of 32 samples.
    np.testing.assert_allclose(weights[0], wanted["fg_weights"], atol=1e-4)
    # Its weights are in the rays' order, ours in that of u.
    np.testing.assert_allclose(weights[1][:, ::-1], wanted["bg_weights"], atol=1e-4)
    np.testing.assert_allclose(values, wanted["rgb"], atol=1e-4)


# What BARF's code imports, and its network does not use.
UNUSED_BY_BARF = (
    *("torchvision", "torchvision.transforms", "torchvision.transforms.functional"),
    *("torch.utils.tensorboard", "easydict", "lpips", "visdom", "util_vis", "camera"),
    *("external", "external.pohsun_ssim"),
)


def by_channel(kernel, degrees, start=0):
    """Columns of a layer in BARF's order: of each channel all sines, then all cosines.

    The encoding's block begins at column `start`.
    """
    found = np.array(kernel)
    block = start + 3
    waves = np.arange(6 * degrees).reshape(2, degrees, 3) + block
    ours = waves.transpose(2, 0, 1).ravel()
    found[:, block : block + 6 * degrees] = found[:, ours]
    return found


def load_barf(torch, theirs, params, degrees, view_degrees):
    """Our field's parameters in BARF's network."""
    names = [*(f"Dense_{layer}" for layer in range(8)), "Dense_0", "values"]
    owners = [params] * 8 + [params["head"]] * 2
    layers = [owner[name] for owner, name in zip(owners, names, strict=True)]
    kernels = [np.asarray(layer["kernel"]) for layer in layers]
    kernels[0] = by_channel(kernels[0], degrees)
    kernels[4] = by_channel(kernels[4], degrees, start=256)
    kernels[8] = by_channel(kernels[8], view_degrees, start=256)
    # Its sines of a direction have a factor pi, so that it is given v / pi.
    kernels[8][:, 256:259] *= np.pi
    linear = [*theirs.mlp_feat, *theirs.mlp_rgb]
    with torch.no_grad():
        for layer, kernel, ours in zip(linear, kernels, layers, strict=True):
            layer.weight.copy_(torch.tensor(kernel))
            layer.bias.copy_(torch.tensor(np.array(ours["bias"])))


@pytest.mark.parametrize("fineness", [0.0, 0.35, 1.0])
def test_barf(rng, fineness):
    path = checkout("ALIGNERF_BARF")
    torch = pytest.importorskip("torch")
    util = types.ModuleType("util")
    util.log = util.debug = None
    util.get_layer_dims = lambda widths: list(itertools.pairwise(widths))
    stubs = {name: mock.MagicMock() for name in UNUSED_BY_BARF} | {"util": util}
    degrees, view_degrees, space = 10, 4, types.SimpleNamespace
    options = space(
        arch=space(
            posenc=space(L_3D=degrees, L_view=view_degrees),
            layers_feat=[None] + [256] * 8,
            layers_rgb=[None, 128, 3],
            skip=[4],
            tf_init=False,
            density_activ="softplus",
        ),
        nerf=space(view_dep=True, density_noise_reg=None),
        barf_c2f=[0.0, 1.0],
        device="cpu",
    )
    x = rng.uniform(-1.0, 1.0, (RAYS, 5, 3)).astype(np.float32)
    v = unit_rays(rng).viewdirs
    ours = fields.make("nerf", degrees=degrees, view_degrees=view_degrees)
    nothing = jnp.zeros((RAYS, 5))
    points = coord.Gaussians(jnp.asarray(x), jnp.zeros_like(x), nothing, nothing)
    params = ours.init(jax.random.key(1), points, v, fineness)
    # Biases start at 0: no two of them are to be alike.
    params = jax.tree.map(
        lambda leaf: leaf + rng.normal(0, 0.1, leaf.shape) * (leaf.ndim == 1), params
    )
    density, values = ours.apply(params, points, v, fineness)
    with mock.patch.dict(sys.modules), module_of(path, "model.barf", **stubs) as barf:
        theirs = barf.NeRF(options)
        theirs.progress.data.fill_(fineness)
        load_barf(torch, theirs, params["params"], degrees, view_degrees)
        directions = torch.tensor(np.asarray(v) / np.pi)[:, None].expand(RAYS, 5, 3)
        with torch.no_grad():
            colours, wanted = theirs(options, torch.tensor(x), directions)
    assert np.ptp(wanted) > 0.1
    np.testing.assert_allclose(density, wanted, atol=2e-5)
    padded = colours * (1 + 2 * shading.PADDING) - shading.PADDING
    np.testing.assert_allclose(np.moveaxis(values, 0, -1), padded, atol=2e-5)
