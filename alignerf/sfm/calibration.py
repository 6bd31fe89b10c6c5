"""Cameras of n views with their lenses, and what matches say of them.

Notation: m matches; `views` [m, 2] indices of the views; `xy` [m, 2, 2] their
keypoints in px. A match's error is the mean distance in px of its two keypoints from
each other's epipolar line (Hartley & Zisserman 2004, section 11.4). It is blind to
errors along the line, and the same for all right cameras: 0.2 to 0.5 px of SIFT.
"""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float, Int

from alignerf.scenes import cameras as scene_cameras
from alignerf.scenes import distortion as lens
from alignerf.scenes import prepare
from alignerf.sfm.matches import Matches

# Centres within so much of the cameras' extent have no epipolar lines between them.
ONE_PLACE = 1e-7


class Cameras(NamedTuple):
    """Cameras of n views, in px of images of one size.

    camtopix [n, 3, 3]; distortion [n, 5] as in `scenes.distortion`.
    """

    camtopix: Float[np.ndarray, "n 3 3"]
    camtoworlds: Float[np.ndarray, "n 3 4"]
    distortion: Float[np.ndarray, "n 5"]

    @property
    def pixtocams(self):
        return np.linalg.inv(self.camtopix)

    def scaled(self, ratios):
        """The cameras of images resized by (width ratio, height ratio)."""
        return self._replace(camtopix=np.diag([*ratios, 1.0]) @ self.camtopix)


def of_views(views: prepare.PosedViews, matches: Matches) -> Cameras:
    """The pinhole cameras of views, in px of the matches."""
    ratios = matches.width / views.width, matches.height / views.height
    none = np.zeros((len(views.names), 5))
    cameras = Cameras(np.linalg.inv(views.pixtocams), views.camtoworlds, none)
    return cameras.scaled(ratios)


def undistorted(matches: Matches, cameras: Cameras) -> Matches:
    """The matches as pinholes of the same `camtopix` would have them."""
    keypoints = [
        pinhole_points(xy, *one)
        for xy, *one in zip(
            matches.keypoints, cameras.camtopix, cameras.distortion, strict=True
        )
    ]
    return matches._replace(keypoints=keypoints)


def errors_of_views(matches: Matches, cameras: Cameras, *, held_out=None):
    """[n] median epipolar error of each view's matches in px; NaN without any.

    held_out: of one part of the matches alone.
    """
    views, errors = errors_of_matches(matches, cameras, held_out=held_out)
    return by_view(views, errors, len(matches.names))


def errors_of_matches(matches: Matches, cameras: Cameras, *, held_out=None):
    """(views [m, 2], epipolar error in px [m]) of matches; held_out: of one part."""
    views, xy = undistorted(matches, cameras).places(held_out=held_out)
    return views, errors_px(views, xy, cameras.pixtocams, cameras.camtoworlds)


def in_views(matches: Matches, cameras: Cameras, views: prepare.PosedViews) -> Matches:
    """The matches in px of views whose distortion by these cameras was undone."""
    straight, to = undistorted(matches, cameras), of_views(views, matches).camtopix
    moved = to @ cameras.pixtocams
    keypoints = [
        xy @ one[:2, :2].T + one[:2, 2]
        for xy, one in zip(straight.keypoints, moved, strict=True)
    ]
    return straight._replace(keypoints=keypoints)


def pinhole_points(xy, camtopix, coefficients):
    """Px [k, 2] in the pinhole view of the same `camtopix` of px in the photo."""
    if lens.is_pinhole(coefficients) or not len(xy):
        return xy
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-10)
    straight = cv2.undistortPoints(
        xy[:, None].astype(float), camtopix, coefficients, criteria=criteria
    )[:, 0]
    return straight @ camtopix[:2, :2].T + camtopix[:2, 2]


def applied(views: prepare.PosedViews, cameras: Cameras, where) -> prepare.PosedViews:
    """The views by other cameras, in px of theirs; a distortion is undone.

    Raises ValueError naming `where` for one that no pinhole view undoes.
    """
    found = lens.pinhole_views(
        views.names,
        list(zip(cameras.camtopix, cameras.distortion, strict=True)),
        cameras.camtoworlds,
        width=views.width,
        height=views.height,
        photos=views.photos,
        masks=views.masks,
        where=where,
    )
    kept = {key: getattr(views, key) for key in ("points", "bounds", "split")}
    if cameras.distortion.any():
        kept["lens"] = {k: getattr(cameras, k) for k in ("camtopix", "distortion")}
    return found._replace(**kept)


