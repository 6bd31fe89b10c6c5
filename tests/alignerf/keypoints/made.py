"""The corner of a room, and COLMAP's model of it."""

from types import SimpleNamespace

import numpy as np
import pycolmap

from alignerf.colmap import structure
from alignerf.courtyard import scene
from alignerf.scenes import cameras
from alignerf.sfm import pose_error

WIDTH, HEIGHT, FOCAL_PX = 320, 240, 300.0


def poses(count=8):
    """World-to-camera rotations [n, 3, 3] (OpenCV's axes) and centres [n, 3]."""
    k = np.arange(count)
    angle, height = 0.35 + 0.85 * k / (count - 1), 1.6 + 0.6 * np.sin(2.5 * k)
    centres = np.stack([4.2 * np.cos(angle), 4.2 * np.sin(angle), height], axis=1)
    poses = np.array([scene.look_at(one, np.full(3, 0.7)) for one in centres])
    axes = poses[:, :, :3] @ cameras.OPENGL_FROM_OPENCV
    return axes.swapaxes(1, 2), centres


def points_on(rng, count):
    """Points [m, 3] on the three planes."""
    xyz = rng.uniform(0.15, 2.2, size=(count, 3))
    xyz[np.arange(count), np.arange(count) % 3] = 0
    return xyz


def model_of(turns, centres, xyz, rng, *, noise_px, middle=None, drift=0.0):
    """COLMAP's model: true poses and points, keypoints with noise. Ids from 1.

    drift [m, 3]: by so much a point moves from view to view.
    """
    middle = middle or (WIDTH / 2, HEIGHT / 2)
    model = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        model="SIMPLE_PINHOLE",
        params=[FOCAL_PX, *middle],
        width=WIDTH,
        height=HEIGHT,
        camera_id=1,
    )
    model.add_camera_with_trivial_rig(camera)
    seen_by = {k: [] for k in range(len(xyz))}
    for view, (turn, centre) in enumerate(zip(turns, centres, strict=True)):
        image = pycolmap.Image(name=f"v{view:02d}.png", camera_id=1, image_id=view + 1)
        seen = (xyz + drift * view - centre) @ turn.T
        xy = FOCAL_PX * seen[:, :2] / seen[:, 2:] + middle
        inside = ((xy > 12) & (xy < [WIDTH - 12, HEIGHT - 12])).all(axis=1)
        xy += noise_px * rng.normal(size=xy.shape)
        for number, k in enumerate(np.flatnonzero(inside)):
            seen_by[k].append((view + 1, number))
        places = [pycolmap.Point2D(one) for one in xy[inside]]
        image.points2D = pycolmap.Point2DList(places)
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(turn), -turn @ centre)
        model.add_image_with_trivial_frame(image, pose)
    for k, seen in seen_by.items():
        if len(seen) > 2:
            track = pycolmap.Track()
            for number, keypoint in seen:
                track.add_element(number, keypoint)
            point = pycolmap.Point3D(xyz=xyz[k], track=track)
            model.add_point3D_with_id(k + 1, point)
    model.update_point_3d_errors()
    return model


def error_px(model, turns, centres, xyz):
    """[n] pose error of each view, at the points [m, 3] in front of it."""
    true = cameras_of(turns, centres)
    poses = [structure.pose_of(image) for _, image in sorted(model.images.items())]
    lenses = [
        image.camera.calibration_matrix() for _, image in sorted(model.images.items())
    ]
    now = SimpleNamespace(camtopix=np.array(lenses), camtoworlds=np.array(poses))
    points = {view: xyz[:300] for view in range(len(turns))}
    return np.array(list(pose_error.distance_px(true, now, points).values()))


def cameras_of(turns, centres):
    """The true cameras, as `similarity` takes them."""
    camtopix = [[FOCAL_PX, 0, WIDTH / 2], [0, FOCAL_PX, HEIGHT / 2], [0, 0, 1]]
    rotations = turns.swapaxes(1, 2) @ cameras.OPENGL_FROM_OPENCV
    return SimpleNamespace(
        camtopix=np.tile(np.array(camtopix, float), (len(turns), 1, 1)),
        camtoworlds=np.concatenate([rotations, centres[:, :, None]], axis=2),
    )
