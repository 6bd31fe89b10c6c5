"""What stands on the page: facts, decisions, tables, costs, downloads.

A *table* here is {name, note, columns, rows}: texts to show, and beside each what it is
sorted by.
"""

import math
import os
from datetime import UTC, datetime
from typing import NamedTuple

import pandas as pd

from alignerf.experiment import decisions as decided
from alignerf.io import csv_files, faults, json_files, provenance, yaml_files
from alignerf.judged import geometry
from alignerf.scenes import prepared
from alignerf.tables import columns, scores

# What of tables/ it shows; headings and formats are the columns' own.
TABLES = ("views", "misalignment")
# What a visitor may take home, with what it is; only what is there is shown.
DOWNLOADS = {
    "verdict.json": "the verdict, in numbers",
    "config.yaml": "the complete config",
    "poses.json": "how the poses came out",
    "facts.json": "what is known of the capture",
    "decisions.json": "what the facts call for",
    "cameras.npz": "cameras",
}
# Of each export, in the folder that has everything.
EXPORTED = {
    "README.txt": "how to use the export",
    "transforms.json": "export for nerfstudio",
}
# The figures that it repeats: title, and how to read it.
FIGURES = {
    "curves": (
        "Misalignment and quality, round by round",
        "PSNR tells whether a round helped. The flow to held-out photos hardly falls: "
        "rounds warp the training photos, not these, and a sharper render shows more "
        "of their misalignment.",
    ),
    "lengths": (
        "How long the flow is, and its parts",
        "The parts' lengths do not add up to those of the flow.",
    ),
}


# Ends of an interval.
ENDS = ("difference_low_db", "difference_high_db")
# What it takes from a poses.json.
POSES = prepared.POSES | dict.fromkeys(
    ("test_views", "height", "photo_height"), json_files.NUMBER
)
WAY = {"way": json_files.OrNone(str), "held_out": json_files.OrNone(str)}
POSES |= {"external_renders": json_files.OrNone(WAY)}
SAID = {"said": str}


class Cell(NamedTuple):
    """A cell of a table: its text, and the key that it is sorted by."""

    text: str
    order: str | float


def tables(folder, photo_px=1.0):
    """The tables of a scene as the template shows them; missing ones are left out.

    photo_px: px of the photo in one of the training's: all lengths are in the first.
    """
    sections = []
    for name in TABLES:
        path = folder / "tables" / f"{name}.csv"
        if path.is_file():
            told, table = columns.TABLES[name], csv_files.read(path)
            if lacking := ends_lacking(table, told.columns):
                raise ValueError(f"{path}: no column {lacking}")
            lengths = [k for k in told.columns if k.endswith("_px") and k in table]
            table[lengths] = photo_px * table[lengths]
            note = told.note.replace("the training size", "the photo")
            section = {"name": name, "heading": told.title, "note": note}
            sections.append(section | table_of(table, told.columns))
    return sections


def ends_lacking(data, told):
    """The first end of an interval that a table with intervals has no column of."""
    if not any(told[key].form == "interval" for key in data if key in told):
        return None
    return next((key for key in ENDS if key not in data), None)


def table_of(data: pd.DataFrame, told):
    """{columns, rows} of those columns that have a heading and hold anything."""
    kept = {
        key: column
        for key, column in told.items()
        if column.heading and key in data and not data[key].isna().all()
    }
    rows = [
        [cell(row, key, column.form) for key, column in kept.items()]
        for row in data.to_dict("records")
    ]
    headings = [
        {"text": column.heading, "is_text": not column.form} for column in kept.values()
    ]
    return {"columns": headings, "rows": rows}


def cell(row, key, form):
    """A table's Cell of a row; numbers by their format, `--` for none."""
    value = row[key]
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return Cell("--", -math.inf) if form else Cell("", "")
    if not form:
        return Cell(str(value), str(value))
    if form == "interval":
        ends = tuple(row[key] for key in ENDS)
        if value == 0 and ends == (0, 0):
            # To itself.
            return Cell("", -math.inf)
        return Cell(scores.with_interval(value, *ends, sign="+"), value)
    if form == "%":
        return Cell(f"{100 * value:.0f}", value)
    if form == "min":
        return Cell(f"{value / 60:.1f}", value)
    return Cell(format(value, form), value)


