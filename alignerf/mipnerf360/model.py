"""The baseline: proposal fields narrow down where a ray's samples go.

Notation: sdist / tdist normalised / metric interval edges [rays, edges]; weights
[rays, edges - 1]; values [rays, c] what the last field says, integrated.
arXiv 2111.12077, section 3 (coarse-to-fine online distillation).
"""

from collections.abc import Sequence
from typing import NamedTuple

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from alignerf.kernels import calls
from alignerf.mipnerf360 import coord, render, stepfun

DILATION_MULTIPLIER = 0.5
DILATION_BIAS = 0.0025
ANNEAL_SLOPE = 10.0


class Rendering(NamedTuple):
    """What a batch of rays gives.

    histograms: (sdist, weights) of each sampling round; none without proposals. coarse:
    of systems that look twice, what the first look saw.
    """

    values: Float[Array, "rays c"]
    depth: Float[Array, "rays"]
    histograms: Sequence[tuple[Array, Array]] = ()
    coarse: Sequence[Array] = ()


class Model(nn.Module):
    """A proposal field used once per early round of `samples`, then the field.

    With one round there is no proposal: a ray's samples are evenly spread. Fields see
    positions in units of `radius`: nothing within it is contracted. A ray ends opaque,
    or before a `background` that is known; to the proposals it always ends opaque.
    Without `near`, `far` and `radius` each ray brings them: see `for_any_scene`.
    """

    proposal: nn.Module | None
    field: nn.Module
    samples: Sequence[int]
    near: float | None
    far: float | None
    radius: float | None = 1.0
    background: str | None = None
    # Whether the kernels are there, see `alignerf.kernels`.
    native: bool = False

    @property
    def jitters(self):
        """Random numbers that a ray takes: one for each round of samples."""
        return len(self.samples)

    def for_any_scene(self):
        """(the model without near, far and radius, these): one program for them all."""
        bounds = self.near, self.far, self.radius
        return self.clone(near=None, far=None, radius=None), bounds

    def __call__(
        self,
        rays,
        *,
        jitter=None,
        train_fraction=1.0,
        proposal_fraction=1.0,
        fineness=None,
    ) -> Rendering:
        """Render rays [n]; `jitter` [n, rounds] in [0, 1) moves their samples.

        `train_fraction` in [0, 1] anneals the resampling weights early in training.
        The first `proposal_fraction` of the rays carry a gradient to the proposals.
        `fineness` in [0, 1] hides what is fine in the field's input; None shows all.
        """
        near, far, radius = self.near, self.far, self.radius
        if rays.bounds is not None:
            near, far, radius = jnp.split(rays.bounds, 3, axis=-1)
        cones = [x / radius for x in (rays.origins, rays.directions, rays.radii)]
        sdist = jnp.broadcast_to(jnp.array([0.0, 1.0]), (len(rays.origins), 2))
        weights = jnp.ones((len(rays.origins), 1))
        histograms, drawn = [], 1
        for number, count in enumerate(self.samples):
            last = number == len(self.samples) - 1
            wide = DILATION_BIAS + DILATION_MULTIPLIER / drawn if number > 0 else None
            drawn *= count
            anneal = stepfun.anneal_exponent(train_fraction, slope=ANNEAL_SLOPE)
            moved = None if jitter is None else jitter[:, number]
            resample = calls.resample if self.native else stepfun.resample
            # Where to look is learnt by the proposal's own loss alone; a gradient
            # through the positions is noisy and costs a third of the step.
            known = jax.lax.stop_gradient((sdist, weights))
            sdist = resample(*known, moved, anneal, count, dilation=wide)
            tdist = coord.s_to_t(sdist, near, far)
            gaussians = render.cast_cones(tdist, *cones)
            if last:
                hidden = {} if fineness is None else {"fineness": fineness}
                density, values = self.field(gaussians, rays.viewdirs, **hidden)
            else:
                density = self.propose(gaussians, proposal_fraction)
            weights = render.alpha_weights(
                density,
                tdist,
                rays.directions,
                opaque=self.background is None or not last,
            )
            histograms.append((sdist, weights))
        values = render.integrate(weights, values)
        if self.background is not None:
            values = render.before(self.background, values, weights)
        return Rendering(
            values=values,
            depth=render.median_distance(weights, tdist),
            histograms=histograms,
        )

    def propose(self, gaussians, share):
        """Density [rays, bins] by the proposal; a share of the rays teaches it.

        Its loss says nothing of a photo, and moves no camera.
        """
        gaussians = jax.lax.stop_gradient(gaussians)
        rays = len(gaussians.mean)
        teaching = max(1, round(share * rays))
        if teaching == rays:
            return self.proposal(gaussians, None)[0]
        first, rest = (
            self.proposal(part, None)[0]
            for part in (
                jax.tree.map(lambda x: x[:teaching], gaussians),
                jax.tree.map(lambda x: x[teaching:], gaussians),
            )
        )
        # Its gradient is not computed at all, which is most of the proposal's cost.
        return jnp.concatenate([first, jax.lax.stop_gradient(rest)])
