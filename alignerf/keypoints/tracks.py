"""Tracks of COLMAP's model as arrays, and how a patch of one view looks in another.

Notation: o observations, sorted by track; t tracks; n views, in order of image ids.
Pixels are the model's, centres at +0.5.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

# A step along a surface or a ray, in units of the distance: small, and far from
# rounding.
STEP = 1e-4


class Tracks(NamedTuple):
    """The tracks of a model; `reference` [t] is an observation of each."""

    ids: Int[np.ndarray, " t"]
    xyz: Float[np.ndarray, "t 3"]
    track: Int[np.ndarray, " o"]
    view: Int[np.ndarray, " o"]
    keypoint: Int[np.ndarray, " o"]
    xy: Float[np.ndarray, "o 2"]
    reference: Int[np.ndarray, " t"]

    @property
    def own(self):
        """[o] the observation of each one's reference."""
        return self.reference[self.track]

    @property
    def is_reference(self):
        """[o] whether an observation is its track's reference."""
        return self.own == np.arange(len(self.track))


class Views(NamedTuple):
    """The posed views of a model; camera [n] indexes `cameras`."""

    ids: list[int]
    rotations: Float[np.ndarray, "n 3 3"]
    shifts: Float[np.ndarray, "n 3"]
    camera: Int[np.ndarray, " n"]
    cameras: list

    @property
    def centres(self):
        return -np.einsum("nji,nj->ni", self.rotations, self.shifts)

    @property
    def focal_px(self):
        """[n] mean focal length of each view."""
        each = [camera.mean_focal_length() for camera in self.cameras]
        return np.array(each)[self.camera]

    def project(self, view, xyz):
        """Px [o, 2] of points [o, 3] in the views [o]; NaN behind a camera."""
        seen = np.einsum("oij,oj->oi", self.rotations[view], xyz) + self.shifts[view]
        xy = np.full((len(xyz), 2), np.nan)
        for number, camera in enumerate(self.cameras):
            own = self.camera[view] == number
            if own.any():
                xy[own] = camera.img_from_cam(seen[own], check_cheirality=False)
        xy[seen[:, 2] <= 0] = np.nan
        return xy


def views_of(model) -> Views:
    """The posed views of COLMAP's model."""
    ids = sorted(n for n, image in model.images.items() if image.has_pose)
    numbers = sorted(model.cameras)
    poses = np.stack([model.images[n].cam_from_world().matrix() for n in ids])
    return Views(
        ids,
        poses[:, :, :3],
        poses[:, :, 3],
        np.array([numbers.index(model.images[n].camera_id) for n in ids]),
        [model.cameras[number] for number in numbers],
    )


def tracks_of(model, views: Views) -> Tracks:
    """The tracks of COLMAP's model; a reference is the most central view."""
    place = {number: i for i, number in enumerate(views.ids)}
    ids = np.array(sorted(model.points3D), dtype=int)
    track, view, keypoint, xy = [], [], [], []
    points = {n: model.images[n].points2D for n in views.ids}
    for k, number in enumerate(ids):
        for one in model.points3D[number].track.elements:
            track.append(k)
            view.append(place[one.image_id])
            keypoint.append(one.point2D_idx)
            xy.append(points[one.image_id][one.point2D_idx].xy)
    track, view = np.array(track, int), np.array(view, int)
    xyz = np.array([model.points3D[n].xyz for n in ids]).reshape(-1, 3)
    return Tracks(
        ids,
        xyz,
        track,
        view,
        np.array(keypoint, int),
        np.array(xy).reshape(-1, 2),
        max_central(views, xyz, track, view),
    )


def first_of_each(track):
    """[t] where each track begins in sorted numbers [o] of tracks."""
    return np.flatnonzero(np.diff(track, prepend=-1))


def max_central(views, xyz, track, view):
    """[t] the observation of each track that lies amid the others, by side and size.

    One far from the others' scale shows too little to them, or too much.
    """
    if not len(track):
        return np.zeros(0, int)
    ray = xyz[track] - views.centres[view]
    away = np.linalg.norm(ray, axis=1)
    starts = first_of_each(track)
    middle = np.add.reduceat(ray / away[:, None], starts)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    size = np.log(views.focal_px[view] / away)
    usual = np.add.reduceat(size, starts) / np.diff([*starts, len(track)])
    off = 1 - np.einsum("oi,oi->o", ray / away[:, None], middle[track])
    off += (size - usual[track]) ** 2
    order = np.lexsort([off, track])
    return order[starts]


class Warps(NamedTuple):
    """How each observation's view sees its track's reference patch.

    predicted [o, 2]: where it sees the reference's keypoint. affine [o, 2, 2]: from px
    of the reference to its px, for a plane that faces the mean view. slope [o, 2]: what
    a px of offset is moved by, where depth grows by 1 / focal length on it.
    """

    predicted: Float[np.ndarray, "o 2"]
    affine: Float[np.ndarray, "o 2 2"]
    slope: Float[np.ndarray, "o 2"]

    def take(self, chosen):
        return Warps(*(one[chosen] for one in self))

    def bent(self, slopes):
        """[o, 2, 2] affine of surfaces of these slopes [o, 2]."""
        return self.affine + self.slope[:, :, None] * slopes[:, None, :]

    def scaled(self, ratios, own):
        """In px of photos that are `ratios` [o, 2] times as large.

        own [o]: the observation of each track's reference.
        """
        focal = ratios[own].mean(axis=1, keepdims=True)
        return Warps(
            self.predicted * ratios,
            ratios[:, :, None] * self.affine / ratios[own][:, None, :],
            ratios * self.slope / focal,
        )


def warps_of(tracks: Tracks, views: Views) -> Warps:
    """The `Warps` of tracks; NaN where a view does not see the plane."""
    track, view = tracks.track, tracks.view
    xyz = tracks.xyz[track]
    ray = xyz - views.centres[view]
    away = np.linalg.norm(ray, axis=1, keepdims=True)
    starts = first_of_each(track)
    normal = np.add.reduceat(ray / away, starts)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    own = tracks.own
    step = STEP * away[own]
    places = [
        xyz,
        xyz + step * across[track],
        xyz + step * np.cross(normal, across)[track],
        # Along the reference's ray.
        xyz + STEP * ray[own],
    ]
    here, u, v, far = (views.project(view, one) for one in places)
    jacobian = np.stack([u - here, v - here], axis=-1)
    with np.errstate(all="ignore"):
        inverse = inverted(jacobian[own])
        affine = jacobian @ inverse
        slope = (far - here) / STEP / views.focal_px[view[own]][:, None]
        off = tracks.xy[own] - here[own]
        predicted = here + np.einsum("oij,oj->oi", affine, off)
    return Warps(predicted, affine, slope)


def inverted(matrices):
    """Inverses of matrices [o, 2, 2]; not finite where there is none."""
    (a, b), (c, d) = matrices.transpose(1, 2, 0)
    with np.errstate(all="ignore"):
        inverse = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    return inverse.transpose(2, 0, 1)
