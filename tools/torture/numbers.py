"""10,000 random and extreme cases of each numeric function, against its twin.

Values and gradients have to be finite everywhere; where a twin in float64 exists, the
value is held to it.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.contributions import align_loss, frequency_loss
from alignerf.fields import encoding, grid, mlp, shading, space
from alignerf.mipnerf360 import coord, losses, render, stepfun
from alignerf.rays import sampling
from alignerf.scenes import cameras
from alignerf.training import step as train_step
from tests import camera_twins, twins

CASES = 10_000
BINS = 8


class Function(NamedTuple):
    """A function, how its inputs are drawn, and what its value should be."""

    draw: Callable
    """(rng, count) -> inputs, float32; the first axis is that of the cases."""
    call: Callable
    """Inputs -> one array, whose first axis is that of the cases."""
    twin: Callable | None = None
    tolerance: float = 1e-5
    """Of the largest of a case's values."""
    least: float = 1e-37
    """Below it a value counts as zero: float32 has no digits there."""


def magnitudes(rng, shape, low, high):
    """Numbers of any size between two powers of ten, and now and then an end or 0."""
    found = 10.0 ** rng.uniform(low, high, shape)
    ends = rng.choice([10.0**low, 10.0**high, 1.0, 0.0], shape)
    return np.where(rng.random(shape) < 0.1, ends, found).astype(np.float32)


def signed(rng, shape, low, high):
    return magnitudes(rng, shape, low, high) * rng.choice([-1, 1], shape)


def directions(rng, count):
    """Of any length from 0.1 to 10, axes among them."""
    found = rng.normal(size=(count, 3))
    found = np.where(rng.random((count, 1)) < 0.1, np.eye(3)[rng.integers(3)], found)
    found /= np.linalg.norm(found, axis=-1, keepdims=True)
    return (found * 10.0 ** rng.uniform(-1, 1, (count, 1))).astype(np.float32)


def edges(rng, count, bins=BINS):
    """Edges in [0, 1], some of no width."""
    widths = magnitudes(rng, (count, bins), -6, 0)
    total = np.maximum(widths.sum(axis=-1, keepdims=True), 1e-30)
    inner = np.minimum(np.cumsum(widths, axis=-1) / total, 1.0)[:, :-1]
    zero = np.zeros((count, 1))
    return np.concatenate([zero, inner, zero + 1], axis=-1).astype(np.float32)


def masses(rng, count, bins=BINS):
    """Weights that add up to 1: all in one bin, all equal, or of any size."""
    found = magnitudes(rng, (count, bins), -12, 0)
    single = np.eye(bins, dtype=np.float32)[rng.integers(bins, size=count)]
    found = np.where(rng.random((count, 1)) < 0.1, single, found)
    total = found.sum(axis=-1, keepdims=True)
    return np.where(total > 0, found / np.where(total > 0, total, 1), single)


def points(rng, count):
    return [signed(rng, (count, 3), -38, 18)]


def gaussians(rng, count):
    """Mean, direction, deviations along and across."""
    deviations = [magnitudes(rng, count, -12, 12) for _ in range(2)]
    return [signed(rng, (count, 3), -12, 18), directions(rng, count), *deviations]


def histograms(rng, count):
    return [edges(rng, count), masses(rng, count)]


def two_histograms(rng, count):
    return [*histograms(rng, count), *histograms(rng, count)]


def densities(rng, count):
    """Density, edges and direction of a ray."""
    near, far = 10.0 ** rng.uniform(-3, 0, (count, 1)), 10.0 ** rng.uniform(0, 6)
    tdist = 1 / (edges(rng, count) / far + (1 - edges(rng, count)) / near)
    tdist = np.sort(tdist, axis=-1).astype(np.float32)
    return [magnitudes(rng, (count, BINS), -6, 30), tdist, directions(rng, count)]


def cones(rng, count):
    """Edges, origin, direction and radius of a cone."""
    start = magnitudes(rng, (count, 1), -3, 17)
    tdist = start + start * magnitudes(rng, (count, BINS), -6, 1).cumsum(axis=-1)
    tdist = np.concatenate([start, tdist], axis=-1)
    tdist = np.maximum(tdist, np.float32(1e-6))
    origins = signed(rng, (count, 3), -6, 0)
    radii = 10.0 ** rng.uniform(-5, -1, (count, 1))
    return [np.float32(a) for a in (tdist, origins, directions(rng, count), radii)]


