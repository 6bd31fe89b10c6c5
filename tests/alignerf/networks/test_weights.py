"""Weights made from published files: renamed, turned, checked; fetched whole or not."""

import functools
import hashlib
import http.server
import re
import threading

import numpy as np
import pytest

from alignerf.io import downloads
from alignerf.metrics import lpips
from alignerf.networks import backbones, convnet, weights
from tests import torch_writer

FIRES = dict(zip(range(2, 10), (3, 4, 6, 7, 9, 10, 11, 12), strict=True))
VGG19 = {"conv1_1": "features.0", "conv1_2": "features.2"}


@pytest.fixture(autouse=True)
def torch(monkeypatch):
    torch_writer.fake_torch(monkeypatch)


@pytest.fixture
def published(monkeypatch):
    """Make a file the published one of its kind."""

    def publish(path, what, kinds=weights.BACKBONES):
        content = path.read_bytes()
        own = {"size": len(content), "hash": hashlib.sha256(content).hexdigest()}
        monkeypatch.setitem(kinds, what, kinds[what]._replace(**own))

    return publish


def place_of(name):
    """torchvision's name of a layer of SqueezeNet 1.1, and of VGG-19's first block."""
    if fire := re.fullmatch(r"fire(\d)_(\w+)", name):
        return f"features.{FIRES[int(fire[1])]}.{fire[2]}"
    return VGG19.get(name, "features.0")


def backbone_of(arrays):
    """The state dict that these arrays stand for, with a classifier besides."""
    state = {"classifier.1.weight": np.ones((9, 5), "<f4")}
    for name, array in arrays.items():
        layer, _, part = name.rpartition("_")
        if part == "w":
            state[f"{place_of(layer)}.weight"] = array.transpose(3, 2, 0, 1)
        elif part == "b":
            state[f"{place_of(layer)}.bias"] = array
    return torch_writer.state_dict(state)


def heads_of(arrays):
    return torch_writer.state_dict(
        {
            f"{name}.model.1.weight": array.reshape(1, -1, 1, 1)
            for name, array in arrays.items()
            if name.startswith("lin")
        }
    )


def random_arrays(shapes, rng):
    return {name: rng.normal(size=size).astype("<f4") for name, size in shapes.items()}


def load(path):
    with np.load(path, allow_pickle=False) as stored:
        return dict(stored)


@pytest.fixture
def vgg(tmp_path, rng):
    """Arrays of VGG-19's first block, and the file that they are in."""
    arrays = random_arrays(convnet.vgg19_shapes(), rng)
    arrays |= {"mean": np.float32(weights.MEAN), "std": np.float32(weights.STD)}
    path = tmp_path / "vgg19.pth"
    path.write_bytes(torch_writer.legacy(backbone_of(arrays)))
    return arrays, path


def test_the_first_block_of_vgg(vgg, tmp_path, published):
    arrays, path = vgg
    published(path, "frequency")
    out = tmp_path / "made" / "vgg.npz"
    weights.main(["frequency", f"--out={out}", f"--backbone={path}"])
    found = load(out)
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)
    assert convnet.vgg19_features(out)(np.zeros((1, 8, 8, 3))).shape[-1] == 64
    assert [path.name for path in out.parent.iterdir()] == ["vgg.npz"]


def test_mean_and_deviation_are_those_of_the_real_weights(shared_data):
    stored = load(shared_data / "weights" / "vgg19_block1.npz")
    np.testing.assert_allclose(stored["mean"], weights.MEAN)
    np.testing.assert_allclose(stored["std"], weights.STD)


@pytest.mark.parametrize("written", torch_writer.FORMATS.values())
def test_backbone_and_heads_of_lpips(written, tmp_path, rng, published):
    arrays = random_arrays(backbones.shapes("squeeze"), rng)
    paths = [tmp_path / name for name in ("squeeze.npz", "net.pth", "heads.pth")]
    paths[1].write_bytes(written(backbone_of(arrays)))
    paths[2].write_bytes(written(heads_of(arrays)))
    published(paths[1], "lpips_squeeze")
    published(paths[2], "lpips_squeeze", weights.HEADS)
    options = zip(("--out", "--backbone", "--heads"), map(str, paths), strict=True)
    weights.main(["lpips_squeeze", *(x for pair in options for x in pair)])
    found = lpips.read("squeeze", paths[0])
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)


