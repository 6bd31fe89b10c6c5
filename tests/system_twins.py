"""NeRF, mip-NeRF and NeRF++ as their papers print them, in float64, ray by ray.

Nothing here comes from the code under test but its parameters. Notation: o, d origin
and direction of one ray, t [n] distances; params a network's tree of parameters.
"""

import numpy as np


def dense(params, x):
    kernel, bias = (np.asarray(params[name], np.float64) for name in ("kernel", "bias"))
    return x @ kernel.T + bias


def sigmoid(x):
    return 1 / (1 + np.exp(-x))


def posenc(x, degrees):
    """[x, sin x, sin 2x, ..., cos x, cos 2x, ...] of points [n, c]."""
    scaled = [x * 2.0**k for k in range(degrees)]
    return np.concatenate(
        [x, *(np.sin(part) for part in scaled), *(np.cos(part) for part in scaled)], -1
    )


def network(params, encoded, viewdir, *, depth=8, again=5, view_degrees=4):
    """(raw density [n], colours [n, 3]) of the MLP of NeRF's figure 7."""
    x = encoded
    for layer in range(depth):
        if layer == again:
            x = np.concatenate([x, encoded], -1)
        x = np.maximum(dense(params[f"Dense_{layer}"], x), 0)
    raw = dense(params["density"], x)[:, 0]
    seen = posenc(viewdir[None], view_degrees)
    seen = np.broadcast_to(seen, (len(x), seen.shape[-1]))
    x = np.concatenate([dense(params["bottleneck"], x), seen], -1)
    x = np.maximum(dense(params[f"Dense_{depth}"], x), 0)
    return raw, sigmoid(dense(params["values"], x))


def composite(density, length):
    """(weights, what passes all), by Eq. 3 of NeRF as a product of transparencies."""
    through = np.exp(-density * length)
    before = np.concatenate([[1.0], np.cumprod(through)[:-1]])
    return before * (1 - through), np.prod(through)


def inverse_cdf(u, edges, weights):
    """Where the piecewise linear CDF of the weights between edges is u."""
    cdf = np.concatenate([[0.0], np.cumsum(weights) / np.sum(weights)])
    found = []
    for share in u:
        at = min(np.searchsorted(cdf, share, side="right") - 1, len(weights) - 1)
        part = (share - cdf[at]) / (cdf[at + 1] - cdf[at])
        found.append(edges[at] + part * (edges[at + 1] - edges[at]))
    return np.array(found)


def spread(near, far, count, inverse):
    s = np.linspace(0, 1, count)
    return 1 / ((1 - s) / near + s / far) if inverse else near + s * (far - near)


def nerf(params, o, d, *, samples, near, far, degrees, inverse=True):
    """(colour, colour of the first look)."""
    viewdir = d / np.linalg.norm(d)
    eps = np.finfo(np.float32).eps

    def look(tree, t):
        raw, colours = network(tree, posenc(o + t[:, None] * d, degrees), viewdir)
        length = np.append(np.diff(t), 1e10) * np.linalg.norm(d)
        weights, _ = composite(np.maximum(raw, 0), length)
        return weights, weights @ colours

    t = spread(near, far, samples[0], inverse)
    weights, early = look(params["coarse"], t)
    middle = (t[1:] + t[:-1]) / 2
    u = np.linspace(0, 1 - eps, samples[1])
    more = inverse_cdf(u, middle, weights[1:-1] + 1e-5)
    return look(params["fine"], np.sort(np.append(t, more)))[1], early


def mipnerf(params, o, d, radius, *, samples, near, far, degrees, inverse=True):
    """(colour, colour of the first look)."""
    viewdir, speed = d / np.linalg.norm(d), np.linalg.norm(d)
    eps = np.finfo(np.float32).eps

    def look(t):
        mu, hw = (t[1:] + t[:-1]) / 2, (t[1:] - t[:-1]) / 2
        below = 3 * mu**2 + hw**2
        t_mean = mu + 2 * mu * hw**2 / below
        t_var = hw**2 / 3 - 4 / 15 * hw**4 * (12 * mu**2 - hw**2) / below**2
        r_var = radius**2 * (mu**2 / 4 + 5 / 12 * hw**2 - 4 / 15 * hw**4 / below)
        mean = o + t_mean[:, None] * d
        # Of the whole covariance, its diagonal (Eqs. 8 and 16).
        across = np.eye(3) - np.outer(d, d) / speed**2
        full = t_var[:, None, None] * np.outer(d, d) + r_var[:, None, None] * across
        var = np.diagonal(full, axis1=-2, axis2=-1)
        scales = 2.0 ** np.arange(degrees)
        fade = [np.exp(-0.5 * s**2 * var) for s in scales]
        sines = [np.sin(s * mean) * f for s, f in zip(scales, fade, strict=True)]
        cosines = [np.cos(s * mean) * f for s, f in zip(scales, fade, strict=True)]
        encoded = np.concatenate([*sines, *cosines], -1)
        raw, colours = network(params["network"], encoded, viewdir)
        density = np.logaddexp(0, raw - 1)
        weights, _ = composite(density, np.diff(t) * speed)
        return weights, weights @ (colours * 1.002 - 0.001)

    t = spread(near, far, samples[0] + 1, inverse)
    weights, early = look(t)
    padded = np.concatenate([weights[:1], weights, weights[-1:]])
    larger = np.maximum(padded[1:], padded[:-1])
    blurred = (larger[1:] + larger[:-1]) / 2 + 0.01
    u = np.linspace(0, 1 - eps, samples[1] + 1)
    return look(inverse_cdf(u, t, blurred))[1], early


def nerfpp(params, o, d, *, samples, near, degrees, radius):
    """(colour, colour of the first look)."""
    viewdir = d / np.linalg.norm(d)
    o, d = o / radius, d / radius
    eps = np.finfo(np.float32).eps
    # Where |o + t d| = 1.
    leave = max(np.roots([d @ d, 2 * o @ d, o @ o - 1]).real)

    def look(number, t, u):
        tree = params[f"inside_{number}"]
        raw, colours = network(tree, posenc(o + t[:, None] * d, degrees), viewdir)
        length = np.append(np.diff(t), leave - t[-1]) * np.linalg.norm(d)
        weights, passed = composite(np.abs(raw), length)
        outwards = u[::-1]
        points = []
        for share in outwards:
            if share == 0:
                points.append([*viewdir, 0.0])
                continue
            # |o + t d| = 1 / share.
            at = max(np.roots([d @ d, 2 * o @ d, o @ o - 1 / share**2]).real)
            points.append([*((o + at * d) * share), share])
        tree = params[f"outside_{number}"]
        raw, far_colours = network(tree, posenc(np.array(points), degrees), viewdir)
        length = np.append(outwards[:-1] - outwards[1:], 1e10)
        far_weights, _ = composite(np.abs(raw), length)
        colour = weights @ colours + passed * (far_weights @ far_colours)
        return colour, weights, far_weights[::-1]

    def refined(t, weights):
        middle = (t[1:] + t[:-1]) / 2
        u = np.linspace(0, 1 - eps, samples[1])
        more = inverse_cdf(u, middle, weights[1:-1] + 1e-5)
        return np.sort(np.append(t, more))

    t = np.linspace(near, leave, samples[0])
    u = np.linspace(0, 1, samples[0])
    early, weights, far_weights = look(0, t, u)
    colour, *_ = look(1, refined(t, weights), refined(u, far_weights))
    return colour, early
