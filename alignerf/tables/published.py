"""What papers print, as tables show it below ours: CSVs of results/published."""

import numpy as np

from alignerf.io import csv_files
from alignerf.tables import columns, scores

METRICS = ("psnr_db", "ssim", columns.PRINTED_ONLY)
# Where a table says neither: photos as taken are learnt from, and scored, at length 1.
DEFAULTS = {"warping": scores.warping(0), "test_set": "standard"}
DEFAULTS |= {"group": scores.length(1), "hours": np.nan, "params_m": np.nan}


def lines(path, key, value):
    """Lines with this value; `hours` are of the whole way, `params_m` millions.

    Raises ValueError for a method that stands twice on a test set.
    """
    table = csv_files.read(path, columns=("source", "method", "scene", *METRICS))
    table = table.assign(**{k: v for k, v in DEFAULTS.items() if k not in table})
    table = table[table[key] == value].fillna({"group": DEFAULTS["group"]})
    if table.duplicated(["method", "warping", "test_set", "group"]).any():
        raise ValueError(f"{path}: {key} {value}: a method stands twice")
    return table.assign(
        published=table["method"],
        method=table["method"] + ", published",
        total_time_s=3600 * table["hours"],
        params=(1e6 * table["params_m"]).round(),
    ).to_dict("records")