def origin(folder):
    """(name, text) of what made the page: version, when, and the command as typed."""
    poses, export = prepared.read_poses(folder, POSES), provenance.export_command()
    made = datetime.fromtimestamp((folder / "verdict.json").stat().st_mtime, UTC)
    command = os.environ.get(provenance.COMMAND)
    if not command and export.startswith("snakemake"):
        command = export.replace(" export", "", 1)
    elif not command and poses.get("source") == "courtyard":
        command = provenance.typed("make run", "why-blurry demo")
    entries = {
        "why-blurry": provenance.VERSION,
        "on": f"{made:%Y-%m-%d %H:%M} UTC",
        "scene": faults.resolved(folder).name,
        "command": command,
    }
    return [(name, text) for name, text in entries.items() if text]


def quarter_turns(folder):
    """{view: quarter turns, clockwise, that make it stand upright}: of poses.json."""
    return prepared.read_poses(folder, prepared.MORE).get("quarter_turns") or {}


def costs(folder):
    """The line of the run's estimated cost; none without a preflight."""
    path = folder / "preflight.json"
    if not path.is_file():
        return []
    return [
        f"Expected before the first training: {json_files.read(path, SAID)['said']}."
    ]


def downloads(folder):
    """(path relative to the page, description) of the files to download."""
    links = [(name, what) for name, what in DOWNLOADS.items()]
    for path in sorted((folder / "tables").glob("*")):
        if path.suffix in (".csv", ".tex"):
            form = "CSV" if path.suffix == ".csv" else "LaTeX"
            links.append((f"tables/{path.name}", f"table, {form}"))
    links += [
        (f"figures/{path.name}", "figure")
        for path in sorted((folder / "figures").glob("*.png"))
    ]
    links += [
        (path.relative_to(folder).as_posix(), what)
        for name, what in EXPORTED.items()
        for path in sorted(folder.glob(f"*/export/*/{name}"))
    ]
    return [(name, what) for name, what in links if (folder / name).is_file()]


def facts(folder):
    """(name, text) of the scene's main facts: photos, size, poses."""
    poses = prepared.read_poses(folder, POSES)
    if judged := poses.get("external_renders"):
        return facts_of_judged(poses, judged)
    entries = [
        ("photos", f"{poses['registered']} of {poses['total']} registered"),
        ("held out", f"{poses['test_views']}"),
        ("trained at", f"{poses['width']}x{poses['height']} px"),
        ("photo size", f"{poses['photo_width']}x{poses['photo_height']} px"),
    ]
    if isinstance(said := poses.get("of_poses"), str):
        entries.append(("poses", said.removeprefix("poses ")))
    error = poses["mean_reprojection_error_px"]
    if error is not None:
        entries.append(("reprojection error", f"{error:.2f} px of the photo"))
    if isinstance(said := prepared.part_of(poses, "again").get("said"), str):
        entries.append(("adjusted again", said))
    return entries


def facts_of_judged(poses, judged):
    """The same of renders that are judged: how they were put together."""
    taken = geometry.WAYS.get(judged.get("way"), "unknown")
    return [
        ("renders", f"of {poses['registered']} of {poses['total']} photos"),
        ("held out", f"{poses['test_views']}, {judged.get('held_out') or 'unknown'}"),
        ("compared at", f"{poses['width']}x{poses['height']} px"),
        ("photo size", f"{poses['photo_width']}x{poses['photo_height']} px"),
        ("folder", str(judged.get("layout"))),
        ("camera model", taken),
        ("cameras", str(judged.get("cameras"))),
    ]


def decisions(folder):
    """(rows of key, default, value, reason, in force; whether any is in force).

    None where nothing was trained.
    """
    if not (folder / "decisions.json").is_file():
        return [], False
    open_keys = left_open(folder / "config.yaml")
    if prepared.read_poses(folder, prepared.MORE).get("downscale_decided"):
        open_keys.add("downscale")
    rows = [
        decision._asdict() | {"taken": key.rpartition(".")[2] in open_keys}
        for key, decision in decided.read(folder / "decisions.json").items()
    ]
    return rows, any(row["taken"] for row in rows)


def left_open(path):
    """Keys that a complete config leaves to facts; ValueError where it is none."""
    config = yaml_files.read(path)
    try:
        parts = [model | model.get("field", {}) for model in config["models"].values()]
        training = config["training"]
        parts += [] if training["budget_min"] else [{"steps": training["steps"]}]
        return {key for one in parts for key in decided.OPEN if one.get(key, 0) is None}
    except (AttributeError, KeyError, TypeError):
        fault = "not a complete config: models, training"
        raise ValueError(f"{path}: {fault}") from None
