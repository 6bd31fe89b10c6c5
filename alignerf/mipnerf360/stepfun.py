"""Step functions: histograms along a ray, their resampling and their losses.

Notation: t [..., edges] non-decreasing interval edges, w [..., edges - 1] the mass
of each interval, p = w / width its density, cdf [..., edges] from 0 to 1.
arXiv 2111.12077, section 3 and appendix.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from alignerf.kernels import calls

Scalar = float | Float[Array, ""]
EPS = jnp.finfo(jnp.float32).eps

# Edges up to which comparing with each beats bisection, on a CPU by its compile time
# too: there one after the other, elsewhere all at once.
FEW_EDGES = 160
FEW_EDGES_AT_ONCE = 512


def count_below(
    t: Float[Array, "*batch edges"], x: Float[Array, "*batch n"], *, or_equal=False
) -> Int[Array, "*batch n"]:
    """How many t, non-decreasing, are below each x (or equal to it).

    One edge after the other against all x: four times as fast as bisection at 33 to 65
    edges on a CPU, since nothing is gathered. An accelerator compiles each of them by
    itself, and counts all in one reduction.
    """
    if t.shape[-1] > (FEW_EDGES if calls.on_cpu() else FEW_EDGES_AT_ONCE):
        return bisect(t, x, or_equal=or_equal)
    below = jnp.less_equal if or_equal else jnp.less
    if not calls.on_cpu():
        return jnp.sum(below(t[..., None, :], x[..., None]), axis=-1, dtype=jnp.int32)
    count = jnp.zeros(jnp.broadcast_shapes(t[..., :1].shape, x.shape), jnp.int32)
    for edge in range(t.shape[-1]):
        count = count + below(t[..., edge, None], x).astype(jnp.int32)
    return count


def bisect(t, x, *, or_equal):
    """The same by bisection, for many edges."""
    search = functools.partial(
        jnp.searchsorted,
        side="right" if or_equal else "left",
        method="scan_unrolled",
    )
    return jnp.vectorize(search, signature="(e),(n)->(n)")(t, x)


def max_dilate(
    t: Float[Array, "*batch edges"],
    w: Float[Array, "*batch edges-1"],
    *,
    dilation: float,
) -> tuple[Float[Array, "*batch wide"], Float[Array, "*batch wide-1"]]:
    """Dilate the density of w by +-dilation in [0, 1], mass renormalised to 1.

    The maximum over a neighbourhood keeps resampling from missing what a
    neighbouring ray's histogram would have put beside an edge (appendix A). As in
    the released code the outermost interval on either side is dropped. All-zero
    weights become uniform in t.
    """
    width = t[..., 1:] - t[..., :-1]
    # 0 w, not 0: a NaN must not vanish with the interval that it stands in.
    p = jnp.where(width > EPS**2, w / jnp.maximum(width, EPS**2), 0.0 * w)
    low, high = t[..., :-1] - dilation, t[..., 1:] + dilation
    t_wide = jnp.clip(merge(merge(low, high), t)[..., 1:-1], 0.0, 1.0)
    most = largest_at(t_wide[..., :-1], low, high, p)
    width = t_wide[..., 1:] - t_wide[..., :-1]
    mass = most * width
    total = jnp.sum(mass, axis=-1, keepdims=True)
    empty = total <= 0.0
    uniform = width / jnp.sum(width, axis=-1, keepdims=True)
    return t_wide, jnp.where(empty, uniform, mass / jnp.where(empty, 1.0, total))


def largest_at(
    t: Float[Array, "*batch n"],
    low: Float[Array, "*batch bins"],
    high: Float[Array, "*batch bins"],
    p: Float[Array, "*batch bins"],
) -> Float[Array, "*batch n"]:
    """The largest p >= 0 of the intervals [low, high) that each t is in; else 0."""

    def of(low, high, p, t):
        return jnp.where((low <= t) & (high > t), p, 0.0)

    if not calls.on_cpu():
        every = (x[..., None, :] for x in (low, high, p))
        most = jnp.max(of(*every, t[..., None]), axis=-1)
        # The maximum of many may pass over a NaN; a sum does not.
        total = jnp.sum(p, axis=-1, keepdims=True)
        return jnp.where(jnp.isnan(total), total, most)
    # One interval after the other: all of them at once are written out, and read again.
    most = jnp.zeros_like(t)
    for k in range(p.shape[-1]):
        most = jnp.maximum(most, of(*(x[..., k, None] for x in (low, high, p)), t))
    return most


def merge(
    a: Float[Array, "*batch n"], b: Float[Array, "*batch m"]
) -> Float[Array, "*batch n+m"]:
    """All values of two non-decreasing arrays, sorted: on a CPU each goes to its rank.

    A sort of both together is several times slower in XLA there.
    """
    if not calls.on_cpu():
        return jnp.sort(jnp.concatenate([a, b], axis=-1), axis=-1)
    rank_a = jnp.broadcast_to(jnp.arange(a.shape[-1]), a.shape) + count_below(b, a)
    rank_b = jnp.broadcast_to(jnp.arange(b.shape[-1]), b.shape)
    rank_b = rank_b + count_below(a, b, or_equal=True)
    ranks = jnp.concatenate([rank_a, rank_b], axis=-1)
    values = jnp.concatenate([a, b], axis=-1)
    place = lambda rank, x: jnp.zeros_like(x).at[rank].set(x, unique_indices=True)  # noqa: E731
    return jnp.vectorize(place, signature="(k),(k)->(k)")(ranks, values)


def annealed_logits(
    t: Float[Array, "*batch edges"], w: Float[Array, "*batch edges-1"], anneal: Scalar
) -> Float[Array, "*batch edges-1"]:
    """Logits of w^anneal; intervals of no width or no mass get -inf.

    At anneal = 0 every interval that has width gets the same logit (0 log 0 = 0).
    Where no interval has mass, all that have width are equal: never one point.
    A NaN is no missing mass: it stays, and spoils its whole ray.
    """
    wide = t[..., 1:] > t[..., :-1]
    massive = ~(w <= 0.0) & wide
    massive = massive | (wide & ~jnp.any(massive, axis=-1, keepdims=True))
    logits = anneal * jnp.log(jnp.where(w <= 0.0, 1.0, w))
    # A zero mass stays zero for any positive exponent, and counts as one at zero.
    return jnp.where(massive | (wide & (anneal == 0.0)), logits, -jnp.inf)


def anneal_exponent(train_fraction, *, slope: float):
    """Schlick's bias (slope x) / ((slope - 1) x + 1) of the training share."""
    return slope * train_fraction / ((slope - 1.0) * train_fraction + 1.0)


