"""What stands on the page: verdict, tables, decisions, costs, downloads.

A *table* here is {name, note, columns, rows}: texts to show, and beside each what it is
sorted by.
"""

import math
from typing import NamedTuple

import pandas as pd

from alignerf.decisions import fill
from alignerf.files import csv_files, json_files, yaml_files
from alignerf.scenes import prepared
from alignerf.tables import scores

# File in tables/ -> (heading, note, {column: (heading, format)}).
TABLES = {
    "views": (
        "Every photo",
        "Against the render of its view, before any warping. Lengths are medians in "
        "pixels of the training size; EV are stops of exposure.",
        {
            "view": ("view", None),
            "split": ("split", None),
            "flow_px": ("flow, px", ".2f"),
            "camera_px": ("of it camera, px", ".2f"),
            "remainder_px": ("the rest, px", ".2f"),
            "moved_share": ("moved, %", "%"),
            "psnr_db": ("PSNR, dB", ".2f"),
            "detail_ratio": ("detail / render's", ".2f"),
            "exposure_ev": ("brighter by, EV", "+.2f"),
            "stands_out": ("why it stands out", None),
        },
    ),
    "misalignment": (
        "Image quality by method and warping",
        "Means over held-out views. Differences are to the same model without "
        "warping, with 95 % intervals over the views.",
        {
            "method": ("method", None),
            "warping": ("warped", None),
            "test_set": ("test set", None),
            "psnr_db": ("PSNR, dB", ".2f"),
            "ssim": ("SSIM", ".3f"),
            "lpips_alex": ("LPIPS (alex)", ".3f"),
            "lpips_squeeze": ("LPIPS (squeeze)", ".3f"),
            "lpips_vgg": ("LPIPS (VGG)", ".3f"),
            "lpips_published": ("LPIPS (published)", ".3f"),
            "difference_db": ("difference, dB", "interval"),
            "total_time_s": ("minutes in all", "min"),
            "params": ("parameters", ",.0f"),
            "source": ("published in", None),
        },
    ),
    "displacement": (
        "How misaligned, and by what",
        "Flow from render to photo over held-out views: means of the views' medians, "
        "in pixels of the training size.",
        {
            "method": ("method", None),
            "round": ("round", ".0f"),
            "flow_median_px": ("flow, px", ".2f"),
            "flow_p95_px": ("95th percentile, px", ".2f"),
            "model_median_px": ("model's part, px", ".2f"),
            "camera_median_px": ("camera's part, px", ".2f"),
            "remainder_median_px": ("the rest, px", ".2f"),
            "moved_share": ("moved, %", "%"),
            "valid_share": ("valid, %", "%"),
        },
    ),
    "round_times": (
        "Where the time went",
        "Seconds of each round. Flow and renders are those of the training views.",
        {
            "method": ("method", None),
            "round": ("round", ".0f"),
            "train_time_s": ("training, s", ".0f"),
            "train_compile_time_s": ("compilation, s", ".0f"),
            "render_time_s": ("renders, s", ".0f"),
            "align_time_s": ("flow, s", ".0f"),
            "total_time_s": ("in all, s", ".0f"),
        },
    ),
}
# What a visitor may take home, with what it is; only what is there is shown.
DOWNLOADS = {
    "verdict.json": "the verdict, in numbers",
    "config.yaml": "the complete config",
    "poses.json": "how the poses came out",
    "facts.json": "what is known of the capture",
    "decisions.json": "what the facts call for",
    "cameras.npz": "cameras",
}
FIGURES = {
    "curves": "Misalignment and quality, round by round",
    "lengths": "How long the flow is, and its parts",
}


# What it takes from a verdict.json, a poses.json and a preflight.json.
VERDICT = {"verdict": list, "state": str, "evidence": dict}
POSES = prepared.POSES | dict.fromkeys(
    ("test_views", "height", "photo_height"), json_files.NUMBER
)
PLAN = dict.fromkeys(
    ("wall_s", "cores", "memory_bytes", "disk_bytes"), json_files.NUMBER
)


class Cell(NamedTuple):
    """A cell of a table: its text, and the key that it is sorted by."""

    text: str
    order: str | float


