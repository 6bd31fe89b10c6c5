"""The papers' formulas as printed, in float64: slow twins of the baseline.

Nothing here comes from the code under test. Notation: x, d points and directions
[..., 3]; t [..., edges] interval edges, w [..., edges - 1] weights; equation
numbers without a paper are those of mip-NeRF 360, arXiv 2111.12077.
"""

import itertools
from fractions import Fraction

import jax.numpy as jnp
import numpy as np

PRIMES = (1, 2654435761, 805459861)


def f32(*arrays):
    """What the code under test is given."""
    return [jnp.asarray(a, jnp.float32) for a in arrays]


def f64(*arrays):
    """The same numbers for a twin: no error of the input is counted."""
    return [np.asarray(a, np.float64) for a in arrays]


def assert_close(found, wanted, *, rtol=1e-5, scale=None, atol=0.0):
    """|found - wanted| <= rtol scale + atol everywhere, scale by default |wanted|."""
    scale = np.abs(wanted) if scale is None else scale
    error = np.abs(np.asarray(found, np.float64) - wanted)
    worst = np.max(error - rtol * scale - atol)
    assert worst <= 0, f"{np.max(error / np.maximum(scale, 1e-300))} relative at worst"


def contract(x):
    """Eq. 10; complex numbers pass through, for derivatives."""
    r = np.sqrt((x**2).sum(axis=-1, keepdims=True))
    inside = r.real <= 1
    r = np.where(inside, 1, r)
    return np.where(inside, x, (2 - 1 / r) * x / r)


def contraction_jacobian(x):
    """J of Eq. 10 [..., 3, 3] by complex steps: exact to rounding."""
    steps = 1e-30j * np.eye(3)
    return np.stack([contract(x + step).imag for step in steps], axis=-1) / 1e-30


def ray_covariance(d, t_std, r_std):
    """t_std^2 d d^T + r_std^2 (I - d d^T / |d|^2) (arXiv 2103.13415, Eq. 8)."""
    outer = d[..., :, None] * d[..., None, :]
    across = np.eye(3) - outer / (d**2).sum(axis=-1)[..., None, None]
    t_std, r_std = t_std[..., None, None], r_std[..., None, None]
    return t_std**2 * outer + r_std**2 * across


def push_forward(x, covariance):
    """J Sigma J^T (Eq. 9)."""
    jacobian = contraction_jacobian(x)
    return jacobian @ covariance @ np.swapaxes(jacobian, -1, -2)


def ray_distance(s, near, far):
    """t(s) = g^-1(s g(far) + (1 - s) g(near)) of g = 1 / t (Eq. 11)."""
    return 1 / (s / far + (1 - s) / near)


def normalised_distance(t, near, far):
    """s(t) = (g(t) - g(near)) / (g(far) - g(near)) of g = 1 / t (Eq. 11)."""
    return (1 / t - 1 / near) / (1 / far - 1 / near)


def frustum_moments(t0, t1, radius):
    """Mean and variance along a cone, variance across (arXiv 2103.13415, Eq. 7).

    Those of a point drawn uniformly from the frustum, as ratios of integrals, in
    exact arithmetic: the differences of powers have no digits left in float64.
    """
    t0, t1, radius = (np.vectorize(Fraction, otypes="O")(v) for v in (t0, t1, radius))
    volume = (t1**3 - t0**3) / 3
    mean = (t1**4 - t0**4) / 4 / volume
    square = (t1**5 - t0**5) / 5 / volume
    across = square * radius**2 / 4
    return [np.float64(v) for v in (mean, square - mean**2, across)]


def icosahedral_directions():
    """The 6 axes through an icosahedron's vertices, the 15 through its edges [21, 3].

    The edges' midpoints are an icosidodecahedron's corners.
    """
    p = (1 + np.sqrt(5)) / 2
    vertices = [(0, 1, p), (0, 1, -p)]
    edges = [(0, 0, 1)]
    edges += [(a / 2, p**2 / 2, b * p / 2) for a in (1, -1) for b in (1, -1)]
    found = [np.roll(v, k) for v in vertices + edges for k in range(3)]
    return np.array([v / np.linalg.norm(v) for v in found])


def integrated_encoding(mean, variance, degrees):
    """E[sin(2^l x)] and E[cos(2^l x)] [2, degrees, ...] of x ~ N(mean, variance).

    arXiv 2103.13415, Eqs. 11-14.
    """
    scale = 2.0 ** np.arange(degrees).reshape(-1, *[1] * mean.ndim)
    damp = np.exp(-(scale**2) * variance / 2)
    return np.stack([np.sin(scale * mean) * damp, np.cos(scale * mean) * damp])


def alpha_weights(density, t, d, *, opaque=True):
    """w_i = (1 - e^(-tau_i)) e^(-sum_(j<i) tau_j) (arXiv 2103.13415, Eq. 3).

    opaque: the last interval is, as in the released configuration.
    """
    tau = density * np.diff(t) * np.linalg.norm(d, axis=-1, keepdims=True)
    if opaque:
        tau[..., -1] = np.inf
    transmitted, weights = 1.0, []
    for i in range(tau.shape[-1]):
        weights.append(-np.expm1(-tau[..., i]) * transmitted)
        transmitted = transmitted * np.exp(-tau[..., i])
    return np.stack(weights, axis=-1)


