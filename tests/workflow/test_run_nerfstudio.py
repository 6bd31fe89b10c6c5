"""The wrapper of nerfstudio, as far as it goes without nerfstudio."""

import contextlib
import importlib.util
import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image


@pytest.fixture(scope="module")
def wrapper(root):
    path = root / "workflow/scripts/run_nerfstudio.py"
    spec = importlib.util.spec_from_file_location("run_nerfstudio", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_words_of_nerfstudio_are_left_as_they_are(wrapper):
    words = ["nerfacto", "--data", "a b", "--cores", "7", "--vis", "tensorboard"]
    args = wrapper.parse(["train", "--cores", "2", "--", *words])
    assert args.cores == 2
    assert [word for word in args.words if word != "--"] == words


def test_words_from_a_file(wrapper, tmp_path):
    path = tmp_path / "small.txt"
    path.write_text("--vis=tensorboard\n--samples\n48\n24\n")
    args = wrapper.parse(["train", "--", "nerfacto", f"@{path}", "--data", "a"])
    words = ["--vis=tensorboard", "--samples", "48", "24"]
    assert args.words[-7:] == ["nerfacto", *words, "--data", "a"]


@pytest.mark.parametrize(
    ("words", "seed"),
    [("--data a", 42), ("--machine.seed 7 --data a", 7), ("--machine.seed=8", 8)],
)
def test_the_seed_of_the_process_that_draws_rays(wrapper, words, seed):
    assert wrapper.seed_of(["ns-train", "nerfacto", *words.split()]) == seed


def test_depth_along_the_axis_from_the_distance_along_rays(wrapper, rng):
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    camtoworld = np.concatenate([turn, rng.normal(size=(3, 1))], axis=-1)
    z = rng.uniform(1, 9, (4, 5))
    in_camera = np.stack(
        [*rng.uniform(-0.8, 0.8, (2, 4, 5)), np.full((4, 5), -1.0)], -1
    )
    points = (z[..., None] * in_camera) @ turn.T
    distance = np.linalg.norm(points, axis=-1)
    found = wrapper.along_axis(distance, points / distance[..., None], camtoworld)
    np.testing.assert_allclose(found, z, rtol=1e-12)


def test_what_one_camera_shows(wrapper, rng, monkeypatch):
    """Rays of unequal length to a plane; half of it is hardly there. Then Gaussians."""
    torch = SimpleNamespace(no_grad=contextlib.nullcontext)
    monkeypatch.setitem(sys.modules, "torch", torch)
    directions = np.stack(
        [*rng.uniform(-0.5, 0.5, (2, 3, 4)), np.full((3, 4), -1.0)], -1
    )
    length = np.linalg.norm(directions, axis=-1, keepdims=True)
    there = np.ones((3, 4, 1))
    there[:, 2:] = 0.2
    outputs = {"rgb": rng.random((3, 4, 3)), "accumulation": there}
    outputs["depth"] = 5 * length
    camera = SimpleNamespace(
        generate_rays=lambda **_: SimpleNamespace(
            directions=Tensor(directions / length)
        ),
        camera_to_worlds=[Tensor(np.eye(4)[:3])],
    )

    def shown(*, of_gaussians):
        tensors = {name: Tensor(value) for name, value in outputs.items()}
        model = SimpleNamespace(get_outputs_for_camera=lambda _: tensors)
        return wrapper.of_camera(model, camera, of_gaussians=of_gaussians)

    rgb, z = shown(of_gaussians=False)
    np.testing.assert_array_equal(rgb, outputs["rgb"])
    np.testing.assert_allclose(z[:, :2], 5)
    assert not z[:, 2:].any()
    of_gaussians = shown(of_gaussians=True)[1]
    np.testing.assert_array_equal(of_gaussians[:, :2], 5 * length[:, :2, 0])


class Tensor:
    """As much of torch's as is asked for."""

    def __init__(self, value):
        self.value = value

    def cpu(self):
        return self

    def numpy(self):
        return self.value


def test_one_training_is_found_and_others_are_counted(wrapper, tmp_path):
    with pytest.raises(ValueError, match=r"model: 0 trainings .* instead of one"):
        wrapper.only_config(tmp_path / "model")
    for name in ("run", "other"):
        (tmp_path / "model" / name).mkdir(parents=True)
    path = tmp_path / "model/run/config.yml"
    path.touch()
    assert wrapper.only_config(tmp_path / "model") == path
    (tmp_path / "model/other/config.yml").touch()
    with pytest.raises(ValueError, match=r"model: 2 trainings"):
        wrapper.only_config(tmp_path / "model")


@pytest.mark.parametrize(
    ("content", "scale"), [({}, 1.0), ({"applied_scale": 0.5}, 0.5)]
)
def test_the_scale_that_was_applied_before(wrapper, tmp_path, content, scale):
    assert wrapper.applied_scale(tmp_path) == 1.0
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(content))
    assert wrapper.applied_scale(tmp_path) == wrapper.applied_scale(path) == scale


def test_gaussians_are_refused_with_a_lens(wrapper):
    wrapper.check_no_lens("splatfacto", np.zeros((2, 6)))
    wrapper.check_no_lens("splatfacto", None)
    with pytest.raises(ValueError, match="splatfacto-big renders no lens distortion"):
        wrapper.check_no_lens("splatfacto-big", np.ones((2, 6)))


def test_a_view_is_written_once(wrapper, tmp_path):
    rgb = np.array([[[-0.2, 0.5, 1.3], [0.001, 0.003, 1.0]]])
    wrapper.write_view("a", rgb, np.full((1, 2), 2.5), tmp_path, tmp_path)
    image = np.asarray(Image.open(tmp_path / "a.png"))
    np.testing.assert_array_equal(image, [[[0, 128, 255], [0, 1, 255]]])
    depth = np.load(tmp_path / "a.npy")
    assert (depth.dtype, depth.tolist()) == (np.float32, [[2.5, 2.5]])
    with pytest.raises(ValueError, match=r"a\.png is there already"):
        wrapper.write_view("a", rgb, np.zeros((1, 2)), tmp_path, tmp_path)
