"""One training step: gradient, clipping per network, Adam; everything counted.

Notation: params {network: tree}; `step` counts from 0; the learning rate falls
log-linearly after a sine warm-up (arXiv 2111.12077, appendix; mip-NeRF's jaxnerf).
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from alignerf.kernels import calls
from alignerf.processes import devices
from alignerf.training import gradients


class State(NamedTuple):
    """All that a step changes: enough to resume bit for bit."""

    step: Any
    params: Any
    optimizer: Any


class Schedule(NamedTuple):
    """How long a training is, and its seed: inputs of the compiled step, scalars.

    With a budget its length is known only when the compiled step has been timed; and
    trainings that differ in their seed alone share a compiled program.
    """

    steps: Any  # int32, as warmup_steps
    warmup_steps: Any
    seed: Any  # uint32


def inverse(count) -> jax.Array:
    """1 / count as float32.

    A product with it is what a division by a constant is compiled to: trainings have
    the same bits whether their length is compiled in or not.
    """
    return 1.0 / jnp.asarray(count, jnp.float32)


def learning_rate(
    step, *, first, last, steps, warmup_steps, hold_fraction=0.0, warmup_fraction=0.01
) -> jax.Array:
    """`first` for a share of the steps, then log-linear to `last`; at the start a sine.

    The sine rises from warmup_fraction to 1. As published nothing is held.
    """
    passed = step * inverse(steps)
    progress = jnp.clip((passed - hold_fraction) / (1.0 - hold_fraction), 0.0, 1.0)
    rate = jnp.exp((1 - progress) * jnp.log(first) + progress * jnp.log(last))
    warmed = jnp.clip(step * inverse(jnp.maximum(warmup_steps, 1)), 0.0, 1.0)
    ramp = warmup_fraction + (1 - warmup_fraction) * jnp.sin(0.5 * jnp.pi * warmed)
    return rate * jnp.where(warmup_steps == 0, 1.0, ramp)


class Adam(NamedTuple):
    """The settings of `make_optimizer`, equal by value; called, its optimizer."""

    learning_rates: tuple
    betas: tuple
    eps: float
    hold_fraction: float = 0.0
    cameras: Any = None
    native: bool = False
    running_means: tuple = ()

    def __call__(self, schedule: Schedule):
        length = {"steps": schedule.steps, "warmup_steps": schedule.warmup_steps}
        return make_optimizer(**self._asdict(), **length)


def make_optimizer(
    *,
    learning_rates,
    betas,
    eps,
    cameras=None,
    native=False,
    running_means=(),
    **schedule,
) -> Any:
    """Adam on the schedule above, whose other arguments are `schedule`'s.

    cameras: a `PoseOptimization` where the parameters `cameras` are learnt too; these
    have a schedule of their own and Adam's usual constants. native: whether the kernels
    are there. running_means: of `methods.Method`.
    """
    first, last = learning_rates

    def rate(step):
        return learning_rate(step, first=first, last=last, **schedule)

    fields = optax.adam(rate, *betas, eps=eps)
    if native:
        fields = resting_natively(fields, rate, betas=betas, eps=eps)
    else:
        fields = resting(fields)
    others = {name: optax.sgd(rate) for name, rate in running_means}
    if cameras is None and not others:
        return fields

    def between(step):
        begin, end = cameras.delay_fraction, cameras.end_fraction
        passed = (step * inverse(schedule["steps"]) - begin) / (end - begin)
        first, last = cameras.learning_rates
        rate = learning_rate(passed, first=first, last=last, steps=1, warmup_steps=0)
        return jnp.where((passed >= 0) & (passed < 1), rate, 0.0)

    if cameras is not None:
        learnt = waiting(optax.scale_by_adam()), optax.scale_by_learning_rate(between)
        others["cameras"] = optax.chain(*learnt)
    return optax.multi_transform(
        {"fields": fields, **others},
        lambda params: {name: name if name in others else "fields" for name in params},
    )


def waiting(adam) -> optax.GradientTransformation:
    """Adam, whose steps count from the first gradient that is not zero.

    Else its means, corrected for steps that learnt nothing, would start too large.
    """

    def update(grads, state, params=None):
        begun = sum(jnp.sum(grad != 0) for grad in jax.tree.leaves(grads)) > 0
        updates, after = adam.update(grads, state, params)
        return updates, jax.tree.map(lambda a, b: jnp.where(begun, a, b), after, state)

    return optax.GradientTransformation(adam.init, update)


def resting(adam) -> optax.GradientTransformation:
    """Adam, but an entry of a grid's table rests where its gradient is zero.

    No ray has touched it: what it has learnt, and how sure that is, stay as they were
    (as in instant-ngp). Left to Adam it would drift on after its last ray, and forget
    the size of its gradients.
    """

    def update(grads, state, params=None):
        updates, after = adam.update(grads, state, params)

        def keep(new, old):
            return jax.tree_util.tree_map_with_path(
                lambda path, grad, n, o: (
                    jnp.where(grad == 0, o, n) if is_table(path) else n
                ),
                *(grads, new, old),
            )

        (moments, *rest), before = after, state[0]
        moments = moments._replace(
            mu=keep(moments.mu, before.mu), nu=keep(moments.nu, before.nu)
        )
        return keep(updates, jax.tree.map(jnp.zeros_like, updates)), (moments, *rest)

    return optax.GradientTransformation(adam.init, update)


def resting_natively(adam, rate, *, betas, eps) -> optax.GradientTransformation:
    """`resting` with a kernel for the tables: one pass over each instead of a dozen.

    rate: the learning rate, a function of the step.
    """

    def update(grads, state, params=None):
        (moments, *rest), count = state, state[0].count

        def without(tree):
            return jax.tree_util.tree_map_with_path(
                lambda path, leaf: leaf.ravel()[:1] if is_table(path) else leaf, tree
            )

        few = moments._replace(mu=without(moments.mu), nu=without(moments.nu))
        updates, (few, *rest) = adam.update(without(grads), (few, *rest), params)
        numbers = {"rate": rate(count), "count": count + 1, "betas": betas, "eps": eps}

        def of_tables(path, grad, mu, nu, *others):
            if not is_table(path):
                return others
            return calls.adam(grad, mu, nu, **numbers)

        found = jax.tree_util.tree_map_with_path(
            of_tables, grads, moments.mu, moments.nu, updates, few.mu, few.nu
        )
        updates, mu, nu = jax.tree.transpose(
            jax.tree.structure(grads), jax.tree.structure((0, 0, 0)), found
        )
        return updates, (few._replace(mu=mu, nu=nu), *rest)

    return optax.GradientTransformation(adam.init, update)


def is_table(path) -> bool:
    """Whether the path of a parameter is that of a hash grid's table."""
    return getattr(path[-1], "key", None) == "table"


