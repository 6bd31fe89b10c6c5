"""Coordinates: Gaussians along a ray, the contraction, normalised distance.

Notation: x a point [..., 3]; t metric distance along a ray and s in [0, 1] its
normalised form; d a ray's unnormalised direction. A Gaussian of a ray has mean x
and covariance t_std^2 d d^T + r_std^2 (I - d d^T / |d|^2): kept in this form, so
that no 3 x 3 matrix is ever built.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

# Of a length: below it a slope of its cube root leaves float32.
TINY = 1e-30


class Gaussians(NamedTuple):
    """Gaussians that stand for the frustums of a ray (mip-NeRF, section 3.1)."""

    mean: Float[Array, "*batch 3"]
    direction: Float[Array, "*batch 3"]
    t_std: Float[Array, "*batch"]
    r_std: Float[Array, "*batch"]


def points(gaussians: Gaussians) -> Gaussians:
    """Their means alone, without extent."""
    nothing = jnp.zeros_like(gaussians.t_std)
    return gaussians._replace(t_std=nothing, r_std=nothing)


def contract(x: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3"]:
    """Map space into the ball of radius 2: x, or (2 - 1/|x|) x/|x| (Eq. 10)."""
    unit, inverse_radius, outside = _polar(x)
    return jnp.where(outside, (2.0 - inverse_radius) * unit, x)


def contract_gaussians(
    gaussians: Gaussians,
) -> tuple[Float[Array, "*batch 3"], Float[Array, "*batch 3 3"]]:
    """Contracted mean, and a square root of the covariance pushed through J.

    The root's rows are the images, under the contraction's Jacobian J, of one
    standard deviation along the ray and two across it; with row r_k, the
    variance along a unit vector p is sum_k (r_k . p)^2 (Eq. 9 without forming
    J Sigma J^T). J stretches by 1/|x|^2 along x and by (2|x| - 1)/|x|^2 across.
    """
    unit, inverse_radius, outside = _polar(gaussians.mean)
    along = inverse_radius**2
    across = (2.0 - inverse_radius) * inverse_radius
    root = _covariance_root(gaussians)
    radial = _project(root, unit)
    # Projected out twice: once leaves a residue along x of float32's rounding, which
    # the stretch across would enlarge over the stretch along by up to 2|x|.
    rest = root - radial
    rest = rest - _project(rest, unit)
    # One stretch at a time: their product with a large deviation stays in range.
    pushed = across[..., None] * rest + along[..., None] * radial
    return contract(gaussians.mean), jnp.where(outside[..., None], pushed, root)


def contract_spheres(
    gaussians: Gaussians,
) -> tuple[Float[Array, "*batch 3"], Float[Array, "*batch"]]:
    """Contracted mean, and the radius of the sphere with the Gaussian's volume.

    The radius is the geometric mean of the three standard deviations after the
    contraction, det(J Sigma J^T)^(1/6) (zip-NeRF, arXiv 2304.06706, section 2).
    """
    inverse_radius = _polar(gaussians.mean)[1][..., 0]
    # One factor at a time: neither the squared radius nor the product of the
    # deviations is in float32's range far out.
    length_std = gaussians.t_std * jnp.linalg.norm(gaussians.direction, axis=-1)
    along_std = inverse_radius * (inverse_radius * length_std)
    across_std = (2.0 - inverse_radius) * (inverse_radius * gaussians.r_std)
    # A cube root has no slope at 0, where a deviation is so small, or so far out.
    along_std, across_std = jnp.maximum(along_std, TINY), jnp.maximum(across_std, TINY)
    return contract(gaussians.mean), cube_root(along_std) * cube_root(across_std) ** 2


def cube_root(x):
    """Of positive values: on a CPU ten times as fast as `cbrt`, which is scalar there.

    Its relative error is below 3e-6 in all of float32's normal numbers.
    """
    return jnp.exp(jnp.log(x) / 3.0)


def _polar(x):
    """Unit vector, 1/|x| and whether |x| > 1; (0, 1) stand in inside the ball.

    The stand-ins keep the gradient finite at 0, the scale keeps |x|^2 in range (up
    to 1e37, beyond which float32 has no reciprocal).
    """
    # Nothing depends on the scale. Its gradient would be 0 / 0 where the compiler works
    # x out twice, to other roundings, and finds no entry that is the largest.
    largest = jnp.max(jnp.abs(jax.lax.stop_gradient(x)), axis=-1, keepdims=True)
    scale = jnp.maximum(largest, 1.0)
    scaled = x / scale
    outside = jnp.sum(scaled**2, axis=-1, keepdims=True) * scale > 1.0 / scale
    safe = jnp.where(outside, scaled, jnp.array([1.0, 0.0, 0.0], x.dtype))
    length = jnp.sqrt(jnp.sum(safe**2, axis=-1, keepdims=True))
    unit = jnp.where(outside, safe / length, 0.0)
    return unit, jnp.where(outside, 1.0 / (length * scale), 1.0), outside


def _project(rows, unit):
    """The part along `unit` [..., 3] of each of the rows [..., 3, 3]."""
    along = jnp.sum(rows * unit[..., None, :], axis=-1, keepdims=True)
    return along * unit[..., None, :]


def _covariance_root(gaussians):
    """Rows [..., 3, 3]: t_std d, and r_std times two unit vectors across d."""
    d = gaussians.direction
    unit = d / jnp.linalg.norm(d, axis=-1, keepdims=True)
    # Branch-free orthonormal basis (Duff et al. 2017): no cross product vanishes.
    x, y, z = unit[..., 0], unit[..., 1], unit[..., 2]
    sign = jnp.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = jnp.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = jnp.stack([b, sign + y * y * a, -y], axis=-1)
    across = gaussians.r_std[..., None]
    return jnp.stack(
        [gaussians.t_std[..., None] * d, across * first, across * second], axis=-2
    )


def s_to_t(
    s: Float[Array, "*batch"],
    near: float | Float[Array, "*#batch"],
    far: float | Float[Array, "*#batch"],
) -> Float[Array, "*batch"]:
    """Metric distance of normalised distance s, uniform in 1/t (Eq. 11).

    The shares of 1/near and 1/far are added, not subtracted from one another: at
    s = 1 the difference of 1 and 1 - near/far has no digits left in float32.
    """
    return near / ((1.0 - s) + s * (near / far))
