"""Cameras of n views with their lenses, and keypoints freed of distortion."""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float

from alignerf.scenes import distortion as lens
from alignerf.scenes import prepare
from alignerf.sfm import epipolar
from alignerf.sfm.matches import Matches


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
    views, xy = undistorted(matches, cameras).places(held_out=held_out)
    errors = epipolar.errors_px(views, xy, cameras.pixtocams, cameras.camtoworlds)
    return epipolar.by_view(views, errors, len(matches.names))


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
