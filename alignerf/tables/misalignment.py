"""The paper's Table 1: `tables/misalignment.csv`.

Costs are those of the whole way to a model: all rounds up to its own, and, for staged
training, both stages. Differences are to round 0 of the row's baseline, paired by test
view.
"""

import pandas as pd

from alignerf import testsets
from alignerf.tables import columns, frame, latex
from alignerf.tables.columns import METRICS, PRINTED_ONLY

TEST_SETS = testsets.shown_in("misalignment")
COUNTS = ("params", "steps", "rays_seen")


def make_table(views):
    """A line per row of a `frame.read` and test set."""
    lines = frame.summary(views, frame.ROW, TEST_SETS)
    table = pd.DataFrame(lines, columns=columns.names("misalignment"))
    # Whole numbers stay whole beside rows that lack them.
    return table.astype(dict.fromkeys(COUNTS, "Int64"))


def to_latex(table):
    """A row per method and warping, test sets side by side."""
    return latex.of_table(
        "misalignment",
        table,
        [*metrics(table), ("difference_db", "PSNR gained (dB)", "interval")],
        by="test_set",
        values=[name for name in TEST_SETS if name in set(table["test_set"])],
        notes=[
            f"No {key} column: some view or all lack it, see `note` in metrics.csv."
            for key in METRICS
            if table[key].isna().all()
        ],
        best=METRICS,
    )


def metrics(table):
    """Of the metrics, those that some row has, as `latex.of_table` takes them."""
    return [
        latex.metric(key)
        for key in (*METRICS, PRINTED_ONLY)
        if key in table and table[key].notna().any()
    ]
