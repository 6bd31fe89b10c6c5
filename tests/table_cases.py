"""What tables are made of: rows in memory, and a scene's files that they come from."""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.experiment.tables import rows as table_rows
from alignerf.experiment.tables import scenes as table_scenes
from alignerf.tables import collect as collecting
from alignerf.tables import columns, results
from alignerf.tables import files as table_files

# Of one training: its timing.json, and what all that leads to a row took.
TIMING = {"train_time_s": 20.0, "compile_time_s": 5.0, "device": "cpu"}
TIMING |= {"steps": 5, "rays_seen": 50, "params": 7}
COSTS = {"train_time_s": 30.0, "data_time_s": 3.75, "total_time_s": 33.75}
COSTS |= {"steps": 10, "rays_seen": 100, "params": 7}


def scores(db):
    """`Row.views` of {test set: dB of the views, or {metric: one number a view}}."""
    wide = {}
    for test_set, values in db.items():
        values = values if isinstance(values, dict) else {"psnr_db": values}
        empty = dict.fromkeys(columns.METRICS, np.nan) | {"ssim": 0.5}
        wide |= {(test_set, key): value for key, value in (empty | values).items()}
    count = max(map(np.size, wide.values()))
    views = pd.Index([f"v{number}" for number in range(count)], name="view")
    table = pd.DataFrame(wide, index=views)
    table.columns = table.columns.set_names(["test_set", "metric"])
    return table.astype(float)


def row(db, method="plain", round=0, *, base=None, costs=COSTS, own=None, **fields):
    """A `results.Row`; base: the row that it is set against, itself without one.

    costs: {} of renders that are given. own: entries of its line of trainings.csv.
    """
    views = scores(db)
    line = {"folder": f"{method}/round{round}", **TIMING, **(own or {})}
    made = results.Row(
        scene="yard",
        method=method,
        round=round,
        description=method,
        baseline=base.method if base else method,
        published=None,
        views=views,
        base=base.views if base else views,
        own=pd.Series(line).reindex(columns.names("trainings")),
        before=None,
        costs=costs and COSTS | costs,
        trainings=[],
    )
    return made._replace(**fields)


def scored(name, rows, folder=Path(), **fields):
    """`files.Scored` of a scene; folder: of all results; fields: of its `Scene`."""
    alike = {"like": name, "alike": name, "capture": name}
    like = {"seed": 0, "perturb_px": 0, "motion_m": None, "steps": 100, "share": 1}
    scene = table_scenes.Scene(
        **{"scene": name, "reference": rows[0].method, **alike, **like, **fields}
    )
    rows = [row._replace(scene=name) for row in rows]
    return table_files.Scored(scene, Path(folder) / name, rows)


def one(table, **keys):
    """The one line of a table with these entries, as a dict."""
    chosen = np.logical_and.reduce([table[key] == value for key, value in keys.items()])
    (line,) = table[chosen].to_dict("records")
    return line


def cells(tex):
    """The cells of a LaTeX table's body, row by row."""
    body = tex.partition(r"\midrule")[2].partition(r"\bottomrule")[0]
    lines = [line for line in body.splitlines() if "&" in line]
    rows = [line.strip().removesuffix(r"\\").split("&") for line in lines]
    return [[cell.strip() for cell in row] for row in rows]


def put(path, content):
    """Write a file: text, JSON of a dict, or CSV of a table; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, pd.DataFrame):
        content = content.to_csv(index=False)
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return str(path)


def written(scene, db, method="plain", round=0, *, base=None, timing=(), **fields):
    """A training's `Row` of collect, in the scene's folder; all that it may have.

    A round begins with the flow of the one before. base: another method.
    """
    folders = [f"{method}/round{number}" for number in range(round + 1)]
    path = Path(scene) / folders[-1]
    long = scores(db).stack("test_set", future_stack=True).reset_index()
    views = long["view"].unique()
    parts = pd.DataFrame({"view": views}).assign(**dict.fromkeys(columns.PARTS, 0.25))
    train = "view,median_px,time_s\nt,1,0.25\nu,3,0.5\n"
    benchmark = "s\th:m:s\tmax_rss\n{}\t0\t1.5\n"
    contents = {
        "scores": ("metrics.csv", long.drop(columns=[*columns.PARTS], errors="ignore")),
        "parts": ("decomposition_test.csv", parts),
        "timing": ("timing.json", TIMING | dict(timing)),
        "process": ("logs/train.tsv", benchmark.format(28.0)),
        "render": ("render/train.json", {"views": 4, "view_time_s": 0.5, "time_s": 3}),
        "align": ("displacement/train.csv", train),
        "render_test": ("render/test.json", {"views": 3, "view_time_s": 0.5}),
        "align_test": ("displacement/test.csv", "view,time_s\nv0,0.125\n"),
        "render_process": ("logs/render.tsv", benchmark.format(6.0)),
        "align_process": ("logs/align.tsv", benchmark.format(2.0)),
        "corrections": ("corrected/poses_corrected.json", {"time_s": 1.5}),
        "displacement": ("displacement/train.csv", train),
    }
    made = table_rows.Row(
        *(folders[-1], folders, folders[:-1], []),
        files={key: put(path / name, what) for key, (name, what) in contents.items()},
        method=method,
        round=round,
        description="grid 2^15",
        baseline=base or method,
        base=f"{base or method}/round0",
        before=folders[-2] if round else None,
    )
    return made._replace(**fields)


def collect(scene, rows, table=""):
    """Run the command on these rows; returns what it made, as tables read it."""
    folder = Path(scene) / table
    places = [f"--{name}={folder / name}.csv" for name in ("scores", "trainings")]
    collecting.main(["--rows", table_rows.as_json(rows), *places])
    return results.read(scene, table)