def clip_per_network(grads, max_norm, but=()):
    """Scale each network's gradient to at most max_norm; None leaves it alone.

    but: names of what is no network.
    """
    if max_norm is None:
        return grads

    def clip(tree):
        # Norm of the gradient in units of its largest entry: its square may not
        # overflow, or one large gradient would silently become zero.
        largest = jnp.max(
            jnp.stack([jnp.max(jnp.abs(g)) for g in jax.tree.leaves(tree)])
        )
        unit = jnp.maximum(largest, 1e-30)
        scaled = jax.tree.map(lambda g: g / unit, tree)
        limit = max_norm / optax.tree.norm(scaled)
        return jax.tree.map(
            lambda g, s: jnp.where(unit <= limit, g, s * limit), tree, scaled
        )

    model = {name: clip(tree) for name, tree in grads["model"].items()}
    others = {
        name: tree if name in but else clip(tree)
        for name, tree in grads.items()
        if name != "model"
    }
    return {"model": model, **others}


def networks(params):
    """{name: tree} of the networks: the model's two fields, and the head if any."""
    others = {name: tree for name, tree in params.items() if name != "model"}
    return {**params["model"], **others}


class Step(NamedTuple):
    """A step: (state, views, Schedule) -> (state, numbers to show), in two programs.

    draw: (views, step, Schedule) -> (batch, share of the training that has passed). It
    compiles in a moment, for each scene. learn: (state, batch, share, Schedule) ->
    (state, numbers) is all else, and the same for all scenes of a model.
    """

    draw: Any
    learn: Any

    def __call__(self, state, views, schedule):
        return self.learn(state, *self.draw(views, state.step, schedule), schedule)

    def compiled(self, state, views, schedule):
        """The step of inputs of these shapes."""
        draw = self.draw.lower(views, state.step, schedule).compile()
        shapes = jax.eval_shape(self.draw, views, state.step, schedule)
        drawn = jax.tree.map(
            lambda x, where: jax.ShapeDtypeStruct(x.shape, x.dtype, sharding=where),
            *(shapes, draw.output_shardings),
        )
        return Step(draw, self.learn.lower(state, *drawn, schedule).compile())


