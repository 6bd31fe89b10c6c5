"""Equal programs are compiled once in a process, whatever object asks for them."""

import re

import jax
import numpy as np
import pytest

from alignerf.experiment import jobs
from alignerf.training import compose, loop, methods, program, renderer
from tests import job_cases
from tests import training_cases as cases


def job_of(stage="full", **changes):
    job = job_cases.JOB | changes if stage == "full" else job_cases.in_stage(stage)
    return jobs.parse(job)


@pytest.fixture
def compiled(caplog):
    """A function: names of the programs that were compiled since it was last called."""
    jax.clear_caches()
    caplog.set_level("WARNING")

    def names():
        found = re.findall(r"Finished XLA compilation of jit\((\w+)\)", caplog.text)
        caplog.clear()
        return sorted({"learn", "draw", "render_pixels"} & {*found})

    with jax.log_compiles():
        yield names


def trained_in(job, views):
    """Build a job's step, as a training of these views does."""
    method = compose.make_method(job)
    params = jax.eval_shape(method.init, jax.random.key(0))
    program.build(job, method, params, jax.eval_shape(lambda: views))


@pytest.mark.parametrize("stage", job_cases.one_of(["full", "finetune"], "full"))
def test_scenes_share_the_step_of_a_model(compiled, stage):
    """Whatever its photos' size and number, and the bounds that its facts decided."""
    asked = {
        (3, 36, 40): ["draw", "learn"],
        (4, 30, 52): ["draw"],
        (1, 20, 31): ["draw"],
    }
    for seed, (size, wanted) in enumerate(asked.items()):
        bounds = {"near": 0.2 + seed, "far": 1e3 * (1 + seed), "radius": 1.0 + seed}
        job = job_of(stage, seed=seed)
        job = job.changed(model=job.model.model_copy(update=bounds))
        for same in (job, job.changed(seed=9)):
            trained_in(same, cases.make_views(*size))
            assert compiled() == wanted * (same is job)
    more = job_cases.TRAINING | {"batch_rays": 65}
    trained_in(job_of(training=more), cases.make_views())
    assert compiled() == ["draw", "learn"]


def test_scenes_share_the_renderer_of_a_model(rng, compiled):
    views, images = cases.make_views(), []
    sizes = (64, 64, 0.2), (80, 60, 0.2), (52, 96, 0.3), (64, 64, 0.3)
    for width, height, near in sizes:
        model = job_cases.JOB["model"] | {"near": near}
        method = compose.make_method(job_of(model=model))
        params = cases.random_params(np.random.default_rng(0), method)
        render = renderer.make_renderer(method, params, width, height)
        images.append(render(views.pixtocams[0], views.camtoworlds[0])[1])
        assert compiled() == ["render_pixels"] * (len(images) == 1)
    # The bounds count nevertheless.
    assert np.abs(images[3] - images[0]).max() > 0.01


def test_rays_bring_the_bounds_that_a_model_leaves_out(rng):
    model = cases.tiny_model().clone(near=0.3, far=50.0, radius=4.0)
    free, bounds = model.for_any_scene()
    assert free == cases.tiny_model().for_any_scene()[0]
    views = cases.make_views()
    batch = jax.jit(cases.baseline().draw)(jax.random.key(0), 0, views)
    params = cases.random_params(rng, cases.baseline())["model"]
    rays = batch.rays, methods.bounded(batch.rays, bounds)
    own, brought = (
        jax.jit(one.apply)({"params": params}, given)
        for one, given in zip((model, free), rays, strict=True)
    )
    for one, other in zip(*map(jax.tree.leaves, (own, brought)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-6)


def test_no_more_steps_wait_than_several_devices_bear():
    assert loop.FETCH_EVERY <= 16