def cdf_from_logits(
    logits: Float[Array, "*batch bins"],
) -> Float[Array, "*batch bins+1"]:
    """CDF of softmax(logits), exactly 0 at the start and 1 at the end."""
    w = jax.nn.softmax(logits, axis=-1)
    inner = jnp.minimum(jnp.cumsum(w[..., :-1], axis=-1), 1.0)
    ends = (*w.shape[:-1], 1)
    return jnp.concatenate([jnp.zeros(ends), inner, jnp.ones(ends)], axis=-1)


def invert_cdf(
    u: Float[Array, "*batch n"],
    t: Float[Array, "*batch edges"],
    cdf: Float[Array, "*batch edges"],
) -> Float[Array, "*batch n"]:
    """The t at which the piecewise linear cdf reaches u in [0, 1)."""
    index = jnp.clip(count_below(cdf, u, or_equal=True) - 1, 0, t.shape[-1] - 2)
    # Taken together: the index would be counted anew for each.
    ends = jnp.stack([cdf[..., :-1], cdf[..., 1:], t[..., :-1], t[..., 1:]], axis=-1)
    found = jnp.take_along_axis(ends, index[..., None], axis=-2)
    low, high, t_low, t_high = jnp.moveaxis(found, -1, 0)
    flat = high == low
    share = jnp.where(flat, 0.5, (u - low) / jnp.where(flat, 1.0, high - low))
    return t_low + jnp.clip(share, 0.0, 1.0) * (t_high - t_low)


