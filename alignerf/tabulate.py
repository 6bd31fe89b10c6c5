"""A table, of a scene or across scenes: `python -m alignerf.tabulate`.

Written as CSV and LaTeX, its provenance and what else belongs to it beside.
"""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from alignerf.experiment.tables import rows as table_rows
from alignerf.experiment.tables.scenes import Scene
from alignerf.io import atomic, faults, provenance
from alignerf.tables import (
    columns,
    controls,
    displacement,
    frame,
    latex,
    misalignment,
    ranking,
)
from alignerf.tables.across import arm, comparison, tradeoff


class Table(NamedTuple):
    """How a table is made.

    make: from a `frame.read_scenes`, and `printed` lines, to the table; latex: from
    that to LaTeX. of: the folder of its rows below a scene's; "" for the scene's own.
    printed: from the arguments to what papers print. beside: from the frame, the table
    and the arguments to {ending: table, or function that writes a path}.
    """

    make: Callable
    latex: Callable
    of: str = ""
    printed: Callable | None = None
    beside: Callable | None = None


TABLES = {
    "misalignment": Table(misalignment.make_table, misalignment.to_latex),
    "controls": Table(controls.make_table, controls.to_latex),
    "displacement": Table(displacement.make_table, displacement.to_latex),
    "ranking": Table(ranking.make_table, ranking.to_latex),
    "comparison": Table(
        *(comparison.make_table, comparison.to_latex, "comparison"),
        printed=comparison.printed,
        beside=comparison.beside,
    ),
    "tradeoff": Table(
        tradeoff.make_table, tradeoff.to_latex, "comparison", beside=tradeoff.beside
    ),
    "arm": Table(arm.make_table, arm.to_latex, "arm", beside=arm.beside),
}

OPTIONS = {
    "table": ("which", {"choices": TABLES}),
    "scenes": "JSON: what each is like",
    "[results]": ("where they lie", Path("results")),
    "[configs]": ("YAML: their complete ones", {"nargs": "*", "default": []}),
    "[published]": ("CSV, as printed", {"nargs": "*", "default": []}),
    "[published-table]": ("which of the paper's tables", int),
    "out": "the table without its ending, written",
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    table, scenes = TABLES[args.table], table_rows.read(Scene, args.scenes)
    views = frame.read_scenes(scenes, args.results, table.of)
    made = table.make(views, *([table.printed(args)] if table.printed else []))
    folders = [args.results / scene.scene for scene in scenes]
    trainings = [one for path in folders for one in frame.origins(path, table.of)]
    origin = provenance.as_json(provenance.describe(trainings, args.configs))
    text = latex.document(table.latex(made))
    files = {".csv": made, ".tex": text, ".provenance.json": origin}
    write(args.out, files | (table.beside(views, made, args) if table.beside else {}))


def write(out, files):
    """Write {ending: text, table, or function of a path}; all or none."""
    with contextlib.ExitStack() as stack:
        for end, content in files.items():
            path = stack.enter_context(atomic.replace_file(f"{out}{end}"))
            if isinstance(content, str):
                path.write_text(content)
            elif isinstance(content, pd.DataFrame):
                # Without the columns of networks that had no weights.
                empty = [name for name in content if content[name].isna().all()]
                known = content.drop(columns={*columns.NETWORKS} & {*empty})
                known.to_csv(path, index=False, float_format="%.6g")
            else:
                content(path)


if __name__ == "__main__":
    faults.run(main)
