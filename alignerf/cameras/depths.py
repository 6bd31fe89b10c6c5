"""How far the cameras of a scene see, by what its files say, not by a training."""

import numpy as np

from alignerf.files import archives
from alignerf.scenes import cameras, prepared


def known(loaded: prepared.Scene):
    """Depths [n] in the normalised frame, of all views; empty where nothing says any.

    From LLFF's bounds, else from the points of COLMAP.
    """
    found = of_bounds(loaded)
    return found if len(found) else of_points(loaded)


def median(loaded: prepared.Scene):
    """Median depth in the normalised frame; None where nothing says any."""
    found = known(loaded)
    return float(np.median(found)) if len(found) else None


def of_points(loaded: prepared.Scene):
    """Depths of COLMAP's points in every view whose image they fall into."""
    path = loaded.folder / prepared.POINTS
    if not path.is_file():
        return np.zeros(0)
    points = archives.read(path, ("points",))["points"]
    transform = normalisation(loaded)
    points = points @ transform[:3, :3].T + transform[:3, 3]
    depths = []
    for pixtocam, pose in zip(loaded.pixtocams, loaded.camtoworlds, strict=True):
        at, depth = cameras.project(points, pixtocam, pose)
        inside = (depth > 0) & (at > 0).all(-1)
        inside &= (at < [loaded.width, loaded.height]).all(-1)
        depths.append(depth[inside])
    return np.concatenate(depths)


def of_bounds(loaded: prepared.Scene):
    """LLFF's two depths of each view, and their harmonic mean."""
    path = loaded.folder / prepared.BOUNDS
    if not path.is_file():
        return np.zeros(0)
    scale = np.cbrt(np.linalg.det(normalisation(loaded)[:3, :3]))
    bounds = archives.read(path, ("bounds",))["bounds"] * scale
    # What LLFF could not tell is no fact.
    told = np.isfinite(bounds).all(-1) & (bounds[:, 0] > 0)
    near, far = bounds[told & (bounds[:, 1] > bounds[:, 0])].T
    return np.concatenate([near, 2 / (1 / near + 1 / far), far])


def normalisation(loaded: prepared.Scene):
    """The similarity [4, 4] from the frame of the scene's files to the normalised."""
    own = prepared.read_cameras(loaded.folder / "cameras.npz")["camtoworlds"]
    return cameras.frame_of(own).transform()
