"""The kernels as functions of JAX arrays, where `use` has said that they are there.

Shapes are those of their twins: `fields.grid`, `mipnerf360.stepfun`, `training.step`.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.kernels import build

NAMES = ("lookup", "lookup_gradient", "resample", "interlevel", "adam")


def on_cpu() -> bool:
    """Whether JAX computes on a CPU, whose caches some loops are written for.

    An accelerator takes each of these as one operation over all at once.
    """
    return jax.default_backend() == "cpu"


def use(choice) -> bool:
    """Whether the kernels are used, of a `training.kernels`; they are loaded then.

    auto: where JAX computes on a CPU, and they can be compiled. Raises ValueError where
    they are asked for, and cannot be.
    """
    if choice == "jax":
        return False
    if not on_cpu():
        if choice == "native":
            platform = jax.default_backend()
            raise ValueError(
                f"config: training.kernels: native is for a CPU: {platform}"
            )
        return False
    if choice == "native" and build.library() is None:
        raise ValueError("config: training.kernels: native: not there, see the log")
    return register()


def name_of(choice) -> str:
    """`native` or `jax`: what `use` has come to."""
    return "native" if use(choice) else "jax"


@functools.cache
def register() -> bool:
    """Tell JAX of the kernels, once a process; False where there are none."""
    if (library := build.library()) is None:
        return False
    for name in NAMES:
        target = jax.ffi.pycapsule(getattr(library, f"alignerf_{name}"))
        jax.ffi.register_ffi_target(f"alignerf_{name}", target, platform="cpu")
    return True


def call(name, made, *arrays, in_place=None, **numbers):
    """What a kernel makes of arrays; made: `floats`, or a tuple of them.

    in_place: {index of an array: index of what may be written over it}.
    """
    kernel = jax.ffi.ffi_call(
        f"alignerf_{name}", made, input_output_aliases=in_place or {}
    )
    return kernel(*(jnp.asarray(array, jnp.float32) for array in arrays), **numbers)


def floats(*shape):
    """An array that a kernel makes."""
    return jax.ShapeDtypeStruct(shape, jnp.float32)


def layout(levels):
    """The numbers of a `grid.Levels`."""
    return {
        "resolutions": np.array(levels.resolutions, np.int32),
        "entries": np.array(levels.entries, np.int32),
    }


@functools.partial(jax.custom_vjp, nondiff_argnums=(3, 4))
def look_up(table, points, share, levels, moving=False):
    """Features [levels * features, n] of table [rows, features], times their share.

    points [3, n] in [0, 1]; share [levels, n]. Differentiable in the table and, where
    the points are `moving`, in points and shares.
    """
    made = floats(len(levels.resolutions) * table.shape[1], points.shape[1])
    return call("lookup", made, table, points, share, **layout(levels))


def _look_up_forward(table, points, share, levels, moving):
    # Of a table whose points stay its width alone.
    kept = table if moving else jnp.zeros((0, table.shape[1]))
    return look_up(table, points, share, levels), (kept, points, share)


def _look_up_backward(levels, moving, residuals, found_grad):
    table, points, share = residuals
    made = [floats(sum(levels.entries), table.shape[1])]
    made += [floats(*(x.shape if moving else (0,))) for x in (points, share)]
    numbers = layout(levels)
    grads = call("lookup_gradient", tuple(made), *residuals, found_grad, **numbers)
    if moving:
        return tuple(grads)
    return grads[0], jnp.zeros_like(points), jnp.zeros_like(share)


look_up.defvjp(_look_up_forward, _look_up_backward)


def resample(t, w, jitter, anneal, count, *, dilation=None):
    """Edges [rays, count + 1] drawn from w^anneal [rays, bins], dilated before.

    t [rays, bins + 1]; jitter [rays] or None. It has no gradient.
    """
    return call(
        "resample",
        floats(len(t), count + 1),
        t,
        w,
        jnp.zeros(1) if jitter is None else jitter,
        jnp.reshape(anneal, 1),
        dilation=np.float32(-1 if dilation is None else dilation),
        jittered=jitter is not None,
    )


@jax.custom_vjp
def interlevel(t, w, t_proposal, w_proposal):
    """`stepfun.interlevel_loss` [rays] of t [rays, bins + 1], w [rays, bins]."""
    return _interlevel(t, w, t_proposal, w_proposal)[0]


def _interlevel(t, w, t_proposal, w_proposal):
    made = floats(len(t)), floats(*w_proposal.shape)
    return call("interlevel", made, t, w, t_proposal, w_proposal)


def _interlevel_backward(residuals, loss_grad):
    grad, *others = residuals
    return (*map(jnp.zeros_like, others), loss_grad[:, None] * grad)


def _interlevel_forward(t, w, t_proposal, w_proposal):
    loss, grad = _interlevel(t, w, t_proposal, w_proposal)
    return loss, (grad, t, w, t_proposal)


interlevel.defvjp(_interlevel_forward, _interlevel_backward)


def adam(grad, mu, nu, *, rate, count, betas, eps):
    """(update, mu, nu) of a table after a step; entries without a gradient rest.

    rate: the learning rate; count: steps, with this one.
    """
    first, second = betas
    scales = jnp.stack([rate, 1 - first**count, 1 - second**count])
    numbers = {"beta_1": first, "beta_2": second, "eps": eps}
    numbers |= {"rest_1": 1 - first, "rest_2": 1 - second}
    numbers = {name: np.float32(number) for name, number in numbers.items()}
    made, in_place = (floats(*grad.shape),) * 3, {1: 1, 2: 2}
    return call("adam", made, grad, mu, nu, scales, in_place=in_place, **numbers)
