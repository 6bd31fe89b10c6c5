"""One training step: gradient, clipping per network, Adam; everything counted.

Notation: params {network: tree}; `step` counts from 0; the learning rate falls
log-linearly after a sine warm-up (arXiv 2111.12077, appendix; mip-NeRF's jaxnerf).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax


class State(NamedTuple):
    """All that a step changes: enough to resume bit for bit."""

    step: Any
    params: Any
    optimizer: Any


def learning_rate(
    step, *, first, last, steps, warmup_steps, warmup_share=0.01
) -> jax.Array:
    """Log-linear from `first` to `last`, times a sine from warmup_share to 1."""
    progress = jnp.clip(step / steps, 0.0, 1.0)
    rate = jnp.exp((1 - progress) * jnp.log(first) + progress * jnp.log(last))
    if warmup_steps == 0:
        return rate
    ramp = jnp.sin(0.5 * jnp.pi * jnp.clip(step / warmup_steps, 0.0, 1.0))
    return rate * (warmup_share + (1 - warmup_share) * ramp)


def make_optimizer(*, learning_rates, steps, warmup_steps, eps) -> Any:
    """Adam (0.9, 0.999, eps) on the schedule above."""
    first, last = learning_rates
    return optax.adam(
        lambda step: learning_rate(
            step, first=first, last=last, steps=steps, warmup_steps=warmup_steps
        ),
        b1=0.9,
        b2=0.999,
        eps=eps,
    )


def clip_per_network(grads, max_norm):
    """Scale each network's gradient to at most max_norm; None leaves it alone."""
    if max_norm is None:
        return grads

    def clip(tree):
        # Norm of the gradient in units of its largest entry: its square may not
        # overflow, or one large gradient would silently become zero.
        largest = jnp.max(
            jnp.stack([jnp.max(jnp.abs(g)) for g in jax.tree.leaves(tree)])
        )
        unit = jnp.maximum(largest, 1e-30)
        norm = unit * optax.tree.norm(jax.tree.map(lambda g: g / unit, tree))
        share = jnp.minimum(1.0, max_norm / jnp.maximum(norm, 1e-30))
        return jax.tree.map(lambda g: g * share, tree)

    model = {name: clip(tree) for name, tree in grads["model"].items()}
    others = {name: clip(tree) for name, tree in grads.items() if name != "model"}
    return {"model": model, **others}


def make_step(method, optimizer, *, steps, gradient_norm, seed):
    """The jitted step: (state, views) -> (state, stats).

    The step's random key is folded from the seed and the step's number, so that
    a resumed run draws what an uninterrupted one would have drawn.
    """

    def step(state, views):
        key = jax.random.fold_in(jax.random.key(seed), state.step)
        share = jnp.clip(state.step / max(steps - 1, 1), 0.0, 1.0)
        (loss, terms), grads = jax.value_and_grad(method.loss, has_aux=True)(
            state.params, views, key, share
        )
        stats = {
            "loss": loss,
            **terms,
            "nonfinite_gradients": count_nonfinite(grads),
        }
        grads = clip_per_network(grads, gradient_norm)
        updates, adam = optimizer.update(grads, state.optimizer, state.params)
        params = optax.apply_updates(state.params, updates)
        return State(state.step + 1, params, adam), stats

    return jax.jit(step, donate_argnums=0)


def count_nonfinite(tree):
    """Number of entries that are NaN or infinite."""
    return sum(jnp.sum(~jnp.isfinite(leaf)) for leaf in jax.tree.leaves(tree))
