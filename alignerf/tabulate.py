"""The tables of a scene: `python -m alignerf.tabulate`.

One process for all of them, since each takes longer to start than to make its table.
Each is written as CSV and LaTeX, its provenance beside it.
"""

from pathlib import Path

from alignerf.io import faults
from alignerf.tables import controls, displacement, frame, misalignment, ranking

# {table: the functions that make it, and its LaTeX}.
TABLES = {
    "misalignment": (misalignment.make_table, misalignment.to_latex),
    "controls": (controls.make_table, controls.to_latex),
    "displacement": (displacement.make_table, displacement.to_latex),
    "ranking": (ranking.make_table, ranking.to_latex),
}


OPTIONS = {
    "scene": ("its results' folder", Path),
    "tables": ("which", {"choices": TABLES} | faults.SEVERAL),
    "[published]": ("CSV, as printed", {"nargs": "*", "default": []}),
    "[called]": "what papers call the scene",
    "[configs]": ("YAML: the scene's complete config", {"nargs": "*", "default": []}),
    "out": ("folder, written into", Path),
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    views = frame.read(args.scene)
    printed = [
        line
        for path in args.published
        for line in misalignment.published(path, args.called)
    ]
    made = {}
    for name in args.tables:
        more = [printed] if name == "misalignment" else []
        made[name] = TABLES[name][0](views, *more)
    for name, table in made.items():
        frame.write(
            table,
            TABLES[name][1],
            csv=args.out / f"{name}.csv",
            tex=args.out / f"{name}.tex",
            scenes=[args.scene],
            configs=args.configs,
        )


if __name__ == "__main__":
    faults.run(main)
