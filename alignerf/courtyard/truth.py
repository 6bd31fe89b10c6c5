"""What only an embedded scene knows: its photos' true cameras, and what follows.

Notation: n views by name; `pixtocams` [n, 3, 3], `camtoworlds` [n, 3, 4]; `given` is
what training is told, `true` what the photos were taken with, both in metres and both
at the resolution of training; `displacements` [n, objects, 3] in metres. The oracle of
a view is the scene without displacements, seen by the given camera; the true flow goes
from the oracle to the photo.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import ndimage

from alignerf.courtyard import rays as courtyard_rays
from alignerf.courtyard import scene as courtyard
from alignerf.io import images, machine
from alignerf.scenes import cameras, prepare

# Around what moves, in pixels of training: as far as the lens blurs it.
MARGIN_PX = 3


class Courtyard(NamedTuple):
    """The embedded scene with one camera and one state of its objects per photo."""

    world: object
    names: list[str]
    pixtocams: Float[np.ndarray, "n 3 3"]
    camtoworlds: Float[np.ndarray, "n 3 4"]
    displacements: Float[np.ndarray, "n objects 3"]
    two_states: bool
    width: int
    height: int
    supersample: int
    lens_sigma_px: float


def build_courtyard(
    *,
    place,
    views,
    zooms,
    width,
    height,
    motion,
    motion_m,
    moving,
    supersample,
    lens_sigma_px,
    seed,
) -> Courtyard:
    """The courtyard of a seed; motion as in `scene.draw_displacements`."""
    # The world comes last: it takes seconds, and the rest refuses faults at once.
    pixtocams, camtoworlds = courtyard.make_cameras(
        views=views, width=width, height=height, zooms=zooms, seed=seed
    )
    displacements = courtyard.draw_displacements(
        views=views, motion=motion, motion_m=motion_m, moving=moving, seed=seed
    )
    return Courtyard(
        world=courtyard.build_world(seed=seed, place=place),
        names=[f"view_{i:03d}" for i in range(views)],
        pixtocams=pixtocams,
        camtoworlds=camtoworlds,
        displacements=displacements,
        two_states=motion == "two_states",
        width=width,
        height=height,
        supersample=supersample,
        lens_sigma_px=lens_sigma_px,
    )


def write_photos(folder, scene: Courtyard):
    """Write <folder>/<name>.png, the photos at full size."""

    def write(i):
        photo = courtyard.render(
            scene.world,
            scene.pixtocams[i],
            scene.camtoworlds[i],
            scene.width,
            scene.height,
            scene.displacements[i],
            supersample=scene.supersample,
            lens_sigma_px=scene.lens_sigma_px,
        )
        images.write(folder / f"{scene.names[i]}.png", photo)

    for _ in machine.map_in_threads(write, range(len(scene.names))):
        pass


def select(scene: Courtyard, names) -> Courtyard:
    """The scene's photos of these names, in this order."""
    index = [scene.names.index(name) for name in names]
    return scene._replace(
        names=list(names),
        pixtocams=scene.pixtocams[index],
        camtoworlds=scene.camtoworlds[index],
        displacements=scene.displacements[index],
    )


def write_truth(
    folder, scene: Courtyard, given: prepare.PosedViews, *, split, perturb_px=0.0
):
    """Write oracle/<name>.png, depth/ and flow/<name>.npz, cameras.npz (the true ones).

    depth_m [h, w] is the oracle's, along the optical axis. Of objects with two states
    also moving/<name>.npz: where either state shows them, with a margin into which the
    lens, and poses off by perturb_px, blur them. `scene` must hold the
    photos of `given`, in its order. Returns the mean length in px, over all views and
    valid pixels, of the true flow: the misalignment that the photos really have.
    """
    ratios = given.width / scene.width, given.height / scene.height
    true = given._replace(
        pixtocams=cameras.rescale_intrinsics(scene.pixtocams, *ratios),
        camtoworlds=scene.camtoworlds,
    )
    margin_px = MARGIN_PX + int(np.ceil(3 * perturb_px))
    for kind in ("oracle", "depth", "flow", *["moving"] * scene.two_states):
        (folder / kind).mkdir(parents=True)

    def write(i):
        name = given.names[i]
        image, depth_m = render_oracle(scene, given, i)
        images.write(folder / "oracle" / f"{name}.png", image)
        np.savez_compressed(folder / "depth" / f"{name}.npz", depth_m=depth_m)
        flow_px, valid = courtyard.true_flow(
            scene.world,
            (given.pixtocams[i], given.camtoworlds[i]),
            (true.pixtocams[i], true.camtoworlds[i]),
            given.width,
            given.height,
            scene.displacements[i],
        )
        np.savez_compressed(
            folder / "flow" / f"{name}.npz",
            flow_px=flow_px.astype(np.float32),
            valid=valid,
        )
        if scene.two_states:
            moving = shows_moving(scene, given, i, margin_px)
            np.savez_compressed(folder / "moving" / f"{name}.npz", moving=moving)
        return np.linalg.norm(flow_px, axis=-1)[valid]

    lengths_px = list(machine.map_in_threads(write, range(len(given.names))))
    prepare.write_cameras(folder / "cameras.npz", true, split=split)
    return float(np.concatenate(lengths_px).mean())


def render_oracle(scene: Courtyard, given: prepare.PosedViews, i):
    """Image [h, w, 3] and depth_m [h, w] of the undisplaced scene, seen as given.

    The image is made as its photo is: taken at full size, blurred by the lens, then
    made smaller.
    """
    ratios = scene.width / given.width, scene.height / given.height
    photo = courtyard.render(
        scene.world,
        cameras.rescale_intrinsics(given.pixtocams[i], *ratios),
        given.camtoworlds[i],
        scene.width,
        scene.height,
        courtyard.at_rest(),
        supersample=scene.supersample,
        lens_sigma_px=scene.lens_sigma_px,
    )
    hits = cast_pixels(scene, given, i, courtyard.at_rest())
    depth_m = hits.t.reshape(given.height, given.width).astype(np.float32)
    image = prepare.shrink(photo, given.width, given.height)
    return image, depth_m


def cast_pixels(scene: Courtyard, given: prepare.PosedViews, i, displacements):
    """What the rays through the pixels' centres meet, seen as given."""
    x, y = courtyard.pixel_centres(given.width, given.height)
    camera = given.pixtocams[i], given.camtoworlds[i]
    return courtyard_rays.cast(scene.world, *camera, x, y, displacements)


def shows_moving(scene: Courtyard, given: prepare.PosedViews, i, margin_px):
    """Mask [h, w] of what any photo displaces: where it is then, and at rest."""
    farthest = np.abs(scene.displacements).argmax(axis=0)
    displaced = np.take_along_axis(scene.displacements, farthest[None], axis=0)[0]
    moves = displaced.any(axis=-1)
    objects = courtyard_rays.part_objects(scene.world)
    shown = np.zeros((given.height, given.width), bool)
    for displacements in (courtyard.at_rest(), displaced):
        hits = cast_pixels(scene, given, i, displacements)
        shown |= moves[objects[hits.part]].reshape(shown.shape)
    return ndimage.binary_dilation(shown, iterations=margin_px)
