"""What windows at the photos' own size tell: the shift there, in pixels of the photo.

Their folders are scenes of their own: `windows` of the config, `zoom.of` of a scene.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.files import csv_files, json_files
from alignerf.scenes import prepared
from alignerf.tables import intervals

OF_ZOOM = {"of": str, "px": int, "points": list}
TIMING = {"rays_seen": json_files.NUMBER}
DRAWS = 2000


class Windows(NamedTuple):
    """Windows with the cameras as given; lengths are in px of the photo.

    flow_px, camera_px, remainder_px: medians over the training photos of their windows'
    medians; low_px, high_px: the 95 % interval of the first. corrected_px: the same of
    windows with the cameras that a method has put right; NaN where there are none.
    """

    places: int
    px: int
    photos: int
    test_photos: int
    flow_px: float
    low_px: float
    high_px: float
    flow_test_px: float
    camera_px: float
    remainder_px: float
    passes: float
    corrected_px: float = math.nan


def read(given, corrected=None):
    """`Windows` of folders results/SCENE/METHOD/roundK; None where there are none.

    given: of the cameras as given; corrected: of cameras that were put right, or None.
    """
    if not given:
        return None
    found = of_folder(Path(given))
    if corrected:
        found = found._replace(corrected_px=of_folder(Path(corrected)).flow_px)
    return found


def of_folder(base):
    """The `Windows` of one training on windows."""
    scene = base.parents[1]
    zoom = json_files.read(scene / "poses.json", {"zoom": dict})["zoom"]
    for key, kind in OF_ZOOM.items():
        if not isinstance(zoom.get(key), kind):
            raise ValueError(f"{scene / 'poses.json'}: zoom.{key} is missing")
    loaded = prepared.load(scene)
    pixels = len(loaded.views("train")) * loaded.width * loaded.height
    rays = json_files.read(base / "timing.json", TIMING)["rays_seen"]
    flows, of_test = (of_photos(base, split, "flow") for split in ("train", "test"))
    low, high = interval_of_median(flows)
    return Windows(
        places=len(zoom["points"]),
        px=zoom["px"],
        photos=len(flows),
        test_photos=len(of_test),
        flow_px=median(flows),
        low_px=low,
        high_px=high,
        flow_test_px=median(of_test),
        camera_px=median(of_photos(base, "train", "camera")),
        remainder_px=median(of_photos(base, "train", "remainder")),
        passes=rays / pixels,
    )


def of_photos(base, split, what):
    """A length [n] of each photo of a split: the median over its windows.

    Photos without a valid flow are left out.
    """
    path = base / f"decomposition_photos_{split}.csv"
    column = f"{what}_median_px"
    table = csv_files.read(path, columns=["view", column])
    photo = table["view"].astype(str).str.rpartition("_w")[0]
    return table.groupby(photo)[column].median().dropna().to_numpy(np.float64)


def median(values):
    """NaN of nothing."""
    return float(np.median(values)) if len(values) else math.nan


def interval_of_median(values):
    """95 % interval (low, high) of the median of values [n] over photos drawn anew."""
    if len(values) < 2:
        return math.nan, math.nan
    drawn = values[intervals.resamples(len(values), draws=DRAWS)]
    return intervals.from_draws(np.median(drawn, axis=1), len(values))
