"""The paper's Table 1: `tables/misalignment.csv`.

Costs are those of the whole way to a model: all rounds up to its own, and, for staged
training, both stages. Differences are to round 0 of the row's baseline, paired by test
view. What papers print for a scene of this name stands below, and is compared with
nothing.
"""

import itertools

import pandas as pd

from alignerf import testsets
from alignerf.tables import columns, frame, latex, published
from alignerf.tables.columns import METRICS, PRINTED_ONLY

TEST_SETS = testsets.shown_in("misalignment")
COUNTS = ("params", "steps", "rays_seen")


def make_table(views, printed=()):
    """A line per row of a `frame.read` and test set; then `printed`."""
    lines = frame.summary(views, frame.ROW, TEST_SETS)
    table = pd.DataFrame([*lines, *printed], columns=columns.names("misalignment"))
    # Whole numbers stay whole beside rows that lack them.
    return table.astype(dict.fromkeys(COUNTS, "Int64"))


def printed(args):
    """Lines of papers that are of a scene of the name in the arguments.

    `size` is that of the photos.
    """
    every = (published.lines(path, "scene", args.called) for path in args.published)
    for line in itertools.chain(*every):
        where = (
            f" in Table {line['table']} at {line['size']}" if "table" in line else ""
        )
        yield line | {"method": line["method"] + where}


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