class Geometry(NamedTuple):
    """The two cameras of each match, in the world's frame, with OpenCV axes."""

    rays: Float[np.ndarray, "m 2 3"]
    """Through the keypoints, of depth 1 along the optical axis."""
    centres: Float[np.ndarray, "m 2 3"]


def geometry(views, xy, pixtocams, camtoworlds) -> Geometry:
    """The rays of matches, and where they start."""
    turns = camtoworlds[:, :, :3] @ scene_cameras.OPENGL_FROM_OPENCV @ pixtocams
    homogeneous = np.concatenate([xy, np.ones((*xy.shape[:2], 1))], axis=-1)
    rays = np.einsum("mvij,mvj->mvi", turns[views], homogeneous)
    return Geometry(rays, camtoworlds[:, :, 3][views])


def errors_px(
    views: Int[np.ndarray, "m 2"],
    xy: Float[np.ndarray, "m 2 2"],
    pixtocams: Float[np.ndarray, "n 3 3"],
    camtoworlds: Float[np.ndarray, "n 3 4"],
) -> Float[np.ndarray, " m"]:
    """Error of each match; between cameras at one place, of the turned ray instead."""
    extent = np.ptp(camtoworlds[:, :, 3], axis=0).max(initial=0)
    rays, centres = geometry(views, xy, pixtocams, camtoworlds)
    base = centres[:, 1] - centres[:, 0]
    length = np.linalg.norm(base, axis=-1)
    apart = length > ONE_PLACE * max(extent, 1e-300)
    base = base / np.where(apart, length, 1)[:, None]
    # World to homogeneous px of each end.
    inverse = np.linalg.inv(
        camtoworlds[:, :, :3] @ scene_cameras.OPENGL_FROM_OPENCV @ pixtocams
    )
    total = np.zeros(len(views))
    for own, other in ((0, 1), (1, 0)):
        to_px = inverse[views[:, own]]
        here, seen = xy[:, own], np.einsum("mij,mj->mi", to_px, rays[:, other])
        pole = np.einsum("mij,mj->mi", to_px, base)
        line = np.cross(pole, seen)
        norm = np.linalg.norm(line[:, :2], axis=-1)
        off = np.abs((line[:, :2] * here).sum(-1) + line[:, 2])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            by_line = off / norm
            by_turn = np.linalg.norm(seen[:, :2] / seen[:, 2:] - here, axis=-1)
        total += np.where(apart & (norm > 0), by_line, by_turn)
    return total / 2


def in_front(views, xy, pixtocams, camtoworlds):
    """[m] whether a match's rays meet in front of both cameras."""
    depths, _ = nearest(views, xy, pixtocams, camtoworlds)
    return (depths > 0).all(axis=-1)


def nearest(views, xy, pixtocams, camtoworlds):
    """(depths [m, 2] of where a match's rays are nearest, times [m] which is >= 0)."""
    rays, centres = geometry(views, xy, pixtocams, camtoworlds)
    (a, b), base = rays.swapaxes(0, 1), centres[:, 1] - centres[:, 0]
    aa, ab, bb = (a * a).sum(-1), (a * b).sum(-1), (b * b).sum(-1)
    at, bt = (a * base).sum(-1), (b * base).sum(-1)
    return np.stack([bb * at - ab * bt, ab * at - aa * bt], -1), aa * bb - ab**2


def by_view(views, errors, n):
    """[n] median error of each view's matches; NaN of a view without any."""
    ends, values = views.T.ravel(), np.concatenate([errors, errors])
    order = np.lexsort([values, ends])
    counts = np.bincount(ends, minlength=n)
    first = np.cumsum(counts) - counts
    ordered, found = values[order], np.full(n, np.nan)
    some = counts > 0
    low, high = (first + (counts - 1) // 2)[some], (first + counts // 2)[some]
    found[some] = (ordered[low] + ordered[high]) / 2
    return found