@functools.cache
def make_draw(method_draw, mesh=None):
    """The jitted `Step.draw`: each device of a mesh draws its share of the units.

    All follows from the seed and the step's number, so that a resumed run draws what
    an uninterrupted one would have drawn.
    """

    def draw(views, step, schedule):
        passed = step * inverse(jnp.maximum(schedule.steps - 1, 1))
        batch = method_draw(jax.random.key(schedule.seed), step, views)
        return batch, jnp.clip(passed, 0.0, 1.0)

    # A prefix of (batch, share).
    split = mesh and (gradients.by_units(mesh), devices.everywhere(mesh))
    return jax.jit(draw, out_shardings=split)


def make_step(
    method, optimizer_of, *, gradient_norm, micro_batches=1, mesh=None
) -> Step:
    """The jitted step of a method.

    The programs of equal arguments are one, traced once in a process.
    optimizer_of(Schedule) is the optimizer, as an `Adam` gives it; what it keeps does
    not depend on that.
    Where the loss or the gradient is not finite, the state stays as it was, so that
    whoever looks at the numbers later still holds what failed.
    """
    learn = make_learn(
        *(method.terms, optimizer_of, gradient_norm),
        *(tuple(dict(method.running_means)), micro_batches, mesh),
    )
    return Step(make_draw(method.draw, mesh), learn)


@functools.cache
def make_learn(terms, optimizer_of, gradient_norm, no_networks, micro_batches, mesh):
    """The jitted `Step.learn`; no_networks: parameters that are not clipped."""

    def learn(state, batch, share, schedule):
        (loss, shown), grads = gradients.mean(
            terms, state.params, batch, share, micro_batches=micro_batches, mesh=mesh
        )
        grads = clip_per_network(grads, gradient_norm, no_networks)
        nonfinite = count_nonfinite_squares(grads)

        def update(state):
            optimizer = optimizer_of(schedule)
            updates, adam = optimizer.update(grads, state.optimizer, state.params)
            params = optax.apply_updates(state.params, updates)
            return State(state.step + 1, params, adam)

        finite = jnp.isfinite(loss) & (nonfinite == 0)
        if calls.on_cpu():
            state = jax.lax.cond(finite, update, lambda state: state, state)
        else:
            # A condition is read on the host: the device would wait for it.
            choose = functools.partial(jnp.where, finite)
            state = jax.tree.map(choose, update(state), state)
        psnr_db = mse_to_psnr(shown.pop("mse"))
        return state, {
            "loss": loss,
            "psnr_db": psnr_db,
            **shown,
            "nonfinite_gradients": nonfinite,
        }

    everywhere = mesh and devices.everywhere(mesh)
    return jax.jit(learn, donate_argnums=0, out_shardings=everywhere)


def mse_to_psnr(mse):
    """Decibels for colours in [0, 1], at most 100."""
    return -10.0 / jnp.log(10.0) * jnp.log(jnp.maximum(mse, 1e-10))


def count_nonfinite_squares(tree):
    """Number of entries that Adam cannot square: NaN, infinite or beyond 1.8e19.

    An infinite second moment would hold its parameter still for ever.
    """
    leaves = [leaf.ravel() for leaf in jax.tree.leaves(tree)]

    def count():
        return sum(jnp.sum(~jnp.isfinite(leaf**2)) for leaf in leaves)

    if not calls.on_cpu():
        return count()
    # A finite sum has no such entry, and is a fifth of the work of counting them.
    total = sum(jnp.sum(leaf**2) for leaf in leaves)
    return jax.lax.cond(jnp.isfinite(total), lambda: jnp.int32(0), count)
