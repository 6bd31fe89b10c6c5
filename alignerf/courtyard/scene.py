"""Courtyard: the embedded scene, procedural, unbounded, its truth known.

A miniature courtyard photographed from an arc of cameras: boxes, an arm, posts and
wires on grass and gravel, a brick wall, a hedge at 25 m, hills at 90 m and the sky
at 300 m. Some objects move between photos. Deterministic from the seeds.

Notation: metres; image arrays [h, w]; flow_px [h, w, 2] (x then y) leads from the
oracle, the undisplaced scene at a given pose, to the photo: photo(x + flow(x)) is
oracle(x). `displacements` [objects, 3] follows the order of OBJECTS.
"""

import numpy as np
from jaxtyping import Bool, Float, UInt8
from scipy import ndimage

from alignerf.courtyard import colours as courtyard_colours
from alignerf.courtyard import rays as courtyard_rays
from alignerf.courtyard import world as courtyard_world
from alignerf.scenes import cameras

OBJECTS = courtyard_world.OBJECTS
MOVING = courtyard_world.MOVING
build_world = courtyard_world.build_world

FIELD_OF_VIEW = np.deg2rad(60.0)
ARC = np.deg2rad(220.0)
# Every so many views one is held out, unless a config says otherwise.
SPLIT = 8
# Rays cast together: their arrays stay in the processor's cache.
CHUNK_RAYS = 1 << 16


def look_at(centre, target):
    """Pose [3, 4] of a camera at `centre` that looks at `target`, z being up."""
    backwards = centre - target
    backwards = backwards / np.linalg.norm(backwards)
    right = np.cross([0.0, 0.0, 1.0], backwards)
    right = right / np.linalg.norm(right)
    axes = [right, np.cross(backwards, right), backwards, centre]
    return np.stack(axes, axis=1)


def make_cameras(
    *, views: int, width: int, height: int, zooms=(1.0,), seed: int = 0
) -> tuple[Float[np.ndarray, "n 3 3"], Float[np.ndarray, "n 3 4"]]:
    """True cameras: pixtocams [n, 3, 3] and camtoworlds [n, 3, 4].

    An arc of 220 degrees about the boxes, neighbours in order, radius 1.2 to 1.9 m,
    heights 0.35 to 0.85 m; 60 degrees wide at a zoom of 1, which are taken in turn.
    """
    rng = np.random.default_rng([seed, 2])
    step = ARC / views
    azimuth = (np.arange(views) + 0.5 + rng.uniform(-0.3, 0.3, views)) * step - ARC / 2
    radius = rng.uniform(1.2, 1.9, views)
    tall = rng.uniform(0.35, 0.85, views)
    centres = np.stack(
        [radius * np.sin(azimuth), 0.2 - radius * np.cos(azimuth), tall], axis=1
    )
    targets = np.array([0.0, 0.2, 0.2]) + rng.uniform(-0.08, 0.08, (views, 3))
    poses = [look_at(c, t) for c, t in zip(centres, targets, strict=True)]
    # One on after every eighth view: the test views, as a rule every eighth, have all
    # zooms, too.
    order = np.arange(views) % SPLIT + np.arange(views) // SPLIT
    focal_px = width / 2 / np.tan(FIELD_OF_VIEW / 2)
    pixtocams = [
        cameras.intrinsics(focal_px * zooms[turn % len(zooms)], width, height)
        for turn in order
    ]
    return np.stack(pixtocams), np.stack(poses)


def draw_displacements(
    *, views: int, motion: str, motion_m=0.02, seed: int = 0, moving=MOVING
) -> Float[np.ndarray, "views objects 3"]:
    """Displacements [views, objects, 3] in metres of each object in each photo.

    motion: 'none'; 'uniform' (anywhere in a disc on the ground of radius motion_m);
    'two_states' (at rest or motion_m away in the object's own direction, each with
    probability 0.5: AligNeRF's moving arm, arXiv 2211.09682). Only the objects named
    in `moving` are displaced.
    """
    rng = np.random.default_rng([seed, 3])
    shape = (views, len(OBJECTS))
    if motion == "uniform":
        length_m = motion_m * np.sqrt(rng.random(shape))
        angle = rng.uniform(0, 2 * np.pi, shape)
    elif motion == "two_states":
        length_m = motion_m * rng.integers(2, size=shape)
        angle = np.broadcast_to(rng.uniform(0, 2 * np.pi, len(OBJECTS)), shape)
    else:
        length_m, angle = np.zeros(shape), np.zeros(shape)
    moves = length_m * np.isin(OBJECTS, moving)
    return np.stack([moves * np.cos(angle), moves * np.sin(angle), 0 * moves], axis=-1)


