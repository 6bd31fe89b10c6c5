"""The first step that is not finite: nothing moves, and the cause is named."""

import functools
import itertools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.kernels import calls
from alignerf.training import diagnose
from alignerf.training import step as train_step
from tests import job_cases
from tests import training_cases as cases

NAMES = ["oak", "fir", "elm"]
METHODS = {
    "mipnerf360": (cases.baseline, ["data", "interlevel", "distortion"]),
    "alignerf": (
        functools.partial(cases.alignerf, patches=5),
        ["data", "frequency", "interlevel", "distortion"],
    ),
}
NETWORKS = ["field", "proposal"]


def poisonable(method, names):
    """The method with a scale for each term, and a view at which its gradients are NaN.

    Both are in the parameters, so that one compiled program serves all cases; the
    scale acts twice, so that it can be infinite from a finite parameter.
    """

    def terms(params, batch, share):
        poison = jax.lax.stop_gradient(params["poison"])
        values, shown = method.terms(params, batch, share)
        scaled = {name: values[name] * poison["scale"][name] ** 2 for name in names}
        for name, network in itertools.product(names, NETWORKS):
            # The root of zero: a finite value of gradient infinity.
            leaves = jax.tree.leaves(params["model"][network])
            hit = jnp.any(batch.view == poison["view"][name][network])
            zero = 0.0 * sum(jnp.sum(leaf) for leaf in leaves)
            scaled[name] += jnp.sqrt(jnp.where(hit, zero, 1.0))
        return scaled, shown

    poison = {
        "scale": dict.fromkeys(names, 1.0),
        "view": {name: dict.fromkeys(NETWORKS, -1.0) for name in names},
    }
    poison = jax.tree.map(jnp.asarray, poison)
    init = lambda key: method.init(key) | {"poison": poison}  # noqa: E731
    return method._replace(init=init, terms=terms)


@pytest.fixture(scope="module", params=job_cases.one_of(METHODS, "mipnerf360"))
def trained(request):
    """(method, state that no step has changed, step)."""
    make, names = METHODS[request.param]
    method = poisonable(make(), names)
    return method, *cases.start(method)


@pytest.fixture(scope="module")
def views():
    return cases.make_views()


def copied(tree):
    return jax.tree.map(jnp.copy, tree)


def explain(method, state, views):
    return diagnose.explain(method, state, views, NAMES, steps=50, seed=0)


def test_a_poisoned_camera_stops_every_method_and_is_named(trained, views):
    method, fresh, step = trained
    bad = views._replace(camtoworlds=views.camtoworlds.at[1, 0, 3].set(jnp.nan))
    state = copied(fresh)
    for _ in range(2):
        state, stats = step(state, bad)
        assert not np.isfinite(stats["loss"]) or stats["nonfinite_gradients"] > 0
    # The state of the failing step is still there, whenever one looks.
    for old, new in zip(jax.tree.leaves(fresh), jax.tree.leaves(state), strict=True):
        np.testing.assert_array_equal(old, new)
    line = explain(method, state, bad)
    assert line.startswith("training diverged at step 0: not finite: data loss, ")
    assert line.endswith("; in rays of fir")
    state, stats = step(state, views)
    assert stats["nonfinite_gradients"] == 0
    assert state.step == 1


def test_an_accelerator_waits_for_no_condition(monkeypatch, views):
    """And the state of a failing step is still there."""
    monkeypatch.setattr(calls, "on_cpu", lambda: False)
    # Made anew: the programs of equal methods are one.
    make, names = METHODS["mipnerf360"]
    state, step = cases.start(poisonable(make(), names))
    drawn = step.func.draw(views, state.step, **step.keywords)
    program = step.func.learn.lower(state, *drawn, **step.keywords).as_text()
    assert not re.search(r"stablehlo\.(case|if)\b", program)
    fresh = copied(state)
    bad = views._replace(camtoworlds=views.camtoworlds.at[1, 0, 3].set(jnp.nan))
    for chosen, steps in ((bad, 0), (views, 1)):
        state, _ = step(state, chosen)
        assert state.step == steps
        same = jax.tree.map(np.array_equal, fresh, state)
        assert all(jax.tree.leaves(same)) == (steps == 0)


def test_a_poisoned_gradient_is_named_with_its_term_and_network(trained, views):
    method, fresh, _ = trained
    for name, network in itertools.product(fresh.params["poison"]["scale"], NETWORKS):
        state = copied(fresh)
        state.params["poison"]["view"][name][network] = jnp.asarray(2.0)
        wanted = f": gradient of the {name} loss in the {network}; in rays of elm"
        assert explain(method, state, views).endswith(f"not finite{wanted}")


def test_a_term_without_a_value_is_named(trained, views):
    method, fresh, _ = trained
    batch = jax.jit(method.draw)(jax.random.key(0), 0, views)
    drawn = ", ".join(NAMES[view] for view in np.unique(batch.view))
    for name in fresh.params["poison"]["scale"]:
        state = copied(fresh)
        state.params["poison"]["scale"][name] = jnp.asarray(3e38)
        line = explain(method, state, views)
        assert f": {name} loss; in rays of {drawn}, all that were drawn; " in line
        assert line.endswith("the parameters reach 3e+38")


def test_parameters_that_are_spoilt_already_are_said_so(trained, views):
    method, fresh, _ = trained
    for name in train_step.networks(fresh.params):
        if name == "poison":
            continue
        state = copied(fresh)
        tree = state.params if name in state.params else state.params["model"]
        leaves, structure = jax.tree.flatten(tree[name])
        leaves[0] = leaves[0].at[0].set(jnp.inf)
        tree[name] = jax.tree.unflatten(structure, leaves)
        line = explain(method, state, views)
        count = leaves[0][0].size
        assert line.endswith(f"not finite: {count} parameters of the {name}")


def test_a_gradient_that_adam_cannot_square_stops_too(trained, views):
    method, fresh, step = trained
    state = copied(fresh)
    state.params["poison"]["scale"]["distortion"] = jnp.asarray(1e13)
    line = explain(method, state, views)
    assert "not finite: gradient of the distortion loss in the field" in line
    assert "; in rays of " in line
    state, stats = step(state, views)
    assert np.isfinite(stats["loss"])
    assert stats["nonfinite_gradients"] > 0
    assert state.step == 0


def test_few_names_of_many_views(monkeypatch):
    """Nine of twelve views, found in parts of two units that mix good and bad."""
    view = np.random.default_rng(0).permutation(np.repeat(np.arange(12), 3))
    bad = set(range(12)) - {2, 5, 11}

    def look(units):
        assert 0 < len(units) <= 2
        return {"data loss"} if bad & set(view[units]) else set()

    assert diagnose.search(look, view, 2) == ({"data loss"}, sorted(bad))
    assert diagnose.search(lambda units: set(), view, 2) == (set(), [])
    monkeypatch.setattr(diagnose, "VIEWS", 4)
    assert diagnose.search(look, view, 2)[1] in ([0, 1, 3], [0, 1, 3, 4])