def median_distance(weights, t):
    """Middle of the interval in which the weight passes one half."""
    found = []
    for w, edges in zip(weights, t, strict=True):
        i = np.searchsorted(np.cumsum(w), 0.5)
        found.append((edges[i] + edges[i + 1]) / 2)
    return np.array(found)


def dilated_histogram(t, w, dilation):
    """Edges and masses of the highest p within +-dilation (appendix A), one ray.

    In the released form: edges clipped to [0, 1], the outermost intervals dropped.
    """
    p = w / np.diff(t)
    low, high = t[:-1] - dilation, t[1:] + dilation
    edges = np.clip(np.sort(np.concatenate([t, low, high])), 0, 1)[1:-1]
    highest = [p[(low <= x) & (x < high)].max(initial=0.0) for x in edges[:-1]]
    return edges, np.array(highest) * np.diff(edges)


def annealed_cdf(t, w, anneal):
    """CDF [edges] of masses w^anneal (appendix A), without intervals of no width."""
    mass = np.where(np.diff(t) > 0, w**anneal, 0)
    return np.concatenate([[0], np.cumsum(mass)]) / mass.sum()


def samples(t, w, anneal, u):
    """The points of one ray [count] at which the CDF of w^anneal reaches u."""
    cdf = annealed_cdf(t, w, anneal)
    i = np.clip(np.searchsorted(cdf, u) - 1, 0, len(w) - 1)
    rise = cdf[i + 1] - cdf[i]
    share = np.clip((u - cdf[i]) / np.where(rise > 0, rise, 1), 0, 1)
    return t[i] + share * (t[i + 1] - t[i])


def anneal_exponent(share, slope):
    """Schlick's bias b x / ((b - 1) x + 1) (appendix A)."""
    return slope * share / ((slope - 1) * share + 1)


def interlevel_loss(t, w, t_other, w_other):
    """Sum_i max(0, w_i - bound_i)^2 / w_i, a bound counting all overlaps (Eq. 13)."""
    total = 0.0
    for i in range(w.shape[-1]):
        bound = 0.0
        for j in range(w_other.shape[-1]):
            overlaps = (t_other[..., j] < t[..., i + 1]) & (
                t_other[..., j + 1] > t[..., i]
            )
            bound = bound + overlaps * w_other[..., j]
        excess = np.maximum(w[..., i] - bound, 0)
        total = total + excess**2 / np.where(excess > 0, w[..., i], 1)
    return total


def distortion_loss(t, w):
    """Sum_ij w_i w_j |m_i - m_j| + sum_i w_i^2 (t_(i+1) - t_i) / 3 (Eq. 15)."""
    total = (w**2 * np.diff(t)).sum(axis=-1) / 3
    middle = (t[..., 1:] + t[..., :-1]) / 2
    for i, j in itertools.product(range(w.shape[-1]), repeat=2):
        apart = np.abs(middle[..., i] - middle[..., j])
        total = total + w[..., i] * w[..., j] * apart
    return total


def charbonnier(colour, photo, weight):
    """Mean over rays of weight of sqrt((c - c*)^2 + eps^2), eps = 0.001 (section 5)."""
    losses = np.sqrt((colour - photo) ** 2 + 0.001**2).mean(axis=-1)
    return (losses * weight).sum() / weight.sum()


def learning_rate(step, first, last, steps, warmup_steps):
    """Log-linear, times a sine from 1 % to 1 (appendix; jaxnerf)."""
    t = np.clip(step / steps, 0, 1)
    rate = first ** (1 - t) * last**t
    ramp = np.sin(np.pi / 2 * np.clip(step / warmup_steps, 0, 1))
    return rate * (0.01 + 0.99 * ramp)


def clipped(gradients, max_norm):
    """Arrays scaled together to a norm of at most max_norm."""
    norm = np.sqrt(sum((g**2).sum() for g in gradients))
    return [g * min(1, max_norm / norm) if norm > 0 else g for g in gradients]


def gradient(function, x, step=1e-5):
    """Gradient [..., n] of function: [..., n] -> [...] by central differences.

    The step is relative to each entry; two steps, extrapolated, leave an error of
    the fourth order.
    """
    columns = []
    for axis in np.eye(x.shape[-1]):
        h = step * np.maximum(np.abs(x), 1e-3) * axis
        length = h.sum(axis=-1)
        near, far = (
            (function(x + k * h) - function(x - k * h)) / (2 * k * length)
            for k in (1, 2)
        )
        columns.append((4 * near - far) / 3)
    return np.stack(columns, axis=-1)


def look_up(table, point, levels):
    """A point's features [levels, features] in a hash grid, corner by corner.

    instant-ngp, arXiv 2201.05989, Eq. 4; dense where a level's corners fit.
    """
    found = []
    for resolution, entries, offset in zip(
        levels.resolutions, levels.entries, levels.offsets, strict=True
    ):
        scaled = point * resolution
        cell = np.clip(np.floor(scaled).astype(int), 0, resolution - 1)
        total = 0.0
        for bits in itertools.product((0, 1), repeat=3):
            corner = cell + bits
            weight = np.prod(np.where(bits, scaled - cell, 1 - (scaled - cell)))
            side = resolution + 1
            if side**3 <= entries:
                row = corner @ [1, side, side**2]
            else:
                hashed = [
                    int(c) * p % 2**32 for c, p in zip(corner, PRIMES, strict=True)
                ]
                row = (hashed[0] ^ hashed[1] ^ hashed[2]) % entries
            total = total + weight * table[offset + row]
        found.append(total)
    return np.stack(found)
