"""What the commands that make a table share: arguments, costs read, files written."""

import argparse
import contextlib
from pathlib import Path

from alignerf.files import atomic, csv_files, json_files, provenance

# What tells a table's rows apart, in provenance.
LABELS = ("scene", "variant", "method", "round")


def parser(description):
    """Of the arguments --rows, --configs, --csv and --tex."""
    found = argparse.ArgumentParser(description=description)
    found.add_argument("--rows", required=True, help="JSON: what stands in each row")
    found.add_argument(
        "--configs", nargs="*", default=[], help="YAML: the scenes' complete configs"
    )
    found.add_argument(
        "--csv", required=True, help="table, written; its provenance beside it"
    )
    found.add_argument("--tex", required=True, help="table, written")
    return found


def places(args):
    """Of the arguments of `parser`, those of `write`."""
    return {"csv": args.csv, "tex": args.tex, "configs": args.configs}


def write(table, to_latex, *, csv, tex, rows, configs, seeds=(), float_format="%.6g"):
    """Write a table as CSV and as to_latex has it, and its provenance; all or none.

    rows: what it was made of. configs: the scenes' complete configs. seeds: those
    besides the ones of the configs.
    """
    latex = to_latex(table)
    found = provenance.describe(trainings_of(rows), configs, seeds=seeds)
    beside = provenance.path_beside(csv)
    with contextlib.ExitStack() as stack:
        csv, tex, origin = (
            stack.enter_context(atomic.replace_file(path))
            for path in (csv, tex, beside)
        )
        table.to_csv(csv, index=False, float_format=float_format)
        tex.write_text(latex)
        origin.write_text(provenance.as_json(found))


def trainings_of(rows):
    """Labels and trainings (none, one or several timing files) of each row."""
    found = []
    for row in rows:
        for one in getattr(row, "methods", [row]):
            fields = row._asdict() | one._asdict()
            labels = {key: fields[key] for key in LABELS if key in fields}
            paths = [fields["training"]] if "training" in fields else []
            found.append(labels | {"trainings": fields.get("trainings", paths)})
    return found


def read_timing(path, *keys):
    """These entries of a timing file as a dict; ValueError names one without them."""
    # All are numbers, but for the device's name.
    kinds = {key: str if key == "device" else json_files.NUMBER for key in keys}
    found = json_files.read(path, kinds)
    return {key: found[key] for key in keys}


def costs_of(row):
    """What a row took, from the photos on, and how large its model is.

    row: with `trainings` and `data`, the files that tell how long each training, and
    each rendering and warping between trainings, took.
    """
    costs = training_costs(row.trainings)
    costs["data_time_s"] = sum(data_time_s(path) for path in row.data)
    costs["total_time_s"] = costs["train_time_s"] + costs["data_time_s"]
    return costs


def data_time_s(path):
    """Seconds in a timing file, or in all views of a CSV of displacements.

    Of renders, those of the views: loading and compiling count no more than a
    training's do.
    """
    if path.endswith(".csv"):
        return views_time_s(path)
    if Path(path).parent.name == "render":
        timing = read_timing(path, "views", "view_time_s")
        return timing["views"] * timing["view_time_s"]
    return read_timing(path, "time_s")["time_s"]


def training_costs(paths):
    """Seconds, steps and rays of all stages of a training, parameters of the last."""
    summed = ("train_time_s", "steps", "rays_seen")
    if not paths:
        raise ValueError("--rows: a row without trainings")
    stages = [read_timing(path, *summed, "params") for path in paths]
    costs = {key: sum(timing[key] for timing in stages) for key in summed}
    return costs | {"params": stages[-1]["params"]}


def views_time_s(path):
    """Seconds of all views of a CSV of displacements; NaN where one view has none."""
    return float(csv_files.read(path, columns=["time_s"])["time_s"].sum(skipna=False))