def as_gaussians(mean, direction, t_std, r_std):
    return coord.Gaussians(mean, direction, t_std, r_std)


def cone_parts(tdist, origins, dirs, radii):
    found = render.cast_cones(tdist, origins, dirs, radii)
    flat = found.mean.reshape(len(tdist), -1)
    return jnp.concatenate([flat, found.t_std, found.r_std], axis=-1)


def logits_of(t, w):
    return stepfun.annealed_logits(t, w, 0.7)


def intervals(jitter, t, w):
    return stepfun.sample_intervals(jitter, t, logits_of(t, w), BINS)


def jittered(rng, count):
    return [rng.random(count, np.float32), *histograms(rng, count)]


def colours(rng, count):
    return [rng.random((count, 3), np.float32) for _ in range(2)]


def charbonnier(colour, photo):
    weight = jnp.ones(1)
    return jax.vmap(lambda c, p: losses.charbonnier(c[None], p[None], weight))(
        colour, photo
    )


def charbonnier_twin(colour, photo):
    return np.sqrt((colour - photo) ** 2 + 1e-6).mean(axis=-1)


def steps(rng, count):
    total = np.maximum(magnitudes(rng, count, 0, 8), 1)
    return [np.floor(rng.random(count) * total).astype(np.float32), total]


def rate(step, total):
    options = {"first": 0.03, "last": 0.003}
    each = lambda s, n: train_step.learning_rate(  # noqa: E731
        s, steps=n, warmup_steps=jnp.maximum(n / 10, 1), **options
    )
    return jax.vmap(each)(step, total)


def rate_twin(step, total):
    each = zip(step, total, strict=True)
    return np.array(
        [twins.learning_rate(s, 0.03, 0.003, n, max(n / 10, 1)) for s, n in each]
    )


def gradients(rng, count):
    return [signed(rng, (count, 16), -30, 30)]


def clipped(g):
    one = lambda x: train_step.clip_per_network({"model": {"a": x}}, 1e-3)  # noqa: E731
    return jax.vmap(lambda x: one(x)["model"]["a"])(g)


def clipped_twin(g):
    return np.stack([twins.clipped([row], 1e-3)[0] for row in g])


def patches(rng, count):
    """Renders of 4 px and photos of 8, flat and bright among them."""
    level = rng.random((count, 1, 1, 1))
    found = [
        level
        + rng.choice([0, 1e-3, 1], (count, 1, 1, 1)) * rng.random((count, n, n, 3))
        for n in (4, 8)
    ]
    return [a.astype(np.float32) for a in found]


def costs_twin(rendered, photo):
    found = [
        ((photo[:, dy : dy + 4, dx : dx + 4] - rendered) ** 2).sum(axis=(1, 2, 3))
        for dy in range(5)
        for dx in range(5)
    ]
    return np.stack(found, axis=-1).reshape(len(photo), 5, 5)


def align_costs(rendered, photo):
    """Of the best offset; its patch carries no gradient."""
    valid = jnp.ones(photo.shape[1:3])
    each = lambda r, p: align_loss.align(r, p, valid).cost  # noqa: E731
    return jax.vmap(each)(rendered, photo)


def aligned_twin(rendered, photo):
    dy, dx = np.indices((5, 5)) - 2
    costs = costs_twin(rendered, photo) + 0.01 * np.hypot(dx, dy)
    return costs.min(axis=(1, 2))


def frequencies(rendered, photo):
    features = frequency_loss.bank_features
    each = lambda r, p: frequency_loss.frequency_loss(features, p, r)  # noqa: E731
    return jax.vmap(each)(rendered[:, None], photo[:, None, 2:6, 2:6])


def rays_of_sphere(rng, count):
    """Points outside the unit sphere by 1 / |x|, an origin inside, a direction."""
    origins = directions(rng, count)
    inside = rng.random((count, 1)) / np.linalg.norm(origins, axis=-1, keepdims=True)
    share = np.minimum(magnitudes(rng, (count, BINS), -12, 0), 1)
    return [share, np.float32(0.999 * inside * origins), directions(rng, count)]


def lengths(rng, count):
    return [
        magnitudes(rng, (count, BINS), -6, 30),
        magnitudes(rng, (count, BINS), -6, 6),
    ]


