"""One gradient, however a batch is split: in micro-batches, or over devices."""

import functools
import json
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import random

from alignerf.training import gradients
from tests import job_cases
from tests import training_cases as cases


@pytest.mark.parametrize(
    "kind", job_cases.one_of(["mipnerf360", "alignerf", "aligned_loss"], "mipnerf360")
)
def test_micro_batches_give_the_gradient_of_the_batch(kind):
    """With masks that differ from part to part, and one part that is all masked."""
    method = cases.alignerf(patches=4) if kind == "alignerf" else cases.baseline()
    if kind == "aligned_loss":
        method = cases.aligned_loss(method)
    params = jax.jit(method.init)(jax.random.key(0))
    batch = jax.jit(method.draw)(jax.random.key(1), 0, cases.make_views())
    if kind == "aligned_loss":
        params["costs"] = random.uniform(random.key(2), params["costs"].shape)
    if kind != "alignerf":
        weight = batch.weight.at[:24].set(0.0)
        batch = batch._replace(weight=weight / jnp.mean(weight))

    @functools.partial(jax.jit, static_argnames="micro_batches")
    def mean(micro_batches):
        return gradients.mean(
            method.terms, params, batch, 0.3, micro_batches=micro_batches
        )

    (loss, shown), grads = mean(1)
    flat = np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(grads)])
    assert np.linalg.norm(flat) > 0
    (loss_of_parts, shown_of_parts), grads_of_parts = mean(4)
    assert float(loss_of_parts) == pytest.approx(float(loss), rel=1e-6)
    for name in shown:
        assert float(shown_of_parts[name]) == pytest.approx(
            float(shown[name]), rel=1e-5
        )
    other = np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(grads_of_parts)])
    assert np.linalg.norm(other - flat) < 1e-6 * np.linalg.norm(flat)


@pytest.mark.parametrize(
    ("units", "count", "used"),
    [(96, 8, 8), (32, 5, 4), (9, 8, 3), (97, 8, 1), (4, 1, 1)],
)
def test_as_many_devices_as_share_the_units_evenly(units, count, used, caplog):
    found = gradients.make_mesh(units, [object() for _ in range(count)])
    assert (1 if found is None else found.size) == used
    assert (f"{used} of {count} devices are used" in caplog.text) == (used < count)


@pytest.mark.whole
def test_eight_devices_learn_what_one_does(root):
    flags = (
        f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count=8"
    )
    settings = {
        "XLA_FLAGS": flags,
        # Compiles in half the time.
        "JAX_DISABLE_MAX_OPTIMIZATIONS": "1",
    }
    done = subprocess.run(
        [sys.executable, "-m", "tests.on_devices"],
        cwd=root,
        env=os.environ | settings,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    for runs in json.loads(done.stdout).values():
        losses, collectives, copies = runs["one"]
        assert (collectives, copies) == ([], 1)
        shared, collectives, copies = runs["all"]
        # Nothing but the mean goes from device to device.
        assert (collectives, copies) == (["all-reduce"], 8)
        assert shared == pytest.approx(losses, rel=1e-5)
        assert len(set(losses)) == len(losses)
        one, *others = np.array(runs["images"])
        for other in others:
            np.testing.assert_allclose(other, one, atol=1)
        assert np.ptp(one) > 10
