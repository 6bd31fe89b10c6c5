"""What a point, a Gaussian or a direction looks like to a network.

Notation: channels first, as in `shading`: x [dimensions, points].
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from alignerf.fields import mlp
from alignerf.mipnerf360 import coord


def positional(
    x: Float[Array, "n points"], degrees: int
) -> Float[Array, "features points"]:
    """[x, sin(2^k x), cos(2^k x)] for k < degrees: n (1 + 2 degrees) features.

    As in NeRF's code, without the factor pi of its Eq. 4.
    """
    scaled = (2.0 ** jnp.arange(degrees))[:, None, None] * x[None]
    sine, cosine = mlp.sine_and_cosine(scaled.reshape(-1, x.shape[-1]))
    return jnp.concatenate([x, sine, cosine])


def integrated_axes(
    gaussians: coord.Gaussians, degrees: int
) -> Float[Array, "features points"]:
    """Mip-NeRF's encoding of Gaussians, axis by axis: 6 degrees features (Eq. 14).

    Of the covariance only its diagonal counts (Eqs. 15 and 16): with t_std along the
    direction d and r_std across, t_std^2 d^2 + r_std^2 (1 - d^2 / |d|^2).
    """
    d = gaussians.direction
    across = 1.0 - d**2 / jnp.sum(d**2, axis=-1, keepdims=True)
    variances = (gaussians.t_std[..., None] * d) ** 2
    variances = variances + gaussians.r_std[..., None] ** 2 * jnp.maximum(across, 0.0)
    means, variances = (part.reshape(-1, 3).T for part in (gaussians.mean, variances))
    return jnp.concatenate(mlp.integrated_encoding(means, variances, degrees))


# Of the real spherical harmonics up to degree 3, in Cartesian form.
SH_0 = 0.28209479177387814
SH_1 = 0.4886025119029199
SH_2 = (1.0925484305920792, 0.31539156525252005, 0.5462742152960396)
SH_3 = (
    *(0.5900435899266435, 2.890611442640554, 0.4570457994644658),
    *(0.3731763325901154, 1.445305721320277),
)


def harmonics(v: Float[Array, "3 points"]) -> Float[Array, "16 points"]:
    """Spherical harmonics of unit directions, as instant-ngp has them (4 bands)."""
    x, y, z = v
    xx, yy, zz = x * x, y * y, z * z
    one = jnp.ones_like(x)
    a, b, c = SH_2
    e, f, g, h, i = SH_3
    return jnp.stack(
        [
            *(SH_0 * one, -SH_1 * y, SH_1 * z, -SH_1 * x),
            *(a * x * y, -a * y * z, b * (3 * zz - 1), -a * x * z, c * (xx - yy)),
            *(e * y * (yy - 3 * xx), f * x * y * z, g * y * (1 - 5 * zz)),
            *(h * z * (5 * zz - 3), g * x * (1 - 5 * zz), i * z * (xx - yy)),
            e * x * (3 * yy - xx),
        ]
    )