def mean_and_variance(rng, count):
    return [signed(rng, (count, 3), -6, 1), magnitudes(rng, (count, 3), -12, 8)]


def encoded(mean, variance):
    found = mlp.integrated_encoding(mean.T, variance.T, 4)
    return jnp.concatenate(found).T


def encoded_twin(mean, variance):
    found = twins.integrated_encoding(mean.T, variance.T, 4)
    return found.reshape(-1, len(mean)).T


def spheres(*parts):
    mean, radius = coord.contract_spheres(as_gaussians(*parts))
    return jnp.concatenate([mean, radius[:, None]], axis=-1)


def roots(*parts):
    mean, root = coord.contract_gaussians(as_gaussians(*parts))
    return jnp.concatenate([mean, root.reshape(len(mean), -1)], axis=-1)


def axes(*parts):
    return encoding.integrated_axes(as_gaussians(*parts), 4).T


def distances(rng, count):
    near = 10.0 ** rng.uniform(-3, 2, count)
    s = np.where(rng.random(count) < 0.2, rng.choice([0, 1, 1e-7, 1 - 6e-8], count), 1)
    s = np.where(s == 1, rng.random(count), s)
    return [np.float32(a) for a in (s, near, near * 10.0 ** rng.uniform(0.1, 9, count))]


def angles(rng, count):
    return [signed(rng, count, -6, 4.6)]


def sine_twin(x):
    return np.stack([np.sin(x), np.cos(x)], axis=-1)


def softplus(raw):
    return np.logaddexp(0, raw - 1)


LEVELS = grid.Levels.geometric(4, 16, 512, 2**12)


def cells(rng, count):
    """A table's rows, and points in it, its corners and sides among them."""
    at = rng.random((count, 3))
    at = np.where(rng.random((count, 3)) < 0.1, rng.choice([0, 1], (count, 3)), at)
    table = rng.normal(size=(sum(LEVELS.entries), 2))
    return [at.astype(np.float32), table.astype(np.float32)]


def look_up(at, table):
    found = grid.look_up(table, at.T, LEVELS, True)
    return jnp.moveaxis(found, 1, 0)


def ends(rng, count):
    near = 10.0 ** rng.uniform(-3, 2, (count, 1))
    return [near, near * 10.0 ** rng.uniform(0.1, 9, (count, 1))]


def pixels(rng, count):
    """Pixels, lenses from wide to long, and poses of all turns."""
    turns = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    turns *= np.sign(np.linalg.det(turns))[:, None, None]
    places = signed(rng, (count, 3, 1), -6, 6)
    focal_px = 10.0 ** rng.uniform(1, 5, count)
    lens = np.zeros((count, 3, 3))
    lens[:, 0, 0] = lens[:, 1, 1] = 1 / focal_px
    lens[:, :2, 2], lens[:, 2, 2] = -500 / focal_px[:, None], 1
    at = np.floor(rng.random((2, count)) * 1000)
    return [*at, lens, np.concatenate([turns, places], axis=-1)]


def rays(x, y, lens, pose):
    found = cameras.pixels_to_rays(x, y, lens, pose)
    return jnp.concatenate([found.directions, found.radii], axis=-1)


def rays_twin(x, y, lens, pose):
    each = x, y, lens, pose
    across = camera_twins.ray_radius(*each)[:, None]
    return np.concatenate([camera_twins.pixel_ray(*each), across], axis=-1)


