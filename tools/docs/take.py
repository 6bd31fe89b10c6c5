"""Take tables of the paper's targets into docs/: `tools.docs.take results table1 ...`.

Copies results/NAME.csv, its effects and its picture into docs/measured and
docs/pictures, each CSV below the five lines that say where it comes from. Then `make
docs` makes the pages' tables of them.
"""

import argparse
import datetime
import json
import shutil
from pathlib import Path

import pandas as pd

MACHINE = (
    "two hyperthreads of one core of a shared x86-64 machine, two trainings side by "
    "side, other work beside some, no accelerator"
)
ENDS = ("", "_effects", "_ranking")


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("results", type=Path)
    parser.add_argument("tables", nargs="+", help="table1, tradeoff, arm, ...")
    parser.add_argument("--root", default=".", type=Path, help="the project's folder")
    parser.add_argument("--machine", default=MACHINE)
    parser.add_argument("--commit", help="of the trainings, where theirs is no longer")
    args = parser.parse_args(argv)
    docs = args.root / "docs"
    for name in args.tables:
        origin = args.results / f"{name}.provenance.json"
        told = json.loads(origin.read_text())
        head = header(told, f"snakemake {name}", args.machine, args.commit)
        for end in ENDS:
            if (path := args.results / f"{name}{end}.csv").is_file():
                text = pd.read_csv(path).to_csv(index=False, float_format="%.4g")
                (docs / "measured" / path.name).write_text(head + text)
        if (picture := args.results / f"{name}.png").is_file():
            shutil.copy(picture, docs / "pictures" / picture.name)


def header(origin, command, machine, commit=None):
    """The first lines of a measured CSV; origin: a table's provenance.

    The commits are those of its trainings, which its numbers come from, or `commit`.
    """
    found = {key: [] for key in ("commit", "lock")}
    for key, values in found.items():
        values += dict.fromkeys(one[key] or origin[key] for one in origin["trainings"])
    lines = {key: ", ".join(values) for key, values in found.items()}
    lines["commit"] = commit or lines["commit"]
    lines |= {"machine": machine, "command": command}
    lines["measured"] = datetime.date.today()
    return "".join(f"# {key}: {value}\n" for key, value in lines.items())


if __name__ == "__main__":
    main()
