"""A splat rendered slowly in float64, by the formulas of the papers.

EWA splatting (Zwicker et al., 2001), eq. 5 of 3DGS (arXiv 2308.04079), and the
conventions of 3DGS's code: a dilation, tiles up to 3 standard deviations, two cut-offs.
"""

import numpy as np
from scipy import special
from scipy.spatial import transform

TILE = 16


def render(
    gaussians,
    camera,
    *,
    background=(0, 0, 0),
    antialiased=False,
    dilation_px2=0.3,
    near=0.2,
    max_alpha=0.99,
):
    """(colour [h, w, 3], alpha [h, w], depth [h, w])."""
    pose = np.asarray(camera.world_to_camera, np.float64)
    turn, move = pose[:, :3], pose[:, 3]
    means = gaussians.means.astype(np.float64)
    places = means @ turn.T + move
    colours = shade(gaussians.sh, means + turn.T @ move)
    shape = camera.height, camera.width
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    colour, depth = np.zeros((*shape, 3)), np.zeros(shape)
    left, stopped = np.ones(shape), np.zeros(shape, bool)
    for i in np.argsort(places[:, 2], kind="stable"):
        if places[i, 2] <= near:
            continue
        centre, covariance = project(gaussians, i, places[i], turn, camera)
        sharp = np.linalg.det(covariance)
        covariance += dilation_px2 * np.eye(2)
        opacity = float(gaussians.opacities[i])
        if antialiased:
            opacity *= np.sqrt(max(sharp, 0) / np.linalg.det(covariance))
        offset = np.stack([x, y], axis=-1) - centre
        inverse = np.linalg.inv(covariance)
        power = 0.5 * np.einsum("hwi,ij,hwj->hw", offset, inverse, offset)
        alpha = np.minimum(max_alpha, opacity * np.exp(-power))
        alpha[(alpha < 1 / 255) | ~in_tiles(x, y, centre, covariance)] = 0
        stopped |= left * (1 - alpha) < 1e-4
        weight = np.where(stopped, 0, alpha * left)
        colour += weight[..., None] * colours[i]
        depth += weight * places[i, 2]
        left -= weight
    alpha = 1 - left
    depth = np.divide(depth, alpha, out=np.zeros(shape), where=alpha > 0)
    return colour + left[..., None] * background, alpha, depth


def project(gaussians, i, place, turn, camera):
    """(centre [2], covariance [2, 2]) on the screen, in px."""
    x, y, z = place
    rotation = transform.Rotation.from_quat(
        gaussians.quaternions[i], scalar_first=True
    ).as_matrix()
    axes = turn @ rotation * gaussians.scales[i].astype(np.float64)
    beside = 0.15 * np.array([camera.width, camera.height])
    centre = np.array([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy])
    # The Jacobian is taken where the ray leaves the picture and its margin.
    kept = np.clip(centre, -beside, np.add([camera.width, camera.height], beside))
    across, down = (kept - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    jacobian = np.array(
        [
            [camera.fx / z, 0, -camera.fx * across / z],
            [0, camera.fy / z, -camera.fy * down / z],
        ]
    )
    return centre, jacobian @ axes @ axes.T @ jacobian.T


def in_tiles(x, y, centre, covariance):
    """Mask [h, w] of the tiles that 3 standard deviations reach."""
    radius = np.ceil(3 * np.sqrt(np.linalg.eigvalsh(covariance)[1]))
    least = np.floor((centre - radius) / TILE)
    most = np.ceil((centre + radius) / TILE)
    tile = np.floor(np.stack([x, y], axis=-1) / TILE)
    return ((tile >= least) & (tile < most)).all(axis=-1)


def shade(sh, directions):
    """Colours [n, 3] of spherical harmonics [n, k, 3], by Legendre's functions."""
    x, y, z = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).T
    theta, phi = np.arccos(z), np.arctan2(y, x)
    basis = []
    for degree in range(round(np.sqrt(sh.shape[1]))):
        for order in range(-degree, degree + 1):
            value = special.sph_harm_y(degree, abs(order), theta, phi)
            part = value.imag if order < 0 else value.real
            basis.append(part * (np.sqrt(2) if order else 1))
    return np.maximum(np.einsum("kn,nkc->nc", basis, sh) + 0.5, 0)