FUNCTIONS = {
    "contract": Function(points, coord.contract, twins.contract, 1e-6),
    "contract_gaussians": Function(gaussians, roots),
    "contract_spheres": Function(gaussians, spheres),
    "s_to_t": Function(distances, coord.s_to_t, twins.ray_distance),
    "cast_cones": Function(cones, cone_parts),
    "alpha_weights": Function(densities, render.alpha_weights, twins.alpha_weights),
    "median_distance": Function(
        lambda rng, n: [masses(rng, n), edges(rng, n)], render.median_distance
    ),
    "max_dilate": Function(
        histograms, lambda t, w: stepfun.max_dilate(t, w, dilation=0.01)[1]
    ),
    "sample_intervals": Function(jittered, intervals),
    "outer_measure": Function(
        lambda rng, n: [edges(rng, n), *histograms(rng, n)], stepfun.outer_measure
    ),
    "interlevel_loss": Function(two_histograms, stepfun.interlevel_loss),
    "distortion_loss": Function(
        histograms, stepfun.distortion_loss, twins.distortion_loss
    ),
    "charbonnier": Function(colours, charbonnier, charbonnier_twin),
    "learning_rate": Function(steps, rate, rate_twin, 1e-4),
    "clip_per_network": Function(gradients, clipped, clipped_twin),
    "squared_errors": Function(
        patches, jax.vmap(align_loss.squared_errors), costs_twin
    ),
    "align": Function(patches, align_costs, aligned_twin),
    "frequency_loss": Function(patches, frequencies),
    "integrated_encoding": Function(
        # Beyond a variance of 160 what is left is e^-80, not nothing.
        *(mean_and_variance, encoded, encoded_twin),
        least=1e-34,
    ),
    "sine_and_cosine": Function(
        angles, lambda x: jnp.stack(mlp.sine_and_cosine(x), axis=-1), sine_twin
    ),
    "density_of": Function(
        lambda rng, n: [signed(rng, (n, 1), -6, 30)], shading.density_of, softplus
    ),
    "harmonics": Function(
        lambda rng, n: [directions(rng, n)], lambda v: encoding.harmonics(v.T).T
    ),
    "sphere_exit": Function(
        lambda rng, n: [signed(rng, (n, 3), -6, 0), directions(rng, n)],
        lambda o, d: space.sphere_exit(o, d, 2.0),
    ),
    "look_up": Function(cells, look_up),
    "pixels_to_rays": Function(pixels, rays, rays_twin),
    "stratified": Function(
        lambda rng, n: [rng.random((n, BINS), np.float32), *ends(rng, n)],
        lambda u, near, far: sampling.stratified(u, near, far, len(u), BINS, "inverse"),
    ),
    "sample_pdf": Function(
        lambda rng, n: [rng.random((n, BINS), np.float32), *histograms(rng, n)],
        lambda u, t, w: sampling.sample_pdf(u, t, w, BINS),
    ),
    "integrated_axes": Function(gaussians, axes),
    "invert_sphere": Function(rays_of_sphere, space.invert_sphere),
    "in_box": Function(points, lambda x: space.in_box(x, 32.0)[0]),
    "weights_of": Function(lengths, lambda d, t: sampling.weights_of(d, t)[0]),
    "fine_samples": Function(
        lambda rng, n: [rng.random((n, BINS), np.float32), edges(rng, n, BINS - 1),
                        masses(rng, n)],
        lambda jitter, t, w: sampling.fine_samples(jitter, t, w, BINS),
    ),
}  # fmt: skip


def check(name, rng, count=CASES):
    """Findings of one function's cases: not finite, or not what its twin says."""
    function = FUNCTIONS[name]
    inputs = [np.float32(a) for a in function.draw(rng, count)]
    found = np.asarray(jax.jit(function.call)(*inputs), np.float64)
    found = found.reshape(count, -1)
    findings = of_cases(found, "value")
    weight = rng.uniform(0.5, 2, found.shape).astype(np.float32)

    def scalar(*inputs):
        return jnp.sum(function.call(*inputs).reshape(count, -1) * weight)

    floating = tuple(range(len(inputs)))
    for place, gradient in enumerate(jax.jit(jax.grad(scalar, floating))(*inputs)):
        gradient = np.asarray(gradient).reshape(len(gradient), -1)
        findings += of_cases(gradient, f"d{place}")
    if function.twin is None:
        return findings
    with np.errstate(all="ignore"):
        wanted = function.twin(*twins.f64(*inputs)).reshape(count, -1)
    scale = np.abs(wanted).max(axis=-1, keepdims=True)
    off = np.abs(found - wanted) > function.tolerance * scale + function.least
    wrong = np.flatnonzero(off.any(axis=-1))
    if len(wrong):
        case = [a[wrong[0]].tolist() for a in inputs]
        findings.append(f"{len(wrong)} off the twin, first {case}"[:300])
    return findings


def of_cases(values, what):
    """A finding where some case is not finite."""
    bad = np.flatnonzero(~np.isfinite(values).all(axis=-1))
    return (
        [f"{what} of {len(bad)} cases not finite, first {bad[0]}"] if len(bad) else []
    )
