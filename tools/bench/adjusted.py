"""Pose error before and after bundle adjustment, and the mistakes that are named.

    python -m tools.bench.adjusted WORK --out docs/measured/adjusted_poses.csv

Of each capture whose true cameras are known well: its cameras are perturbed by so many
px of the images in which features are found, as `perturb_px` does, and adjusted. The
error is that of `similarity.distance_px` at the points that the true cameras
triangulate. Matches are kept in WORK. --conventions names mistakes instead. Data: in
the folder that ALIGNERF_DATA names (default ../shared/data); castle_P30 becomes a
capture by `tools.bench.surveyed`.
"""

import argparse
import csv
import itertools
import os
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.captures import base
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.scenes import cameras, prepare
from alignerf.sfm import bundle, calibration, capture, matches, mistakes, pose_error
from tools.bench import surveyed

PERTURBED_PX = (0.0, 0.5, 1.5, 3.0, 6.0, 12.0)


def captures(data, work):
    """{name: the scene's keys}; castle is made a capture of surveyed cameras."""
    scenes = Path(data) / "scenes"
    castle = work / "castle_P30"
    if not castle.is_dir():
        surveyed.main([str(scenes / "castle_P30"), str(castle)])
    courtyard = {"source": "courtyard", "poses": "truth", "triangulate": True}
    return {
        "castle": {"source": "transforms", "path": str(castle)},
        "fox": {"source": "transforms", "path": str(scenes / "fox")},
        "flower": {"source": "llff", "path": str(scenes / "flower")},
        **{f"courtyard_{seed}": courtyard | {"seed": seed} for seed in range(3)},
    }


def load(scene, folder):
    """(views at full size, their matches, the config) of a capture."""
    folder.mkdir(parents=True, exist_ok=True)
    config = of_scenes.checked(scene)
    path = folder / "matches.npz"
    # Photos of the courtyard lie there.
    scratch = tempfile.mkdtemp(dir=folder)
    views, *_ = base.of(config).read(config, Path(scratch))
    views = prepare.sort_by_name(views)
    if not path.is_file():
        found = matches.find(views, folder, max_size_px=1600, seed=0)
        matches.write(path, found)
    return views, matches.load(path), config


def error_px(true, now, points):
    """(median, worst) over views."""
    px = np.array(list(pose_error.distance_px(true, now, points).values()))
    return float(np.median(px)), float(px.max())


def rows_of(name, scene, work, seeds):
    views, found, _ = load(scene, work / name)
    true = calibration.of_views(views, found)
    seen, _ = bundle.triangulate(found, true, work / name / "true", seed=0)
    points = {v: seen.of_view(v) for v in range(len(views.names)) if len(seen.seen[v])}
    for seed in seeds:
        for px in PERTURBED_PX:
            rng = np.random.default_rng([seed, 1])
            poses = cameras.perturb_poses(true.camtoworlds, true.pixtocams, px, rng)
            given = true._replace(camtoworlds=poses)
            started = time.monotonic()
            adjusted, told = capture.adjust(
                found, given, work / name, 0, 1.0, lens=False
            )
            now = adjusted.cameras if adjusted else given
            before, after = error_px(true, given, points), error_px(true, now, points)
            yield {
                "capture": name.rpartition("_")[0] or name,
                "seed": int(name[-1]) if name[-1].isdigit() else seed,
                "perturb_px": px,
                "width": found.width,
                "before_px": round(before[0], 3),
                "before_worst_px": round(before[1], 3),
                "after_px": round(after[0], 3),
                "after_worst_px": round(after[1], 3),
                "left": round(after[0] / before[0], 3) if px else "",
                "accepted": told["accepted"],
                "held_out_before_px": told.get("before_px"),
                "held_out_after_px": told.get("after_px"),
                "time_s": round(time.monotonic() - started, 1),
            }


def named(name, scene, work):
    """Rows of what each planted mistake is called."""
    views, found, _ = load(scene, work / name)
    true = calibration.of_views(views, found)
    planted = {"as_stated": true.camtoworlds}
    # Each undoes itself, but for these.
    planted |= {
        "world_to_camera_opencv": mistakes.inverted(mistakes.turned(true.camtoworlds))
    }
    for one in (*mistakes.POSES, "reversed_order"):
        undone = mistakes.undone(one, found.names, true.camtoworlds)
        planted.setdefault(one, undone)
    for one, poses in planted.items():
        told = mistakes.find(found, true.pixtocams, poses)
        called = list(told)[-1] if len(told) > 1 else mistakes.NONE
        yield {
            "capture": name,
            "planted": one,
            "named": called,
            "as_it_came_px": round(told[mistakes.NONE][0], 2),
            "undone_px": round(told[called][0], 2),
        }


def table_of(rows):
    """A line for each capture: medians over seeds, the worst view of all seeds."""
    lines = []
    for name, own in rows.groupby("capture", sort=False):
        line = {"capture": name, "width": own["width"].iloc[0]}
        line["seeds"], line["time_s"] = own["seed"].nunique(), own["time_s"].median()
        for px, one in own.groupby("perturb_px"):
            key = f"{px:g}".replace(".", "_")
            line[f"before_{key}"] = one["before_px"].median()
            line[f"after_{key}"] = one["after_px"].median()
            line[f"worst_{key}"] = one["after_worst_px"].max()
        lines.append(line)
    return pd.DataFrame(lines)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--data", default=data_folder())
    parser.add_argument("--captures", nargs="+")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--conventions", action="store_true")
    parser.add_argument("--table", type=Path, help="rows of a run, made a table")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)
    if args.table:
        table_of(pd.read_csv(args.table)).to_csv(args.out, index=False)
        return
    every = captures(args.data, args.work)
    rows = itertools.chain.from_iterable(
        named(name, every[name], args.work)
        if args.conventions
        else rows_of(name, every[name], args.work, args.seeds)
        for name in args.captures or every
    )
    write_rows(args.out, rows)


def write_rows(path, rows):
    """Write rows as they come, so that a run that is cut off keeps what it has."""
    columns = None
    with open(path, "w", newline="", encoding="utf-8") as file:
        for row in rows:
            if columns is None:
                columns = csv.DictWriter(file, row.keys())
                columns.writeheader()
            columns.writerow(row)
            file.flush()
            print(row, flush=True)


def data_folder():
    return os.environ.get("ALIGNERF_DATA", "../shared/data")


if __name__ == "__main__":
    main()
