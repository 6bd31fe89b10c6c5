"""Remedies in windows of photos at several sizes, as tables.

    snakemake --cores N --configfile workflow/config/windows.yaml
    python -m tools.bench.window_sizes workflow/config/windows.yaml
        --plain window_sizes.csv --out full_size.csv

The first table has plain training at each size; the second has a line for each method,
and gains over plain training of the same size. Scenes are called CAPTURE, CAPTURE_half
and CAPTURE_quarter; what was not scored is left out. `--results` names one folder for
each seed. Trainings of twice the steps are in scenes that end in `_x2`, as
`vary: { lengths: [1, 2] }` makes them; of a method two files are enough:

    snakemake --cores N --configfile workflow/config/windows.yaml LENGTHS.yaml
        -- results/SCENE_x2/METHOD/round0/{metrics,metrics_aligned_pose}.csv
"""

import argparse
import itertools
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from alignerf.files import csv_files, json_files, yaml_files
from alignerf.tables import scores

# Capture: its name, its poses.
CAPTURES = {
    "fox": ("fox", "COLMAP's, given"),
    "chair": ("chair", "the phone's own"),
    "chair_colmap": ("chair", "COLMAP's"),
    "flower": ("flower", "LLFF's"),
    "castle": ("castle_P30", "surveyed"),
}
# The same photos with right poses: what wrong ones cost plain training is told by them.
RIGHT = {"chair": "chair_colmap"}
# Ending of a scene's name: its size, and pixels of the photo in one of it.
SIZES = {"": ("full", 1), "_half": ("half", 2), "_quarter": ("quarter", 4)}
# (method, round): its name; the first is what others are compared with.
METHODS = {
    ("mipnerf360", 0): "plain training",
    ("mipnerf360", 1): "warped once",
    ("mipnerf360", 2): "warped twice",
    ("alignerf", 0): "AligNeRF",
    ("aligned", 0): "aligned on the way",
    ("learnt", 0): "cameras learnt with the scene",
    ("mipnerf360_x2", 0): "twice the steps, plain training",
    ("aligned_x2", 0): "twice the steps, aligned on the way",
}
PLAIN = next(iter(METHODS))
LONGER = "_x2"
STANDARD, FAIR = "standard", "aligned_pose"
KEYS = ["method", "round", "test_set", "view"]


class Scored(NamedTuple):
    """What one seed of a scene has scored.

    psnr_db: by (method, round, test set, view). time_s: by (method, round), of the
    whole way. flow_px: of plain training, in px of its size, training views then test.
    passes: how often each pixel was seen.
    """

    psnr_db: pd.Series
    time_s: dict
    flow_px: tuple
    width_px: int
    passes: float


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", type=Path)
    parser.add_argument("--results", type=Path, nargs="+", default=[Path("results")])
    parser.add_argument("--plain", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)
    scenes = yaml_files.read(args.config)["scenes"]
    found = {}
    for capture, ending in itertools.product(CAPTURES, SIZES):
        scene = capture + ending
        folders = [folder / scene for folder in args.results if scene in scenes]
        if seeds := [read(folder) for folder in folders if is_whole(folder)]:
            found[capture, ending] = seeds
    plain = [plain_row(capture, ending, found) for capture, ending in found]
    rows = [
        row
        for capture, method in itertools.product(CAPTURES, METHODS)
        if (row := row_of(capture, method, found))
    ]
    for table, path in ((plain, args.plain), (rows, args.out)):
        pd.DataFrame(table).to_csv(path, index=False, float_format="%.2f")


def is_whole(folder):
    """Whether all that is read of a scene is there."""
    names = ("scores.csv", "tables/misalignment.csv", "poses.json", "verdict.json")
    return all((folder / name).exists() for name in names)


def read(folder) -> Scored:
    """A scene's scores, times and flow."""
    table = csv_files.read(folder / "scores.csv", columns=(*KEYS, "metric", "value"))
    table = table[table["metric"] == "psnr_db"]
    times = csv_files.read(
        folder / "tables" / "misalignment.csv",
        columns=("method", "warping", "total_time_s"),
    )
    times = times.drop_duplicates(["method", "warping"])
    of_rounds = {name: count for count, name in scores.WARPINGS.items()}
    poses = json_files.read(folder / "poses.json", {"photo_size": list})
    facts = json_files.read(folder / "verdict.json", {"evidence": dict})["evidence"]
    flow = (facts["flow_train_px"], facts["flow_test_px"])
    psnr_db = table.set_index(KEYS)["value"].astype(float).dropna()
    time_s = {
        (row.method, of_rounds[row.warping]): row.total_time_s
        for row in times.itertuples()
        if row.warping in of_rounds
    }
    for method in METHODS:
        more = longer(folder, *method) if method[0].endswith(LONGER) else None
        if more:
            psnr_db, time_s[method] = pd.concat([psnr_db, more[0]]), more[1]
    return Scored(
        psnr_db=psnr_db.sort_index(),
        time_s=time_s,
        flow_px=tuple(np.nan if px is None else px for px in flow),
        width_px=poses["photo_size"][0],
        passes=facts["passes"],
    )


