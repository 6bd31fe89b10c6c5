"""What tables are made of: rows in memory, and a scene's files that they come from."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.experiment.tables import rows as table_rows
from alignerf.experiment.tables import scenes as table_scenes
from alignerf.tables import collect as collecting
from alignerf.tables import columns, frame

# Of one training: its timing.json, and what all that leads to a row took.
TIMING = {"train_time_s": 20.0, "compile_time_s": 5.0, "device": "cpu"}
TIMING |= {"steps": 5, "rays_seen": 50, "params": 7}
COSTS = {"train_time_s": 30.0, "data_time_s": 3.75, "total_time_s": 33.75}
COSTS |= {"steps": 10, "rays_seen": 100, "params": 7}


def scores(db):
    """Lines of {test set: dB of the views, or {metric: one number a view}}."""
    lines = []
    for test_set, values in db.items():
        values = values if isinstance(values, dict) else {"psnr_db": values}
        empty = dict.fromkeys(columns.METRICS, np.nan) | {"ssim": 0.5}
        table = pd.DataFrame({k: np.asarray(v, float) for k, v in values.items()})
        views = [f"v{number}" for number in range(len(table))]
        table = table.assign(**{k: v for k, v in empty.items() if k not in table})
        lines.append(table.assign(test_set=test_set, view=views))
    return pd.concat(lines, ignore_index=True)


def row(db, method="plain", round=0, *, base=None, costs=COSTS, **fields):
    """A row's lines of a `frame.read`; base: the row that it is set against.

    costs: {} of finished renders.
    """
    made = scores(db)
    line = dict.fromkeys(frame.COSTS, np.nan) | (costs and COSTS | costs)
    line |= {"scene": "yard", "method": method, "round": round, "description": method}
    line |= {"published": None, "moves_cameras": False, "moves_photos": False}
    line |= {"baseline": base["method"].iloc[0] if base is not None else method}
    made = made.assign(**line | fields)
    base = made if base is None else base
    return frame.beside(made, base, "base_db", ["test_set", "view"])


def psnr(own, test_set, **keys):
    """PSNR of the views of a row, or of a scene's row of these keys."""
    chosen = np.logical_and.reduce(
        [own[key] == value for key, value in ({"test_set": test_set} | keys).items()]
    )
    return own[chosen].set_index("view")["psnr_db"]


def without(own, **keys):
    """Lines but for those of these keys."""
    chosen = np.logical_and.reduce([own[key] == value for key, value in keys.items()])
    return own[~chosen]


def emptied(own, **keys):
    """Lines without a score in those of these keys."""
    chosen = np.logical_and.reduce([own[key] == value for key, value in keys.items()])
    return own.assign(psnr_db=own["psnr_db"].mask(chosen))


def made(function, rows, *more):
    """What a table is, of rows or scenes."""
    views = pd.concat(rows, ignore_index=True)
    views = frame.with_reference(views) if "reference" in views else views
    return function(views, *more)


def scene_like(name, **fields):
    """The `Scene` of a scene; fields: what it is like."""
    like = {"scene": name, "alike": name, "reference": "plain", "seed": 0}
    like |= {"perturb_px": 0, "scene_steps": 100, "share": 1}
    return table_scenes.Scene(**like | fields)


def scored(name, rows, **fields):
    """A scene of a `frame.read_scenes`; fields: of its `Scene`."""
    like = scene_like(name, **{"reference": rows[0]["method"].iloc[0], **fields})
    return pd.concat(rows, ignore_index=True).assign(**like._asdict())


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


def check_document(tex):
    """That LaTeX compiles, as far as its text says; returns its table's columns."""
    text = re.sub(r"(?m)^%.*", "", tex)
    assert text.count(r"\begin{document}") == 1
    opened = []
    for what, name in re.findall(r"\\(begin|end)\{(\w+)\}", text):
        if what == "begin":
            opened.append(name)
        else:
            assert opened.pop() == name
    assert opened == []
    depth = 0
    for brace in re.findall(r"(?<!\\)[{}]", text):
        depth += 1 if brace == "{" else -1
        assert depth >= 0
    assert depth == 0
    columns = len(re.search(r"\\begin\{tabular\}\{(\w+)\}", text)[1])
    lines = [line for line in text.splitlines() if line.endswith(r"\\")]
    for line in lines:
        wide = sum(int(n) - 1 for n in re.findall(r"\\multicolumn\{(\d+)\}", line))
        assert len(re.findall(r"(?<!\\)&", line)) + 1 + wide == columns, line
    return columns


def put(path, content):
    """Write a file: text, JSON of a dict, or CSV of a table; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, pd.DataFrame):
        content = content.to_csv(index=False)
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return str(path)


def written(scene, db, method="plain", round=0, *, base=None, timing=(), **fields):
    """A training's `Row` of collect, in the scene's folder; all that it may have.

    base: another method.
    """
    folders = [f"{method}/round{number}" for number in range(round + 1)]
    path = Path(scene) / folders[-1]
    long = scores(db)
    views = long["view"].unique()
    parts = pd.DataFrame({"view": views}).assign(**dict.fromkeys(columns.PARTS, 0.25))
    train = "view,median_px,time_s\nt,1,0.25\nu,3,0.5\n"
    contents = {
        "scores": ("metrics.csv", long.drop(columns=[*columns.PARTS], errors="ignore")),
        "parts": ("decomposition_test.csv", parts),
        "timing": ("timing.json", TIMING | dict(timing)),
        "process": ("logs/train.tsv", "s\tmax_rss\n28.0\t1.5\n"),
        "render": ("render/train.json", {"views": 4, "view_time_s": 0.5, "time_s": 3}),
        "align": ("displacement/train.csv", train),
        "corrections": ("corrected/poses_corrected.json", {"time_s": 1.5}),
    }
    made = table_rows.Row(
        *(folders[-1], folders, folders[:-1], []),
        files={key: put(path / name, what) for key, (name, what) in contents.items()},
        method=method,
        round=round,
        description="grid 2^15",
        baseline=base or method,
        base=f"{base or method}/round0",
    )
    return made._replace(**fields)


def collect(scene, rows, table=""):
    """Run the command on these rows; returns what it made, as tables read it."""
    folder = Path(scene) / table
    places = [f"--{name}={folder / name}.csv" for name in ("scores", "trainings")]
    collecting.main(["--rows", table_rows.as_json(rows), *places])
    return frame.read(scene, table)
