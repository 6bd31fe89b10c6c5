"""What the commands that make a table share: arguments, costs read, CSV and LaTeX."""

import argparse
import json
import pathlib

import pandas as pd

from alignerf.command import whole


def run(description, argv, make_table, to_latex, *, float_format="%.6g"):
    """A whole command: make_table(entries) of --rows, written by `write`."""
    args = parser(description).parse_args(argv)
    table = make_table(json.loads(args.rows))
    write(table, to_latex, args.csv, args.tex, float_format=float_format)


def parser(description):
    """Of the arguments --rows, --csv and --tex."""
    found = argparse.ArgumentParser(description=description)
    found.add_argument("--rows", required=True, help="JSON: what stands in each row")
    found.add_argument("--csv", required=True, help="table, written")
    found.add_argument("--tex", required=True, help="table, written")
    return found


def write(table, to_latex, csv, tex, *, float_format="%.6g"):
    """Write a table to the paths `csv` and, as to_latex has it, `tex`; or neither."""
    latex = to_latex(table)
    with whole.replace_file(csv) as csv_path, whole.replace_file(tex) as tex_path:
        table.to_csv(csv_path, index=False, float_format=float_format)
        tex_path.write_text(latex)


def read_timing(path, *keys):
    """These entries of a timing file as a dict; ValueError names one without them."""
    try:
        timing = json.loads(pathlib.Path(path).read_text())
        return {key: timing[key] for key in keys}
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: not the timing that it should be: {error}") from None


def costs_of(entry):
    """What a row took, from the photos on, and how large its model is.

    entry: `trainings` and `data`, the files that tell how long each training, and
    each rendering and warping between trainings, took.
    """
    costs = training_costs(entry["trainings"])
    costs["data_time_s"] = sum(data_time_s(path) for path in entry["data"])
    costs["total_time_s"] = costs["train_time_s"] + costs["data_time_s"]
    return costs


def data_time_s(path):
    """Seconds in a timing file, or in all views of a CSV of displacements."""
    if path.endswith(".csv"):
        return views_time_s(path)
    return read_timing(path, "time_s")["time_s"]


def training_costs(paths):
    """Seconds, steps and rays of all stages of a training, parameters of the last."""
    summed = ("train_time_s", "steps", "rays_seen")
    stages = [read_timing(path, *summed, "params") for path in paths]
    costs = {key: sum(timing[key] for timing in stages) for key in summed}
    return costs | {"params": stages[-1]["params"]}


def read_csv(path, *, columns=(), **options):
    """`pandas.read_csv` of a file with rows and `columns`; ValueError names another."""
    try:
        table = pd.read_csv(path, **options)
    except ValueError as error:
        raise ValueError(f"{path}: not a table: {error}") from None
    if table.empty:
        raise ValueError(f"{path}: no row")
    if missing := set(columns) - set(table):
        raise ValueError(f"{path}: no column {min(missing)}")
    return table


def views_time_s(path):
    """Seconds of all views of a CSV of displacements."""
    return float(read_csv(path, columns=["time_s"])["time_s"].sum())
