"""Equal programs are traced once in a process, whatever object asks for them."""

import jax
import pytest

from alignerf.experiment import jobs
from alignerf.scenes import cameras
from alignerf.training import compose, loop, program, renderer
from tests import job_cases
from tests import training_cases as cases


def job_of(stage="full", **changes):
    job = job_cases.JOB | changes if stage == "full" else job_cases.in_stage(stage)
    return jobs.parse(job)


@pytest.fixture
def traced(monkeypatch):
    """One entry for each trace of a program: each makes rays of pixels."""
    jax.clear_caches()
    make, count = cameras.pixels_to_rays, []

    def counting(*arguments):
        count.append(1)
        return make(*arguments)

    monkeypatch.setattr(cameras, "pixels_to_rays", counting)
    return count


@pytest.mark.parametrize("stage", job_cases.one_of(["full", "finetune"], "full"))
def test_a_step_is_traced_once_for_equal_trainings(traced, stage):
    views = jax.eval_shape(lambda: jax.tree.map(jax.numpy.asarray, cases.make_views()))
    for seed in (1, 2):
        job = job_of(stage, seed=seed)
        method = compose.make_method(job)
        params = jax.eval_shape(method.init, jax.random.key(0))
        program.build(job, method, params, views)
    assert len(traced) == 1
    more = job_of(training=job_cases.TRAINING | {"batch_rays": 65})
    method = compose.make_method(more)
    params = jax.eval_shape(method.init, jax.random.key(0))
    program.build(more, method, params, views)
    assert len(traced) == 2


def test_a_renderer_is_traced_once_for_equal_methods(rng, traced):
    views = cases.make_views()
    for height in (6, 12):
        method = compose.make_method(job_of(), to_train=False)
        params = cases.random_params(rng, method)
        render = renderer.make_renderer(method, params, 32, height)
        render(views.pixtocams[0], views.camtoworlds[0])
    # The rows of a smaller image are a smaller program.
    assert len(traced) == 2
    render = renderer.make_renderer(compose.make_method(job_of()), params, 32, 12)
    render(views.pixtocams[0], views.camtoworlds[0])
    assert len(traced) == 2


def test_no_more_steps_wait_than_several_devices_bear():
    assert loop.FETCH_EVERY <= 16
