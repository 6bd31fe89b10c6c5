"""What the benchmarks print and write: a table, JSON and CSV, with the hardware."""

import csv
import dataclasses
import datetime
import json
import os
import pathlib
import platform
import subprocess

import jax

from alignerf.io import atomic, owned

COLUMNS = ("median", "low", "high", "count")


def hardware():
    """Where the figures come from: processor, cores, memory, device, versions."""
    return {
        "date": datetime.date.today().isoformat(),
        "commit": commit(),
        "cpu": processor(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(
            os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**30, 1
        ),
        "device": jax.devices()[0].device_kind,
        "devices": jax.local_device_count(),
        "jax": jax.__version__,
        "python": platform.python_version(),
    }


def processor():
    """The model's name, as the kernel tells it."""
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def commit():
    """The checkout's commit, with `+` where the sources differ from it."""
    here = pathlib.Path(__file__).parent

    def git(*words):
        done = subprocess.run(["git", *words], cwd=here, capture_output=True, text=True)
        return done.stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no", "--", ":/")
    return git("rev-parse", "--short", "HEAD") + ("+" if changed else "")


def show(name, rows):
    """The table of a benchmark as text."""
    lines = [
        ("", "unit", "ours", "peer", "times faster", "goal", "note"),
        *(
            (
                row.what,
                row.unit,
                text(row.ours),
                text(row.peer),
                text(row.ratio),
                goal_text(row),
                row.note,
            )
            for row in rows
        ),
    ]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    body = [
        "  ".join(
            cell.ljust(width) for cell, width in zip(line, widths, strict=True)
        ).rstrip()
        for line in lines
    ]
    return "\n".join([f"== {name}", *body, ""])


def text(found):
    """A median with its least and largest value; a single value alone."""
    if found is None:
        return ""
    if found.count == 1:
        return digits(found.median)
    return "{} ({} to {})".format(*map(digits, (found.median, found.low, found.high)))


def digits(value):
    """Three digits at least, and no powers of ten below a million."""
    return f"{value:,.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}"


def goal_text(row):
    """The goal and whether it is met; nothing where there is none."""
    if row.goal is None:
        return ""
    met = {True: "met", False: "NOT met", None: "not measured"}[row.goal.met(row)]
    return f"{row.goal.column} {row.goal.relation} {row.goal.value:g}: {met}"


def write(folder, name, header, rows):
    """Write <name>.json (with the hardware) and <name>.csv into the folder."""
    folder = pathlib.Path(folder)
    owned.put(folder, [f"{name}.json", f"{name}.csv"])
    found = {
        "hardware": header,
        "rows": [
            dataclasses.asdict(row) | {"met": row.goal and row.goal.met(row)}
            for row in rows
        ],
    }
    with atomic.replace_file(folder / f"{name}.json") as path:
        path.write_text(json.dumps(found, indent=1, allow_nan=False))
    with atomic.replace_file(folder / f"{name}.csv") as path, path.open("w") as file:
        table = csv.writer(file)
        spreads = [f"{c}_{part}" for c in ("ours", "peer", "ratio") for part in COLUMNS]
        table.writerow(["what", "unit", *spreads, "goal", "note", *header])
        for row in rows:
            cells = [
                cell for c in (row.ours, row.peer, row.ratio) for cell in cells_of(c)
            ]
            table.writerow(
                [row.what, row.unit, *cells, goal_text(row), row.note, *header.values()]
            )


def cells_of(found):
    """The cells of a spread, empty for None."""
    return [getattr(found, part) if found else "" for part in COLUMNS]
