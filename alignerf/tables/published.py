"""What papers print, as tables show it below ours: CSVs of results/published."""

from alignerf.io import csv_files
from alignerf.tables import columns, scores

METRICS = ("psnr_db", "ssim", columns.PRINTED_ONLY)
KEYS = ("table", "method", "warping", "test_set", "group")


def lines(path, number):
    """Lines of a table; `hours` are of the whole way, `params_m` millions.

    Raises ValueError for a method that stands twice on a test set.
    """
    table = csv_files.read(path, columns=("source", *KEYS, *METRICS))
    table = table[table["table"] == number].fillna({"group": scores.length(1)})
    if table.duplicated([*KEYS]).any():
        raise ValueError(f"{path}: table {number}: a method stands twice")
    return table.assign(
        published=table["method"],
        method=table["method"] + ", published",
        total_time_s=3600 * table["hours"],
        params=(1e6 * table["params_m"]).round(),
    ).to_dict("records")