def verdict(folder):
    """The verdict as the template shows it, from verdict.json."""
    content = json_files.read(folder / "verdict.json", VERDICT)
    for line in content["verdict"] or [None]:
        if not isinstance(line, str):
            raise ValueError(f"{folder / 'verdict.json'}: verdict is not lines of text")
    head, *lines = content["verdict"]
    todo = [line.removeprefix("To do: ") for line in lines if line.startswith("To do:")]
    return {
        "head": head.removeprefix("Verdict: "),
        "state": content["state"],
        "lines": [line for line in lines if not line.startswith("To do:")],
        "todo": todo,
        "evidence": content["evidence"],
    }


def tables(folder):
    """The tables of a scene as the template shows them; missing ones are left out."""
    sections = []
    for name, (heading, note, columns) in TABLES.items():
        path = folder / "tables" / f"{name}.csv"
        if path.is_file():
            data = csv_files.read(path)
            sections.append(
                {"name": name, "heading": heading, "note": note}
                | table_of(data, columns)
            )
    return sections


def table_of(data: pd.DataFrame, columns):
    """{columns, rows} of those columns that hold anything."""
    kept = {
        key: heading
        for key, (heading, _) in columns.items()
        if key in data and not data[key].isna().all()
    }
    rows = [
        [cell(row, key, columns[key][1]) for key in kept]
        for row in data.to_dict("records")
    ]
    texts = [columns[key][1] is None for key in kept]
    headings = [
        {"text": heading, "is_text": is_text}
        for heading, is_text in zip(kept.values(), texts, strict=True)
    ]
    return {"columns": headings, "rows": rows}


def cell(row, key, form):
    """A table's Cell of a row; numbers by their format, `--` for none."""
    value = row[key]
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return Cell("" if form is None else "--", "" if form is None else -math.inf)
    if form is None:
        return Cell(str(value), str(value))
    if form == "interval":
        ends = (row["difference_low_db"], row["difference_high_db"])
        if value == 0 and ends == (0, 0):
            # To itself.
            return Cell("", -math.inf)
        return Cell(scores.with_interval(value, *ends, sign="+"), value)
    if form == "%":
        return Cell(f"{100 * value:.0f}", value)
    if form == "min":
        return Cell(f"{value / 60:.1f}", value)
    return Cell(format(value, form), value)


def decisions(folder):
    """(rows of key, default, value, reason, in force; whether any is in force)."""
    config = yaml_files.read(folder / "config.yaml")
    open_keys = {
        key for model in config["models"].values() for key in model.get("decided", [])
    }
    open_keys |= set(config["training"]["decided"])
    if json_files.read(folder / "poses.json").get("downscale_decided"):
        open_keys.add("downscale")
    rows = [
        decision._asdict() | {"taken": key.rpartition(".")[2] in open_keys}
        for key, decision in fill.read(folder / "decisions.json").items()
    ]
    return rows, any(row["taken"] for row in rows)


def costs(folder):
    """Sentences on the estimated cost of the run; none without a preflight."""
    path = folder / "preflight.json"
    if not path.is_file() or not (plan := json_files.read(path)):
        return []
    plan = json_files.read(path, PLAN)
    hours = plan["wall_s"] / 3600
    took = f"{60 * hours:.0f} minutes" if hours < 1 else f"{hours:.1f} hours"
    return [
        f"Expected before the first training: {took} on {plan['cores']} cores, "
        f"{plan['memory_bytes'] / 1e9:.1f} GB of memory, "
        f"{plan['disk_bytes'] / 1e9:.2f} GB of disk."
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
        (path.relative_to(folder).as_posix(), "export for nerfstudio")
        for path in sorted(folder.glob("*/export/*/transforms.json"))
    ]
    return [(name, what) for name, what in links if (folder / name).is_file()]


def facts(folder):
    """(name, text) of the scene's main facts: photos, size, poses."""
    poses = json_files.read(folder / "poses.json", POSES)
    entries = [
        ("photos", f"{poses['registered']} of {poses['total']} placed"),
        ("held out", f"{poses['test_views']}"),
        ("trained at", f"{poses['width']}x{poses['height']} px"),
        ("photos have", f"{poses['photo_width']}x{poses['photo_height']} px"),
    ]
    error = poses.get("mean_reprojection_error_px")
    if error is not None:
        entries.append(("reprojection error", f"{error:.2f} px of the photo"))
    return entries
