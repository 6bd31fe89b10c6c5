"""Cameras of a scene after corrections by flow, in the frame that they had."""

import dataclasses

import numpy as np

from alignerf.cameras import moves
from alignerf.scenes import cameras, prepared
from flow.camera import motion as camera_motion


def corrected(before: prepared.Scene, train, corrections) -> prepared.Scene:
    """The scene with its cameras moved, and the frame where it was.

    train [n]: indices of the views; corrections: a `correct.Correction` of each.
    What all corrections have in common (a turn, a shift and a scale of the world)
    cannot be seen in any photo, and is taken out. Views that are left alone count as
    corrections of zero, and so hold the frame. A corrected lens is that of every view.
    """
    after, moved = followed(before, train, corrections), moved_views(train, corrections)
    camtoworlds = after.camtoworlds.copy()
    in_common = common(before, train, corrections)
    camtoworlds[moved] = cameras.apply_similarity(camtoworlds[moved], *in_common)
    return dataclasses.replace(after, camtoworlds=camtoworlds)


def followed(before: prepared.Scene, train, corrections) -> prepared.Scene:
    """The scene with its cameras moved as they ask for; nothing is taken out."""
    camtoworlds = before.camtoworlds.copy()
    zoom = np.exp(-zoom_of(corrections))
    pixtocams = np.diag([zoom, zoom, 1.0]) @ before.pixtocams
    for view, correction in zip(train, corrections, strict=True):
        _, camtoworlds[view] = camera_motion.apply(
            correction.motion, pixtocams[view], camtoworlds[view]
        )
    return dataclasses.replace(before, pixtocams=pixtocams, camtoworlds=camtoworlds)


def common(before: prepared.Scene, train, corrections):
    """(scale, rotation, translation) that takes out what corrections have in common.

    A camera that is found in the world of the renders has to go the same way, to stand
    where the corrected ones do.
    """
    if not moved_views(train, corrections):
        return 1.0, np.eye(3), np.zeros(3)
    after = followed(before, train, corrections)
    return moves.in_common(after.camtoworlds[train], before.camtoworlds[train])


def moved_views(train, corrections):
    """The views among `train` whose cameras move."""
    return [v for v, c in zip(train, corrections, strict=True) if not c.left_alone]


def zoom_of(corrections):
    """The log_focal that all corrections share."""
    return max((c.motion.log_focal for c in corrections), key=abs)


def median_px(corrections):
    """Median length of the corrections that are made; 0 where there is none."""
    lengths_px = [c.length_px for c in corrections if not c.left_alone]
    return float(np.median(lengths_px)) if lengths_px else 0.0
