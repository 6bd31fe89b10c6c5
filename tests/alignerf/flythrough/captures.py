"""Captures of many kinds, as poses in the normalised frame."""

import numpy as np

from alignerf.flythrough import paths
from alignerf.scenes import cameras


def normalised(poses):
    """Poses as a prepared scene gives them."""
    return cameras.frame_of(poses).normalised(poses)


def looking(places, targets, up=(0.0, 0.0, 1.0)):
    """Cameras at places [n, 3] that look at targets [n, 3]."""
    targets = np.broadcast_to(targets, np.shape(places))
    turns = [
        paths.looking_at(place[None], target, np.array(up))[0]
        for place, target in zip(np.asarray(places), targets, strict=True)
    ]
    return np.concatenate([np.stack(turns), np.asarray(places)[..., None]], axis=-1)


def ring(count=24, share=1.0, *, outwards=False, noise=0.02, seed=0):
    """Cameras on a part of a circle, 1.5 above what is in its middle."""
    rng = np.random.default_rng(seed)
    angles = 2 * np.pi * share * np.arange(count) / count
    places = np.stack([4 * np.cos(angles), 4 * np.sin(angles), 0 * angles], axis=-1)
    places = places + rng.normal(size=places.shape) * noise
    return looking(places, 2 * places if outwards else np.array([0.0, 0.0, -1.5]))


def wall(rows=5, columns=7):
    """Cameras in a plane that all look the same way."""
    x, z = np.meshgrid(np.arange(columns), np.arange(rows))
    places = np.stack([x.ravel(), 0.0 * x.ravel(), 0.7 * z.ravel()], axis=-1)
    return looking(places, places + np.array([0.0, 5.0, 0.0]))


def walk(count=40, seed=0):
    """A walk along a street with a bend, looking ahead, its photos shuffled."""
    rng = np.random.default_rng(seed)
    at = np.linspace(0, 1, count)
    places = np.stack([9 * at, 4 * at**2, 0.1 * np.sin(9 * at)], axis=-1)
    ahead = np.gradient(places, axis=0) * [1, 1, 0]
    return looking(places, places + ahead)[rng.permutation(count)]


def panorama(count=12):
    """Cameras at one place that look around."""
    angles = 2 * np.pi * np.arange(count) / count
    around = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    return looking(np.zeros((count, 3)), around)


EVERY = {
    "ring": ring(),
    "arc": ring(share=0.4),
    "outwards": ring(outwards=True),
    "wall": wall(),
    "walk": walk(),
    "panorama": panorama(),
    "two": ring(2, share=0.1),
    "three": ring(3, share=0.2),
}
