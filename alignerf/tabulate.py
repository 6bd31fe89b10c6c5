"""The tables of a scene: `python -m alignerf.tabulate`.

One process for all of them, since each takes longer to start than to make its table.
Each is written as CSV and LaTeX, its provenance beside it.
"""

import argparse
import types
from pathlib import Path
from typing import NamedTuple

from alignerf.experiment.tables import rows as table_rows
from alignerf.files import faults
from alignerf.tables import controls, displacement, misalignment, ranking, round_times
from alignerf.tables import files as table_files


class Table(NamedTuple):
    """What a table's rows are, and the module that makes it."""

    rows: type
    module: types.ModuleType
    float_format: str = "%.6g"


TABLES = {
    "misalignment": Table(table_rows.Misalignment, misalignment),
    "round_times": Table(table_rows.Times, round_times, "%.3f"),
    "controls": Table(table_rows.Scores, controls),
    "displacement": Table(table_rows.Displacement, displacement),
    "ranking": Table(table_rows.Scores, ranking),
}


def main(argv=None):
    args = parse(argv)
    rows = {name: table_rows.read(TABLES[name].rows, text) for name, text in args.rows}
    made = {}
    for name, found in rows.items():
        printed = {"printed": printed_of(args)} if name == "misalignment" else {}
        made[name] = TABLES[name].module.make_table(found, **printed)
    for name, table in made.items():
        table_files.write(
            table,
            TABLES[name].module.to_latex,
            csv=args.out / f"{name}.csv",
            tex=args.out / f"{name}.tex",
            rows=rows[name],
            configs=args.configs,
            float_format=TABLES[name].float_format,
        )


def printed_of(args):
    """What papers print for a scene of this name."""
    return [
        line
        for path in args.published
        for line in misalignment.published(path, args.scene_name)
    ]


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.tabulate", description=__doc__)
    parser.add_argument(
        "--rows",
        nargs=2,
        action="append",
        required=True,
        metavar=("TABLE", "JSON"),
        help="a table's name, and what stands in each row",
    )
    parser.add_argument("--scene-name", help="which rows of --published are shown")
    parser.add_argument("--published", nargs="*", default=[], help="CSV, as printed")
    parser.add_argument(
        "--configs", nargs="*", default=[], help="YAML: the scene's complete config"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder, written into")
    args = parser.parse_args(argv)
    if unknown := [name for name, _ in args.rows if name not in TABLES]:
        parser.error(f"--rows: no table {unknown[0]!r}")
    return args


if __name__ == "__main__":
    faults.run(main)