def sample_intervals(
    jitter: Float[Array, "*batch"] | None,
    t: Float[Array, "*batch edges"],
    logits: Float[Array, "*batch edges-1"],
    count: int,
) -> Float[Array, "*batch {count}+1"]:
    """Edges in [0, 1] of `count` intervals drawn from the histogram.

    Stratified, with one jitter in [0, 1) a ray; with None at the centres of equal
    shares. Edges are the midpoints between neighbouring samples, the outer
    ones mirrored (section 3, "sampling").
    """
    if jitter is None:
        u = jnp.linspace(0.5 / count, 1.0 - 0.5 / count - EPS, count)
        u = jnp.broadcast_to(u, (*t.shape[:-1], count))
    else:
        u_max = EPS + (1.0 - EPS) / count
        u = jnp.linspace(0.0, 1.0 - u_max, count)
        u = jnp.broadcast_to(u, (*jitter.shape, count))
        u = u + jitter[..., None] * (u_max - EPS)
    centres = invert_cdf(u, t, cdf_from_logits(logits))
    if count == 1:
        zero = jnp.zeros_like(centres)
        return jnp.concatenate([zero, zero + 1.0], axis=-1)
    middle = (centres[..., 1:] + centres[..., :-1]) / 2
    first = jnp.maximum(2 * centres[..., :1] - middle[..., :1], 0.0)
    last = jnp.minimum(2 * centres[..., -1:] - middle[..., -1:], 1.0)
    return jnp.concatenate([first, middle, last], axis=-1)


def resample(
    t: Float[Array, "*batch edges"],
    w: Float[Array, "*batch edges-1"],
    jitter: Float[Array, "*batch"] | None,
    anneal: Scalar,
    count: int,
    *,
    dilation: float | None = None,
) -> Float[Array, "*batch {count}+1"]:
    """Edges of `count` intervals drawn from w^anneal; dilation None: as it is."""
    if dilation is not None:
        t, w = max_dilate(t, w, dilation=dilation)
    return sample_intervals(jitter, t, annealed_logits(t, w, anneal), count)


def outer_measure(
    t: Float[Array, "*batch edges"],
    t_other: Float[Array, "*batch others"],
    w_other: Float[Array, "*batch others-1"],
) -> Float[Array, "*batch edges-1"]:
    """Mass of all intervals of the other histogram that touch each of ours."""
    total = jnp.concatenate(
        [jnp.zeros((*w_other.shape[:-1], 1)), jnp.cumsum(w_other, axis=-1)], axis=-1
    )
    # Last edge of the other histogram that is not above our interval's start, and
    # first edge that is not below its end.
    start = jnp.maximum(count_below(t_other, t[..., :-1], or_equal=True) - 1, 0)
    end = jnp.minimum(count_below(t_other, t[..., 1:]), t_other.shape[-1] - 1)
    take = lambda i: jnp.take_along_axis(total, i, axis=-1)  # noqa: E731
    return take(end) - take(start)


def interlevel_loss(
    t: Float[Array, "*batch edges"],
    w: Float[Array, "*batch edges-1"],
    t_proposal: Float[Array, "*batch proposals"],
    w_proposal: Float[Array, "*batch proposals-1"],
) -> Float[Array, "*batch"]:
    """Sum of max(0, w - bound)^2 / w, bound the proposal's outer measure (Eq. 13).

    The final histogram (t, w) teaches the proposal and learns nothing from it.
    """
    t, w = jax.lax.stop_gradient((t, w))
    bound = outer_measure(t, t_proposal, w_proposal)
    return jnp.sum(jnp.maximum(w - bound, 0.0) ** 2 / (w + EPS), axis=-1)


def distortion_loss(
    t: Float[Array, "*batch edges"], w: Float[Array, "*batch edges-1"]
) -> Float[Array, "*batch"]:
    """Sum_ij w_i w_j |m_i - m_j| + sum_i w_i^2 width_i / 3 (Eq. 15).

    The first as 2 sum_k (m_(k+1) - m_k) (mass up to k) (mass after k): all terms are
    positive and the gaps exact, where differences of all pairs of middles cancel.
    """
    bins = w.shape[-1]
    gap = (t[..., 2:] - t[..., :-2]) / 2
    later = np.tri(bins, bins - 1, -1, dtype=np.float32)
    before = jnp.matmul(w, 1 - later, precision="highest")
    after = jnp.matmul(w, later, precision="highest")
    between = 2 * jnp.sum(gap * before * after, axis=-1)
    within = jnp.sum(w**2 * (t[..., 1:] - t[..., :-1]), axis=-1) / 3
    return between + within
