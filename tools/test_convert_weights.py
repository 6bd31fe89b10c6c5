"""Weights of the fixed networks: renamed and turned, each layer from its place."""

import re

import numpy as np
import pytest

from alignerf.metrics import lpips
from alignerf.networks import backbones, convnet
from tools import convert_weights

VGG19 = {"conv1_1": "features.0", "conv1_2": "features.2"}
ALEX = dict(zip(backbones.ALEX, (0, 3, 6, 8, 10), strict=True))
PLACES = VGG19 | {layer: f"features.{place}" for layer, place in ALEX.items()}


@pytest.mark.parametrize("what", ["frequency", "lpips_alex"])
def test_layers_come_from_their_places(what, tmp_path, rng, monkeypatch):
    shapes = convnet.vgg19_shapes()
    if what != "frequency":
        shapes = backbones.shapes("alex")
    arrays = {name: rng.normal(size=size).astype("f4") for name, size in shapes.items()}
    state, heads = {}, {}
    for name, array in arrays.items():
        layer, _, part = name.rpartition("_")
        if part == "w":
            state[f"{PLACES[layer]}.weight"] = array.transpose(3, 2, 0, 1)
        elif part == "b":
            state[f"{PLACES[layer]}.bias"] = array
        elif name.startswith("lin"):
            heads[f"{name}.model.1.weight"] = array.reshape(1, -1, 1, 1)
    files = {convert_weights.BACKBONES[what]: state}
    files[convert_weights.HEADS.get(what)] = heads
    monkeypatch.setattr(convert_weights, "fetch", lambda *file: files[file])
    path = tmp_path / "made" / "weights.npz"
    convert_weights.main([what, f"--out={path}"])
    with np.load(path) as stored:
        for name, array in arrays.items():
            if name not in ("mean", "std"):
                np.testing.assert_array_equal(stored[name], array)
    if what == "frequency":
        assert convnet.vgg19_features(path)(np.zeros((1, 8, 8, 3))).shape[-1] == 64
    else:
        assert lpips.read("alex", path).keys() == arrays.keys()


def test_mean_and_deviation_are_those_of_the_real_weights(shared_data):
    with np.load(shared_data / "weights" / "vgg19_block1.npz") as stored:
        np.testing.assert_allclose(stored["mean"], convert_weights.MEAN)
        np.testing.assert_allclose(stored["std"], convert_weights.STD)


@pytest.mark.parametrize("what", convert_weights.BACKBONES)
def test_each_layer_has_one_place(what):
    net = what.removeprefix("lpips_")
    layers = backbones.NETS[net].layers if net in backbones.NETS else VGG19
    places = convert_weights.PLACES[what]
    assert len(set(places)) == len(places) == len(layers)
    url, sha256 = convert_weights.BACKBONES[what]
    # As torchvision names its files.
    assert sha256.startswith(re.search(r"-([0-9a-f]{8})\.pth$", url)[1])
