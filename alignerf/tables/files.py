"""What the commands that make a table share: arguments, scenes read, files written."""

import argparse
import contextlib
from pathlib import Path
from typing import NamedTuple

from alignerf.experiment.tables import json_rows
from alignerf.experiment.tables.scenes import Scene
from alignerf.files import atomic, provenance
from alignerf.tables import results

# What tells a table's rows apart, in provenance.
LABELS = ("scene", "method", "round")


class Scored(NamedTuple):
    """A scene, the folder of its results, and the rows of a table in it."""

    scene: Scene
    folder: Path
    rows: list

    @property
    def names(self):
        """(method, round) of its rows."""
        return [(row.method, row.round) for row in self.rows]

    def row(self, name):
        """The row of a (method, round)."""
        return self.rows[self.names.index(name)]


def shared_rows(group):
    """(method, round) that all scenes have: with `rounds: auto` some have more."""
    shared = set.intersection(*(set(one.names) for one in group))
    return [name for name in group[0].names if name in shared]


def parser(description):
    """Of the arguments --configs, --csv and --tex."""
    arguments = argparse.ArgumentParser(description=description)
    arguments.add_argument(
        "--configs", nargs="*", default=[], help="YAML: the scenes' complete configs"
    )
    arguments.add_argument(
        "--csv", required=True, help="table, written; its provenance beside it"
    )
    arguments.add_argument("--tex", required=True, help="table, written")
    return arguments


def across(description):
    """The same, and --scenes and --results: of a table across scenes."""
    arguments = parser(description)
    arguments.add_argument("--scenes", required=True, help="JSON: what each is like")
    arguments.add_argument("--results", default="results", help="where they lie")
    return arguments


def read(args, table):
    """`Scored`s of the arguments of `across`: what each has of a table."""
    scenes = json_rows.read(Scene, args.scenes, "--scenes")
    folders = [Path(args.results) / scene.scene for scene in scenes]
    return [
        Scored(scene, folder, results.read(folder, table))
        for scene, folder in zip(scenes, folders, strict=True)
    ]


def places(args):
    """Of the arguments of `parser`, those of `write`."""
    return {"csv": args.csv, "tex": args.tex, "configs": args.configs}


def write(table, to_latex, *, csv, tex, rows, configs, seeds=(), float_format="%.6g"):
    """Write a table as CSV and as to_latex has it, and its provenance; all or none.

    rows: `results.Row`s that it was made of. configs: the scenes' complete configs.
    seeds: those besides the ones of the configs.
    """
    text = to_latex(table)
    of_rows = [
        {key: getattr(row, key) for key in LABELS} | {"trainings": row.trainings}
        for row in rows
    ]
    found = provenance.describe(of_rows, configs, seeds=seeds)
    beside = provenance.path_beside(csv)
    with contextlib.ExitStack() as stack:
        csv, tex, origin = (
            stack.enter_context(atomic.replace_file(path))
            for path in (csv, tex, beside)
        )
        table.to_csv(csv, index=False, float_format=float_format)
        tex.write_text(text)
        origin.write_text(provenance.as_json(found))


def write_across(table, to_latex, scenes, args):
    """The same of a table across scenes, by the arguments of `across`."""
    rows = [row for scene in scenes for row in scene.rows]
    write(table, to_latex, rows=rows, **places(args))
