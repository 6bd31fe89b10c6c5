"""The field as published: integrated positional encoding into one MLP.

Notation: P [3, 21] directions of a twice-tessellated icosahedron's half, x a
contracted mean [..., 3], variances along P [..., 21], L degrees 0 .. L - 1.
arXiv 2111.12077, section 5 and appendix.
"""

import itertools
import math

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from alignerf.fields import shading
from alignerf.mipnerf360 import coord


def icosahedral_basis(subdivisions: int = 2) -> np.ndarray:
    """Unit vectors [3, n] of a tessellated icosahedron, one of each +- pair.

    n = 21 at 2 subdivisions per edge.
    """
    golden = (math.sqrt(5) + 1) / 2
    vertices = np.array(
        [
            turn
            for a, b in itertools.product((-1, 1), (-golden, golden))
            for turn in ((a, b, 0), (0, a, b), (b, 0, a))
        ]
    ) / math.sqrt(golden + 2)
    distance = np.linalg.norm(vertices[:, None] - vertices[None], axis=-1)
    adjacent = distance < 1.1 * np.min(distance[distance > 1e-6])
    faces = [
        face
        for face in itertools.combinations(range(12), 3)
        if all(adjacent[i, j] for i, j in itertools.combinations(face, 2))
    ]
    shares = [
        (i, j, subdivisions - i - j)
        for i in range(subdivisions + 1)
        for j in range(subdivisions + 1 - i)
    ]
    points = np.concatenate([np.array(shares) @ vertices[list(f)] for f in faces])
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    kept = []
    for point in points:
        if all(abs(abs(point @ other) - 1) > 1e-6 for other in kept):
            kept.append(point)
    return np.stack(kept, axis=1)


def integrated_encoding(
    means: Float[Array, "n *batch"], variances: Float[Array, "n *batch"], degrees: int
) -> tuple[Float[Array, "features *batch"], Float[Array, "features *batch"]]:
    """E[sin(2^l x)] and E[cos(2^l x)] of x ~ N(mean, variance) (mip-NeRF, Eq. 14).

    Two arrays of degrees n features. float32 always: at degree 12 bfloat16's error
    exceeds the period.
    """
    scales = 2.0 ** np.arange(degrees, dtype=np.float32).reshape(-1, *[1] * means.ndim)
    sine, cosine = sine_and_cosine(means[None] * scales)
    # Beyond 80 the attenuation is zero in float32; the cap keeps 4^l var finite.
    var = jnp.minimum(variances, 1e12)[None] * scales**2
    damp = jnp.exp(-0.5 * jnp.minimum(var, 160.0))
    shape = (degrees * len(means), *means.shape[1:])
    return (sine * damp).reshape(shape), (cosine * damp).reshape(shape)


# sin(2 pi q) / q as a polynomial in q^2, minimax on |q| <= 1/4: 3e-9, so that only
# float32's rounding is left.
SINE = (6.2831850, -41.3416557, 81.6010056, -76.5497818, 39.5367050)


# 2 pi in three parts. The first two have few digits, so that their products with up
# to 2^13 turns are exact, and so are the differences.
TURN = (6.28125, 2029.0 * 2.0**-20, 2 * np.pi - 6.28125 - 2029.0 * 2.0**-20)


def sine_and_cosine(x):
    """sin(x) and cos(x), to 5e-7 for |x| up to 5e4, and bounded beyond.

    XLA's sine on a CPU is one call an element; these few products vectorise, and the
    encoding, most of the baseline's time, takes a tenth of it.
    """
    turns = jnp.round(x * np.float32(1 / (2 * np.pi)))
    for part in TURN:
        x = x - turns * np.float32(part)
    # Near half a turn rounding takes one turn for the next: a little more than half of
    # one is left, and what follows is right for it. Beyond, x has no such digits.
    rest = jnp.clip(x * np.float32(1 / (2 * np.pi)), -0.51, 0.51)
    quarter = jnp.minimum(jnp.maximum(rest, -0.5 - rest), 0.5 - rest)
    return _sine(quarter), _sine(0.25 - jnp.abs(rest))


def _sine(q):
    square = q * q
    series = SINE[-1]
    for coefficient in SINE[-2::-1]:
        series = coefficient + square * series
    return q * series


def project(mean, root):
    """Means and variances [21, n] of Gaussians [n, 3], [n, 3, 3] along P."""
    directions = np.float32(icosahedral_basis().T)

    def onto(x):
        # In full: a GPU's default product has 11 bits, 2 radians' error at degree 11.
        return jnp.matmul(directions, x.T, precision="highest")

    variances = sum(onto(root[:, row]) ** 2 for row in range(3))
    # Else XLA computes them anew for each of the encoding's degrees.
    return jax.lax.optimization_barrier((onto(mean), variances))


class Mlp(nn.Module):
    """Density from `depth` layers of `width`; values from a view-dependent head."""

    width: int = 1024
    depth: int = 8
    skip_every: int = 4
    degrees: int = 12
    bottleneck: int = 256
    view_width: int = 128
    outputs: int = 3
    precision: str = "float32"

    @nn.compact
    def __call__(self, gaussians, viewdirs=None, fineness=None):
        mean, root = coord.contract_gaussians(gaussians)
        batch = mean.shape[:-1]
        means, variances = project(mean.reshape(-1, 3), root.reshape(-1, 3, 3))
        encoded = integrated_encoding(means, variances, self.degrees)
        if fineness is not None:
            weights = shading.fine_weights(fineness, self.degrees)
            weights = jnp.repeat(weights, len(means))[:, None]
            encoded = tuple(weights * part for part in encoded)
        x = encoded
        for layer in range(self.depth):
            x = (nn.relu(shading.Dense(self.width, self.precision)(*x)),)
            if layer > 0 and layer % self.skip_every == 0:
                x = (*x, *encoded)
        raw = shading.Dense(1, self.precision, name="density")(*x)
        density = shading.density_of(raw).reshape(batch)
        if viewdirs is None:
            return density, None
        b = shading.Dense(self.bottleneck, self.precision, name="bottleneck")(*x)
        head = shading.Shading(
            (self.view_width,), self.outputs, self.precision, name="head"
        )
        return density, head(b, viewdirs).reshape(-1, *batch)
