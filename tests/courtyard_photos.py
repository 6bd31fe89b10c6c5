"""Neighbouring photos of the courtyard at rest, and what its cameras see."""

from alignerf.courtyard import rays, scene
from alignerf.io import images


def write(folder, count, width=240, height=180):
    """(names, pixtocams, camtoworlds) of the photos; true cameras."""
    world = scene.build_world(seed=0)
    cameras = scene.make_cameras(views=60, width=width, height=height, seed=0)
    names = [f"view {i}" for i in range(count)]
    for name, *camera in zip(names, *cameras, strict=False):
        photo = scene.render(world, *camera, width, height, scene.at_rest())
        images.write(folder / f"{name}.png", photo)
    return names, *(one[:count] for one in cameras)


def seen(world, pixtocam, camtoworld, width, height, displacements):
    """(depth in metres, index of the object) [h, w] at pixel centres."""
    x, y = scene.pixel_centres(width, height)
    hits = rays.cast(world, pixtocam, camtoworld, x, y, displacements)
    objects = rays.part_objects(world)[hits.part]
    return hits.t.reshape(height, width), objects.reshape(height, width)
