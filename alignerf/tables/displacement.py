"""How misaligned renders are: `tables/displacement.csv`.

A row per method and round: means over the test views of the flow from render to photo
and of its parts, as `flow.decompose` measured them.
"""

import pandas as pd

from alignerf.tables import columns, frame, latex


def make_table(views):
    """A line per row of a `frame.read`; a column that some view lacks stays empty.

    Views without a valid flow are left out.
    """
    views = views.dropna(subset=columns.PARTS, how="all")
    lines = frame.summary(views, frame.ROW, ["standard"], metrics=columns.PARTS)
    return pd.DataFrame(lines, columns=columns.names("displacement"))


def to_latex(table):
    """Lengths of the parts in px; a part that no row has is left out, as a model's."""
    return latex.of_table("displacement", table.dropna(axis=1, how="all"))
