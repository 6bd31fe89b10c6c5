"""The field as published: integrated positional encoding into one MLP.

Notation: P [3, 21] directions of a twice-tessellated icosahedron's half, x a
contracted mean [..., 3], variances along P [..., 21], L degrees 0 .. L - 1.
arXiv 2111.12077, section 5 and appendix.
"""

import itertools
import math

import flax.linen as nn
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
    means: Float[Array, "*batch n"], variances: Float[Array, "*batch n"], degrees: int
) -> Float[Array, "*batch features"]:
    """E[sin(2^l x)] and E[cos(2^l x)] of x ~ N(mean, variance) (mip-NeRF, Eq. 14).

    float32 always: at degree 12 bfloat16's error exceeds the period.
    """
    scales = 2.0 ** jnp.arange(degrees, dtype=means.dtype)
    shape = (*means.shape[:-1], degrees * means.shape[-1])
    x = (means[..., None, :] * scales[:, None]).reshape(shape)
    # Beyond 80 the attenuation is zero in float32; the cap keeps 4^l var finite.
    var = jnp.minimum(variances[..., None, :], 1e12) * scales[:, None] ** 2
    damp = jnp.exp(-0.5 * jnp.minimum(var, 160.0)).reshape(shape)
    return jnp.concatenate([jnp.sin(x) * damp, jnp.cos(x) * damp], axis=-1)


class Mlp(nn.Module):
    """Density from `depth` layers of `width`; values from a view-dependent head."""

    width: int = 1024
    depth: int = 8
    skip_every: int = 4
    degrees: int = 12
    bottleneck: int = 256
    view_width: int = 128
    outputs: int = 3

    @nn.compact
    def __call__(self, gaussians, viewdirs=None):
        basis = jnp.asarray(icosahedral_basis(), jnp.float32)
        mean, root = coord.contract_gaussians(gaussians)
        variances = jnp.sum((root @ basis) ** 2, axis=-2)
        encoded = integrated_encoding(mean @ basis, variances, self.degrees)
        x = encoded
        for layer in range(self.depth):
            x = nn.relu(shading.dense(self.width)(x))
            if layer > 0 and layer % self.skip_every == 0:
                x = jnp.concatenate([x, encoded], axis=-1)
        density = shading.density_of(shading.dense(1, name="density")(x)[..., 0])
        if viewdirs is None:
            return density, None
        b = shading.dense(self.bottleneck, name="bottleneck")(x)
        head = shading.Shading((self.view_width,), self.outputs, name="head")
        return density, head(b, viewdirs)
