"""The two photos whose matches the input cameras fit worst, before and after."""

from pathlib import Path

import numpy as np

from alignerf.page import gallery
from alignerf.scenes import prepared
from alignerf.sfm import calibration, matches
from alignerf.verdict import gains

# Pairs with fewer matches say little; so many of one are drawn.
MIN_MATCHES, MOST = 30, 60
# In px of the photo: up to here a match fits, see `gallery.level`.
FITS_PX = 1.0
# Width of a photo in the drawing, and what lies between two.
WIDTH, GAP = 100.0, 2.0


def told(folder, turns, moved, shown):
    """{names, photos, sizes, drawn: [{name, px, lines}]} of a pair; None of none.

    turns: {view: quarter turns that make it upright}. moved: a cameras.npz, corrected,
    or None. shown: keys of photos on the page, among which the pair is. sizes: (width,
    height) in the drawing. px: median epipolar error in px of the photo; lines: (level,
    x, y, x, y) of matches from photo to photo.
    """
    path = Path(folder) / matches.FILE
    if not path.is_file():
        return None
    found, own = matches.load(path), prepared.read_cameras(folder / "cameras.npz")
    keys = [f"{s}/{n}" for s, n in zip(own["split"], own["names"], strict=True)]
    found = found.between(np.array([key in shown for key in keys]))
    photo_px = gallery.scale(folder) * int(own["width"]) / found.width
    cameras = {"input cameras": own}
    if moved:
        cameras["corrected cameras"] = prepared.read_cameras(moved)
    errors = {}
    for name, arrays in cameras.items():
        _, px = calibration.errors_of_matches(found, gains.cameras_of(arrays, found))
        errors[name] = np.split(photo_px * px, np.cumsum([*map(len, found.indices)]))
    medians = [
        np.median(px) if len(px) >= MIN_MATCHES else -1.0
        for px in errors["input cameras"][:-1]
    ]
    if max(medians, default=-1.0) < 0:
        return None
    worst = int(np.argmax(medians))
    pair = found.pairs[worst]
    names = [found.names[view] for view in pair]
    ends, sizes = [], []
    for view, index in zip(pair, found.indices[worst].T, strict=True):
        xy, size = found.keypoints[view][index], np.array([found.width, found.height])
        for _ in range(turns.get(found.names[view], 0)):
            xy, size = np.stack([size[1] - xy[:, 1], xy[:, 0]], axis=1), size[::-1]
        ends.append(WIDTH * xy / size[0])
        sizes.append([WIDTH, round(WIDTH * float(size[1] / size[0]), 2)])
    ends[1] = ends[1] + [WIDTH + GAP, 0]
    lines = np.round(np.concatenate(ends, axis=1), 1)
    drawn = []
    for name, of_pairs in errors.items():
        px = of_pairs[worst]
        kept = range(0, len(px), -(-len(px) // MOST))
        own_lines = [(gallery.level(px[i], FITS_PX), *lines[i].tolist()) for i in kept]
        drawn.append({"name": name, "px": float(np.median(px)), "lines": own_lines})
    keys = [keys[view] for view in pair]
    return {"names": names, "photos": keys, "sizes": sizes, "drawn": drawn}
