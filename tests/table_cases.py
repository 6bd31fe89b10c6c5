"""Tables of a scene as its rule makes them."""

from alignerf import tabulate
from alignerf.experiment.tables import rows as table_rows


def make(name, rows, out, *more):
    """Write a table of these rows into the folder `out`; returns its CSV and LaTeX."""
    text = table_rows.as_json(rows)
    tabulate.main(["--rows", name, text, "--out", str(out), *more])
    return out / f"{name}.csv", out / f"{name}.tex"
