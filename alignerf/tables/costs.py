"""How misaligned renders are, and what time brings.

`tables/displacement.csv` has a row per method and round: means over the test views of
the flow from render to photo and of its parts, as `flow.decompose` measured them.
"""

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.tables import columns, frame, latex, scores

# Cameras that are moved to fit a photo are scored by PSNR alone; other metrics are of
# this test set.
PERCEPTUAL = "warped"
POINT_COSTS = ("params", "rays_seen", "train_time_s", "total_time_s")


def trained(views):
    """(labels, lines) of the rows of a `frame.read` that were trained."""
    for _, own in frame.rows_of(views):
        if pd.notna(own.iloc[0]["way"]):
            yield own.iloc[0][frame.ROW].to_dict(), own


def displacement(views):
    """A line per row that was trained; a column that some view lacks stays empty."""
    lines = []
    for labels, own in trained(views):
        parts = own[own["test_set"] == "standard"][columns.PARTS]
        means = parts.mean(skipna=False).to_dict()
        lines.append(labels | {"views": len(parts)} | means)
    return pd.DataFrame(lines, columns=columns.names("displacement"))


def displacement_to_latex(table):
    """Lengths of the parts in px, shares in per cent.

    A part that no row has is left out: a model's part needs a truth.
    """
    fixed = [
        (f"{part}_{length}", f"{part} {name} (px)", ".2f")
        for part in ("flow", "model", "camera", "remainder")
        for length, name in (
            *(("median_px", "median"), ("mean_px", "mean")),
            ("p95_px", r"95 \%"),
        )
        if table[f"{part}_median_px"].notna().any()
    ]
    fixed += [(f"{key}_fraction", rf"{key} (\%)", "%") for key in ("camera", "moved")]
    return latex.of_lines(
        table,
        {"Method": list(map(latex.name, table["method"])), "Round": table["round"]},
        [],
        fixed=fixed,
        notes=[
            "Length of the flow from render to photo, and of its parts: means over the",
            "test views.",
        ],
    )


def points(views):
    """`tradeoff.csv`: lines of a `frame.read_scenes`, from short to long."""
    made = [points_of(own) for _, own in views.groupby("alike", sort=False)]
    return pd.concat(made)[columns.names("tradeoff")].reset_index(drop=True)


def points_of(condition):
    """Lines of one condition."""
    first = condition.iloc[0]
    lengths = condition["share"].unique()
    whole = condition[condition["share"] == (1 if 1 in lengths else lengths[0])]
    base = whole[(whole["method"] == first["reference"]) & (whole["round"] == 0)]
    test_set = testsets.fairest(frame.known(base))
    on = ["seed", "test_set", "view"]
    lines = []
    for length, group in frame.beside(condition, base, "reference_db", on).groupby(
        "share"
    ):
        for (method, round), own in frame.shared(group).groupby(frame.ROW, sort=False):
            row = own.iloc[0]
            sets = dict(frame.sets_of_all(own, [test_set, PERCEPTUAL]))
            if pd.isna(row["way"]) or test_set not in sets:
                continue
            perceived, own = sets.get(PERCEPTUAL, own), sets[test_set]
            line = {"condition": first["scene"], "length": length, "method": method}
            line |= {"warping": scores.warping(round), "field": row["description"]}
            line |= {"test_set": test_set} | frame.mean_costs(own, POINT_COSTS)
            line |= frame.gains(own, None, "psnr_")
            line |= frame.means(perceived, columns.NETWORKS)
            line |= frame.gains(own, "reference_db")
            lines.append(line | {"seeds": own["scene"].nunique(), "views": len(own)})
    found = pd.DataFrame(lines)
    front = pareto_front(found["total_time_s"], found["psnr_db"])
    return found.assign(pareto=front)


def pareto_front(seconds, psnr_db):
    """[n] bool: nothing is as cheap and as good, and better in one of the two.

    Equal points are both on the front; one that is not finite never is.
    """
    cost, score = np.asarray(seconds, np.float64), np.asarray(psnr_db, np.float64)
    known = np.isfinite(cost) & np.isfinite(score)
    no_worse = (cost[:, None] <= cost) & (score[:, None] >= score)
    better = (cost[:, None] < cost) | (score[:, None] > score)
    return known & ~(no_worse & better & known[:, None]).any(axis=0)
