"""The paper's Table 1: `tables/misalignment.csv`.

Costs are those of the whole way to a model: all rounds up to its own, and, for staged
training, both stages. Differences are to round 0 of the row's baseline, paired by test
view. What papers print for a scene of this name stands below, and is compared with
nothing.
"""

import pandas as pd

from alignerf import testsets
from alignerf.io import csv_files
from alignerf.tables import columns, frame, latex, scores
from alignerf.tables.columns import METRICS, PRINTED_ONLY

TEST_SETS = testsets.shown_in("misalignment")
PRINTED = ("psnr_db", "ssim", PRINTED_ONLY)
COUNTS = ("params", "steps", "rays_seen")


def make_table(views, printed=()):
    """A line per row of a `frame.read` and test set; then `printed`."""
    lines = frame.summary(views, frame.ROW, TEST_SETS)
    table = pd.DataFrame([*lines, *printed], columns=columns.names("misalignment"))
    # Whole numbers stay whole beside rows that lack them.
    return table.astype(dict.fromkeys(COUNTS, "Int64"))


def printed(args):
    """Lines of all published tables that the arguments name."""
    return [one for path in args.published for one in published(path, args.called)]


def published(path, scene):
    """Lines of a table of results/published that are of a scene of this name.

    Where it says neither, photos as taken are learnt from, and scored. `hours` are of
    the whole way, `params_m` millions, `size` that of the photos.
    """
    needed = ("source", "method", "scene", *PRINTED)
    table = csv_files.read(path, columns=needed)
    places = {"warping": scores.warping(0), "test_set": "standard"}
    table = table.assign(**{k: v for k, v in places.items() if k not in table})
    table = table[table["scene"] == scene]
    if table.duplicated(["method", *places]).any():
        raise ValueError(f"{path}: scene {scene}: a method stands twice")
    for row in table.to_dict("records"):
        where = f" in Table {row['table']} at {row['size']}" if "table" in row else ""
        labels = {"method": f"{row['method']}, published{where}"}
        labels |= {key: row[key] for key in ("source", *places, *PRINTED)}
        if "hours" in row:
            labels["total_time_s"] = 3600 * row["hours"]
            labels["params"] = round(1e6 * row["params_m"])
        yield labels


def to_latex(table):
    """A row per method and warping, test sets side by side."""
    printed = table["source"].notna()
    return latex.of_table(
        "misalignment",
        table,
        [*metrics(table), ("difference_db", "PSNR gained (dB)", "interval")],
        by="test_set",
        values=[name for name in TEST_SETS if name in set(table["test_set"])],
        notes=notes(table[printed], table),
        best=METRICS,
        others=printed,
    )


def metrics(table):
    """Of the metrics, those that some row has, as `latex.of_table` takes them."""
    return [
        latex.metric(key)
        for key in (*METRICS, PRINTED_ONLY)
        if table[key].notna().any()
    ]


def notes(printed, table):
    """Which metrics are left out, and whose the published rows are."""
    pairs = zip(printed["method"], printed["source"], strict=True)
    return [
        *(
            f"No {key} column: some view or all lack it, see `note` in metrics.csv."
            for key in METRICS
            if table[key].isna().all()
        ),
        *(f"{name}: as printed, {paper}." for name, paper in dict.fromkeys(pairs)),
    ]