def at_rest():
    """Displacements [objects, 3] of the undisplaced scene."""
    return np.zeros((len(OBJECTS), 3))


def pixel_centres(width, height):
    """Image positions x, y [h w] of all pixel centres, row by row."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return x.ravel(), y.ravel()


def render(
    world: courtyard_world.World,
    pixtocam: Float[np.ndarray, "3 3"],
    camtoworld: Float[np.ndarray, "3 4"],
    width: int,
    height: int,
    displacements: Float[np.ndarray, "objects 3"],
    *,
    supersample: int = 2,
    lens_sigma_px: float = 0.0,
) -> UInt8[np.ndarray, "h w 3"]:
    """Photo of the displaced scene; supersample x supersample rays a pixel.

    A pixel's colour is the mean of its rays (box filter), blurred by the lens (a
    Gaussian) and rounded to 8 bits.
    """
    scene = (world, pixtocam, camtoworld, displacements)
    x, y = pixel_centres(width, height)
    chunk = max(1, CHUNK_RAYS // supersample**2)
    image = np.zeros((len(x), 3), np.float32)
    for start in range(0, len(x), chunk):
        part = slice(start, start + chunk)
        image[part] = pixel_colours(scene, x[part], y[part], supersample)
    image, sigma = image.reshape(height, width, 3), (lens_sigma_px, lens_sigma_px, 0)
    image = ndimage.gaussian_filter(image, sigma, mode="nearest")
    return np.rint(image).astype(np.uint8)


def pixel_colours(scene, x_px, y_px, supersample):
    """Colours [N, 3] in [0, 255] of the pixels whose centres are x_px, y_px."""
    world, pixtocam, camtoworld, displacements = scene
    steps = (np.arange(supersample) + 0.5) / supersample - 0.5
    # Sub-samples come first, so that the box filter adds whole images.
    xs = (x_px + np.tile(steps, supersample)[:, None]).astype(np.float32).ravel()
    ys = (y_px + np.repeat(steps, supersample)[:, None]).astype(np.float32).ravel()
    hits = courtyard_rays.cast(world, pixtocam, camtoworld, xs, ys, displacements)
    spacing = pixtocam[0, 0] / supersample
    colours = courtyard_colours.colours(world, hits, displacements, spacing)
    return colours.reshape(supersample**2, len(x_px), 3).mean(axis=0)


def true_flow(
    world: courtyard_world.World,
    oracle_camera,
    photo_camera,
    width: int,
    height: int,
    displacements: Float[np.ndarray, "objects 3"],
) -> tuple[Float[np.ndarray, "h w 2"], Bool[np.ndarray, "h w"]]:
    """Flow [h, w, 2] in pixels from oracle to photo, and where it is valid [h, w].

    oracle_camera sees the undisplaced scene, photo_camera the displaced one; each is
    (pixtocam, camtoworld). Valid is where the oracle's surface point is in the
    photo's frame and nothing hides it there; elsewhere the flow is 0.
    """
    x, y = pixel_centres(width, height)
    hits = courtyard_rays.cast(world, *oracle_camera, x, y, at_rest())
    points = np.stack(courtyard_rays.ends(hits), axis=-1)
    points += displacements[courtyard_rays.part_objects(world)[hits.part]]
    photo_px, depth = cameras.project(points, *photo_camera)
    # Between the outermost pixel centres, so that an interpolation has neighbours;
    # a rounding error must not drop the border where nothing moves.
    slack_px = 1e-6
    last_px = np.array([width, height]) - 0.5
    inside = (photo_px >= 0.5 - slack_px) & (photo_px <= last_px + slack_px)
    valid = inside.all(axis=1) & (depth > 0)
    seen = courtyard_rays.cast(world, *photo_camera, *photo_px[valid].T, displacements)
    # The photo's ray ends on the same point but for rounding, unless it is hidden.
    valid[valid] = seen.t > depth[valid] * (1 - 1e-6)
    flow_px = photo_px - np.stack([x, y], axis=-1)
    flow_px[~valid] = 0
    shape = (height, width)
    return flow_px.reshape(*shape, 2).astype(np.float32), valid.reshape(shape)
