"""How far the alignment-aware loss has to search, from the measured misalignment.

Lengths are those of the flow from render to photo; `flow.align` writes their 95th
percentile for each view.
"""

import logging
import math

import numpy as np

from alignerf.io import csv_files

log = logging.getLogger("alignerf")

# The photo around a patch of 32 px is then 64 px wide: four times the patch's area,
# and (2 r + 1)^2 = 1089 offsets to compare.
MAX_PX = 16
COLUMN = "p95_px"


def radius_from(lengths_px) -> int:
    """The search radius in px, 1 to 16, from each view's 95th percentile in px.

    Rounded up from the least length that 95 % of the views do not exceed (with fewer
    than 20 views their largest): 19 of 20 pixels are within reach in 19 of 20 views,
    and the few views whose flow failed do not decide. At least 1, because an offset
    of 0 alone is no search. At most 16, and a warning says so: what lies further off
    is out of the loss's reach. Raises ValueError for no length and for one that is
    negative or not finite.
    """
    lengths_px = check(lengths_px)
    reach_px = np.percentile(lengths_px, 95, method="inverted_cdf")
    if reach_px > MAX_PX:
        log.warning(
            "search radius: %d px is the most, %.1f px were measured",
            *(MAX_PX, reach_px),
        )
    return min(max(math.ceil(reach_px), 1), MAX_PX)


def check(lengths_px) -> np.ndarray:
    """The lengths [n] in float64, all of them finite and none negative."""
    lengths_px = np.asarray(lengths_px, np.float64)
    if lengths_px.size == 0:
        raise ValueError("no view has a measured misalignment")
    if not (np.isfinite(lengths_px) & (lengths_px >= 0)).all():
        raise ValueError("a misalignment is negative or not finite")
    return lengths_px


def read_lengths_px(path) -> np.ndarray:
    """Each view's 95th percentile [n] in px from a CSV that `flow.align` wrote.

    Raises ValueError, naming the file, where it has no such column, no view, or in
    some view no length.
    """
    lengths_px = csv_files.read(path, columns=[COLUMN])[COLUMN]
    try:
        return check(lengths_px)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
