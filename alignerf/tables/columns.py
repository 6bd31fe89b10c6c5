"""Every column of the tables: what it is, and its heading; from columns.yaml.

From here come the order of a CSV's columns and the headings on the page and in LaTeX.
"""

from pathlib import Path
from typing import NamedTuple

import yaml


class Column(NamedTuple):
    """A column of a CSV; see columns.yaml."""

    what: str = ""
    heading: str = ""
    form: str = ""


class Table(NamedTuple):
    """A table's columns by name, in the CSV's order, and what the page calls it.

    latex: `rows`, {column: heading} of what tells rows apart, `cells`, {column:
    [heading, form]}, and `notes` above.
    """

    columns: dict
    title: str = ""
    note: str = ""
    latex: dict | None = None


def read():
    """All tables, by name."""
    text = Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")
    tables = {}
    for name, entry in yaml.safe_load(text).items():
        columns = {key: Column(**one) for key, one in entry.pop("columns").items()}
        tables[name] = Table(columns, **entry)
    return tables


TABLES = read()
# Whether higher is better.
METRICS = {
    "psnr_db": True,
    "ssim": True,
    "lpips_alex": False,
    "lpips_vgg": False,
}
NETWORKS = [name for name in METRICS if name.startswith("lpips")]
# The network of the papers' LPIPS is not released: it compares with none of ours.
PRINTED_ONLY = "lpips_published"
# Of the flow from render to photo and of its parts, of `flow.decompose`.
PARTS = [
    name
    for name in TABLES["displacement"].columns
    if name.endswith(("_px", "_fraction"))
]


def names(table):
    """Names of a table's columns, in the CSV's order."""
    return list(TABLES[table].columns)