@pytest.mark.parametrize("what", weights.BACKBONES)
def test_each_layer_has_one_place(what):
    net = what.removeprefix("lpips_")
    layers = backbones.NETS[net].layers if net in backbones.NETS else VGG19
    assert len(set(weights.PLACES[what])) == len(weights.PLACES[what]) == len(layers)
    for published in (weights.BACKBONES[what], weights.HEADS.get(what)):
        if published:
            assert re.fullmatch("[0-9a-f]{64}", published.hash)
            assert published.url.startswith("https://")
    # As torchvision names its files.
    digits = re.search(r"-([0-9a-f]{8})\.pth$", weights.BACKBONES[what].url)[1]
    assert weights.BACKBONES[what].hash.startswith(digits)


def test_another_file_than_the_published_one_is_refused(vgg, tmp_path):
    _, path = vgg
    out = tmp_path / "vgg.npz"
    with pytest.raises(ValueError, match=r"vgg19\.pth: not https://.* it has"):
        weights.main(["frequency", f"--out={out}", f"--backbone={path}"])
    assert not out.exists()


def test_what_cannot_be_is_named(vgg, tmp_path, published):
    _, path = vgg
    published(path, "lpips_alex", weights.HEADS)
    with pytest.raises(ValueError, match="--heads: frequency has none"):
        weights.main(["frequency", "--out=a.npz", f"--heads={path}"])
    with pytest.raises(ValueError, match=r"--out: a\.pth does not end in \.npz"):
        weights.main(["frequency", "--out=a.pth"])
    options = [f"--out={tmp_path / 'a.npz'}", f"--heads={path}"]
    with pytest.raises(ValueError, match=r"vgg19\.pth: .*no tensor lin0"):
        weights.main(["lpips_alex", *options])
    assert [found.name for found in tmp_path.iterdir()] == ["vgg19.pth"]


@pytest.fixture
def served(tmp_path, monkeypatch):
    """A folder behind HTTP, and the published file changed to one in it."""
    folder = tmp_path / "served"
    folder.mkdir()

    class Handler(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    handler = functools.partial(Handler, directory=folder)
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()

        def publish(name, content, **change):
            (folder / name).write_bytes(content)
            published = downloads.Published(
                url=f"http://127.0.0.1:{server.server_port}/{name}",
                size=len(content),
                hash=hashlib.sha256(content).hexdigest(),
            )
            published = published._replace(**change)
            monkeypatch.setitem(weights.BACKBONES, "frequency", published)
            return folder / name

        yield publish
        server.shutdown()


def test_a_file_is_fetched_once_and_gone(vgg, served, tmp_path, capsys):
    arrays, path = vgg
    served("vgg19-1.pth", path.read_bytes())
    out = tmp_path / "made" / "vgg.npz"
    weights.main(["frequency", f"--out={out}"])
    np.testing.assert_array_equal(load(out)["conv1_2_w"], arrays["conv1_2_w"])
    assert [path.name for path in out.parent.iterdir()] == ["vgg.npz"]
    assert "vgg19-1.pth: MB 1/1" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (
            {"hash": "0" * 64},
            "its SHA256 is .* instead of 0000",
        ),
        # No more is read of a file that is larger than it should be.
        (
            {"size": 5 << 20},
            f"it has {6 << 20} bytes instead of {5 << 20}",
        ),
    ],
)
def test_a_wrong_file_leaves_nothing_behind(served, tmp_path, change, reason):
    served("vgg19-1.pth", bytes(20 << 20), **change)
    out = tmp_path / "made" / "vgg.npz"
    with pytest.raises(ValueError, match=rf"vgg19-1\.pth: .*{reason}"):
        weights.main(["frequency", f"--out={out}"])
    assert not out.parent.exists()


def test_a_file_that_is_not_there(served, tmp_path):
    served("vgg19-1.pth", b"").unlink()
    out = tmp_path / "made" / "vgg.npz"
    with pytest.raises(ValueError, match=r"vgg19-1\.pth: .*404.*: fetch it by other"):
        weights.main(["frequency", f"--out={out}"])
    assert not out.parent.exists()
