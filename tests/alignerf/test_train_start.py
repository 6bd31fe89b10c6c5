"""What a training begins with, and where its search radius comes from."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf import train
from alignerf.contributions import patch_conv
from alignerf.experiment import jobs
from alignerf.scenes import cameras, prepared
from alignerf.training import checkpoint, compose, methods
from tests import job_cases as cases

MODELS = {
    "grid": cases.JOB["model"],
    "mlp": cases.JOB["model"] | {"field": {"kind": "mlp", "width": 16, "depth": 2}},
}


@pytest.fixture(scope="module")
def pretrained(folder, tmp_path_factory):
    """(its job, its parameters' file) of a pre-training, by the field's kind."""

    def make(kind):
        out = tmp_path_factory.mktemp("pretrained")
        job = cases.in_stage("pretrain", cases.JOB | {"model": MODELS[kind]})
        cases.run(folder, out, job)
        return job, out / "learnt" / "model.msgpack"

    return functools.cache(make)


@pytest.mark.parametrize(
    ("kind", "parts"),
    [
        ("grid", {}),
        ("grid", {"convolution": False}),
        pytest.param("grid", {"features": 9}, marks=pytest.mark.whole),
        pytest.param("mlp", {}, marks=pytest.mark.whole),
    ],
    ids=["grid", "no convolution", "more features", "mlp"],
)
def test_fine_tuning_starts_from_the_pretrained_function(pretrained, kind, parts):
    """Colours of a view, before the first step: equal to 1e-5."""
    first, model = pretrained(kind)
    second = cases.in_stage("finetune", cases.JOB | {"model": MODELS[kind]}, **parts)
    stages = [jobs.parse(job) for job in (first, second)]
    before, after = map(compose.make_method, stages)
    template = jax.eval_shape(before.init, jax.random.key(0))
    params = checkpoint.read_params(model, template)
    widened = train.initial_params(stages[1], after, str(model))
    assert ("head" in widened) == second["alignerf"]["convolution"]
    colours = colours_of(before, params)
    assert np.ptp(colours) > 0.01
    found = colours_of(after, widened)
    np.testing.assert_allclose(found, colours, atol=1e-5)


def colours_of(method, params):
    """A view's colours [h, w, 3], in one program."""
    height, width = cases.HEIGHT, cases.WIDTH

    @jax.jit
    def look(params):
        rows, columns = jnp.mgrid[:height, :width]
        pixtocam = jnp.asarray(cameras.intrinsics(30.0, width, height), jnp.float32)
        rays = cameras.pixels_to_rays(
            columns.ravel(), rows.ravel(), pixtocam, jnp.eye(3, 4)
        )
        rays = methods.bounded(rays, method.bounds)
        values = method.render(params, rays).values.reshape(height, width, -1)
        return method.colours(params, patch_conv.pad(values) if method.halo else values)

    return np.asarray(look(jax.tree.map(jnp.asarray, params)))


@pytest.mark.parametrize("which", ["scene's", "given"])
def test_the_cameras_that_its_renders_are_seen_by_lie_with_it(
    folder, uninterrupted, tmp_path, which
):
    """To the byte; its model hangs on those that it has learnt from alone."""
    paths, more = {"scene's": folder / "cameras.npz"}, []
    arrays = dict(np.load(folder / "cameras.npz"))
    arrays["camtoworlds"][:, :, 3] *= 2
    paths["given"] = tmp_path / "given.npz"
    np.savez(paths["given"], **arrays)
    if which == "given":
        more = ["--cameras", str(paths["given"])]
    found = cases.run(folder, tmp_path, cases.JOB, *more)
    learnt = tmp_path / "learnt"
    assert {path.name for path in learnt.glob("[!.]*")} == {
        "cameras.npz",
        "model.msgpack",
    }
    assert (learnt / "cameras.npz").read_bytes() == paths[which].read_bytes()
    same = found == (uninterrupted / "learnt" / "model.msgpack").read_bytes()
    assert same == (which != "given")


def test_cameras_that_were_learnt_lie_with_the_training(folder, tmp_path):
    job = cases.JOB | {"pose_optimization": {"min_move_px": None}}
    cases.run(folder, tmp_path, job)
    given, learnt = (
        prepared.read_cameras(place / "cameras.npz")
        for place in (folder, tmp_path / "learnt")
    )
    train = learnt["split"] == "train"
    assert (learnt["camtoworlds"][train] != given["camtoworlds"][train]).any()
    np.testing.assert_array_equal(learnt["names"], given["names"])


def test_a_folder_for_its_cameras_is_needed(folder, tmp_path, capsys):
    options = ["--config", "{}", "--scene", str(folder)]
    for name in ("checkpoints", "timing"):
        options += [f"--{name}", str(tmp_path / name)]
    with pytest.raises(SystemExit):
        train.main(options)
    assert "required: --learnt" in capsys.readouterr().err
