"""A scene that is known exactly, for in-loop alignment.

A plane with a smooth texture, rendered by a method that has nothing to learn: what the
aligner finds is the cameras' error, and the motion of a thing in one photo.
"""

import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from alignerf.alignment import aligner, look
from alignerf.io import images
from alignerf.methods import align
from alignerf.mipnerf360 import model
from alignerf.scenes import cameras, prepared
from alignerf.training import batches, methods, renderer
from tests import training_cases as cases

WIDTH, HEIGHT, FOCAL_PX, COUNT = 180, 144, 150.0, 8
ALIGN = {"cameras_at": [0.2, 0.4], "photos_at": [0.4], "shrink": 3}


def texture(place):
    """Colours of places [n, 2] on the plane; no two parts of it look alike."""
    x, y = place[:, 0], place[:, 1]
    waves = [
        jnp.sin(7.0 * x + 3.1 * jnp.sin(2.3 * y)),
        jnp.sin(9.0 * y + 2.7 * jnp.sin(3.1 * x)),
        jnp.sin(5.0 * (x + y) + jnp.sin(4.3 * (x - y))),
    ]
    return 0.5 + 0.3 * jnp.stack(waves, axis=-1)


def render(params, rays):
    """The plane z = -2, which leans a little towards y."""
    normal = jnp.array([0.0, 0.3, 1.0])
    t = -(2.0 + rays.origins @ normal) / (rays.directions @ normal)
    places = rays.origins + t[:, None] * rays.directions
    return model.Rendering(texture(places[:, :2]), t, ())


METHOD = methods.Method(1, None, None, None, render, lambda params, values: values)


def poses_of(rng):
    poses = np.repeat(np.eye(4)[None, :3], COUNT, axis=0)
    poses[:, :, 3] = rng.uniform(-1, 1, size=(COUNT, 3)) * [1, 1, 0.2]
    return poses


def turned(poses, rng, px):
    found = poses.copy()
    for pose in found[1:]:
        turn = Rotation.from_rotvec(rng.normal(size=3) * [1, 1, 0.3] * px / FOCAL_PX)
        pose[:, :3] = pose[:, :3] @ turn.as_matrix()
    return found


def make_scene(folder, true, given, photo_of=lambda i, photo: photo):
    """A prepared scene whose photos were taken by other cameras than are given."""
    pixtocam = cameras.intrinsics(FOCAL_PX, WIDTH, HEIGHT)
    (folder / "images").mkdir(parents=True)
    np.savez(
        folder / "cameras.npz",
        pixtocams=np.stack([pixtocam] * COUNT),
        camtoworlds=given,
        names=[f"v{i}" for i in range(COUNT)],
        width=WIDTH,
        height=HEIGHT,
        split=["test", *["train"] * (COUNT - 1)],
    )
    loaded = prepared.load(folder)
    # The truth in the frame that the given cameras are normalised to.
    seen = cameras.frame_of(given).normalised(true)
    paint = renderer.make_renderer(METHOD, {}, WIDTH, HEIGHT)
    for i in range(COUNT):
        photo = photo_of(i, paint(pixtocam, seen[i])[0])
        images.write(folder / f"images/v{i}.png", photo)
    return loaded, seen


def aligner_of(loaded, folder, **changes):
    scene = look.Scene(loaded, loaded.views("train"), loaded.folder / "images")
    job = cases.job_of()
    job = align.Job(**dict(job), align=align.Align(**ALIGN | changes))
    found = aligner.Aligner(job, scene, folder, METHOD)
    found.begin(10, "this")
    return found


def error_px(state, true, gauged=True):
    """Mean distance of where the state's and the true cameras see the plane.

    gauged: without what all training views have in common.
    """
    train = state.views("train")
    if gauged:
        gauge = cameras.align_similarity(true[train], state.camtoworlds[train])
        true = cameras.apply_similarity(true, *gauge)
    errors = []
    for i in train:
        place = np.array([[0.2, -0.1, -2.0], [-0.4, 0.3, -2.0]])
        ends = [
            cameras.project(place, state.pixtocams[i], p[i])[0]
            for p in (true, state.camtoworlds)
        ]
        errors.append(np.linalg.norm(ends[0] - ends[1], axis=-1))
    return float(np.mean(errors))


def views_of(loaded):
    chosen = loaded.views("train")
    return batches.load_views(loaded, chosen, loaded.folder / "images")