def longer(folder, method, count):
    """(PSNR, seconds) of a method's training of twice the steps; None without it."""
    folder = folder.with_name(folder.name + LONGER)
    folder = folder / method.removesuffix(LONGER) / f"round{count}"
    paths = [folder / f"metrics{ending}.csv" for ending in ("", "_aligned_pose")]
    if not all(path.exists() for path in paths):
        return None
    columns = ("view", "test_set", "psnr_db")
    table = pd.concat([csv_files.read(path, columns=columns) for path in paths])
    table = table.assign(method=method, round=count).set_index(KEYS)
    kinds = {"train_time_s": json_files.NUMBER}
    time_s = json_files.read(folder / "timing.json", kinds)["train_time_s"]
    return table["psnr_db"].astype(float).dropna(), time_s


def plain_row(capture, ending, found):
    """Plain training of a capture at one size."""
    (name, poses), (size, photo_px) = CAPTURES[capture], SIZES[ending]
    seeds = found[capture, ending]
    right = found.get((RIGHT.get(capture), ending))
    loss = over(right, PLAIN, seeds, FAIR) if right else None
    flow_px, flow_test_px = np.mean([one.flow_px for one in seeds], axis=0)
    return {
        "capture": name,
        "poses": poses,
        "size": size,
        "width_px": round(seeds[0].width_px / photo_px),
        "seeds": len(seeds),
        "test_views": len(views_of(seeds[0], PLAIN, STANDARD)),
        "passes": seeds[0].passes,
        "flow_px": flow_px,
        "flow_test_px": flow_test_px,
        "flow_photo_px": photo_px * flow_px,
        "standard_db": mean_of(seeds, PLAIN, STANDARD),
        "aligned_pose_db": mean_of(seeds, PLAIN, FAIR),
        **(scores.pooled_mean_and_interval(loss, "loss_") if loss else {}),
    }


def row_of(capture, method, found):
    """What a method scores and gains at each size; None where it was not scored.

    Of the seeds that have it, over plain training of the same seeds.
    """
    name, poses = CAPTURES[capture]
    row = {"capture": name, "poses": poses, "method": METHODS[method]}
    labels = len(row)
    for ending, (size, _) in SIZES.items():
        seeds = found.get((capture, ending), ())
        seeds = [one for one in seeds if method in one.time_s]
        if not seeds:
            continue
        times = [one.time_s[method] / one.time_s[PLAIN] for one in seeds]
        row[f"{size}_time"] = np.median(times)
        for test_set, prefix in ((STANDARD, f"standard_{size}_"), (FAIR, f"{size}_")):
            row[f"{prefix}psnr_db"] = mean_of(seeds, method, test_set)
            if method == PLAIN:
                continue
            gains = over(seeds, method, seeds, test_set)
            ends = scores.pooled_mean_and_interval(gains).values()
            row |= dict(zip(columns_of(prefix), ends, strict=True))
    return row if len(row) > labels else None


def columns_of(prefix):
    """Columns of a gain and of the ends of its interval, as in `tools.docs.tables`."""
    first, rest = prefix.split("_", 1)
    return [f"{first}_{end}{rest}gain_db" for end in ("", "low_", "high_")]


def over(seeds, method, others, test_set):
    """A method's PSNR less others' plain training, view by view; an array a seed."""
    return [
        (views_of(own, method, test_set) - views_of(other, PLAIN, test_set)).to_numpy()
        for own, other in zip(seeds, others, strict=True)
    ]


def mean_of(seeds, method, test_set):
    """Mean over seeds of the mean PSNR of held-out photos."""
    return np.mean([views_of(one, method, test_set).mean() for one in seeds])


def views_of(seed: Scored, method, test_set):
    """PSNR of each held-out photo."""
    return seed.psnr_db.loc[(*method, test_set)]


if __name__ == "__main__":
    main()
