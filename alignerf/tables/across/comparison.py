"""The paper's tables: `comparison.csv`, `table1.csv` and on.

Of all that was trained, or given as renders, on all scenes. Means are over scenes, and
the CSV has each scene's own lines below; scenes that were trained for another share of
the steps are a group of their own (the paper's 1x and 4x). Differences are paired by
view; 95 % intervals are over scenes, seeds and views. What the paper prints for a
method stands below ours, or at the end where no method is called so. Beside it lie
whether test sets rank the methods alike, which the paper's Table 2 claims, and the
paper's effects beside ours (`alignerf.tables.effects`).
"""

import itertools

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.io import archives, csv_files
from alignerf.tables import (
    columns,
    effects,
    frame,
    latex,
    misalignment,
    published,
    ranking,
    scores,
)
from alignerf.tables.columns import METRICS

TEST_SETS = testsets.shown_in("comparison")
# As the paper has them in one cell.
BOTH = ("standard", "warped")
# In column `scene`: means over all.
ALL = "all"


def printed(args):
    """What the paper prints in the table that the arguments name."""
    if args.published_table is None:
        return []
    return published.lines(*args.published, args.published_table)


def beside(views, table, args):
    """How test sets rank the methods, and the paper's effects beside ours."""
    found = pd.DataFrame(columns=columns.names("effects"))
    if args.published_table is not None:
        pixels = {one: pixels_of(args.results / one) for one in views["scene"].unique()}
        every = csv_files.read(*args.published)
        found = effects.of_table(args.published_table, views, every, pixels)
    return {"_ranking.csv": make_ranking(views), "_effects.csv": found}


def pixels_of(scene):
    """How many pixels the training photos of a prepared scene have."""
    cameras = archives.read(scene / "cameras.npz", ("width", "height", "split"))
    train = np.count_nonzero(cameras["split"] == "train")
    return train * int(cameras["width"]) * int(cameras["height"])


def make_table(views, printed=()):
    """Lines of a `frame.read_scenes`, each with what is printed for it below."""
    lines = []
    for share, group in views.groupby("share"):
        labels = {"group": scores.length(share), "scene": ALL}
        left = [line | labels for line in printed if line["group"] == labels["group"]]
        for _, own in frame.shared(group).groupby(frame.ROW, sort=False):
            lines += lines_of(own, labels)
            called = called_so(lines[-1])
            lines += [line for line in left if called_so(line) == called]
            left = [line for line in left if called_so(line) != called]
        # What others run: ours can only be set beside it.
        lines += left
        scenes = list(group.groupby("alike", sort=False))
        for _, seeds in scenes if len(scenes) > 1 else ():
            one = labels | {"scene": seeds["scene"].iloc[0]}
            lines += lines_of(frame.shared(seeds), one)
    table = pd.DataFrame(lines, columns=columns.names("comparison"))
    for name in ("scenes", "views", "rays_seen", "params"):
        table[name] = table[name].astype(float).round().astype("Int64")
    return table


def called_so(line):
    """What the paper calls a line's row."""
    return line["published"], line["warping"]


def lines_of(views, labels):
    """Lines of rows on all their scenes, a test set each."""
    for line in frame.summary(views, frame.ROW, TEST_SETS, against="reference_db"):
        known = pd.notna(line["difference_db"])
        yield line | labels | {"difference_to": line["reference"] if known else None}


def make_ranking(views):
    """Kendall's tau-b between test sets, of all methods of a group, with intervals.

    Of each pair of sets, the methods that have both on all scenes: renders that are
    given have fewer. Means are over the scenes' views, all pooled, and so are the
    draws of the intervals.
    """
    lines = []
    for share, group in views.groupby("share"):
        rows = frame.shared(group).groupby(frame.ROW, sort=False)
        methods = [
            {name: lines["psnr_db"].to_numpy() for name, lines in sets}
            for sets in (frame.sets_of_all(own, TEST_SETS) for _, own in rows)
        ]
        for first, second in itertools.combinations(TEST_SETS, 2):
            both = [sets for sets in methods if first in sets and second in sets]
            if len(both) > 1:
                pair = [[sets[key] for sets in both] for key in (first, second)]
                tau = ranking.tau_of(*ranking.paired(*map(np.stack, pair)))
                lines.append((scores.length(share), first, second, *tau, len(both)))
    return pd.DataFrame(lines, columns=columns.names("comparison_ranking"))


def to_latex(table):
    """The means in the paper's columns, standard / warped; published rows are grey."""
    table = table[table["scene"] == ALL]
    keys = ["group", "method", "warping"]
    lines = table.drop_duplicates(keys).set_index(keys, drop=False)
    sets = {name: table[table["test_set"] == name].set_index(keys) for name in BOTH}
    printed = lines["source"].notna()
    names = pd.Series(latex.names(lines["method"], lines["warping"]), lines.index)
    grey = r"\textcolor{gray}{" + names + "}"
    shown, heads = {}, {}
    for key, heading, form in misalignment.metrics(table):
        pair = [own[key].reindex(lines.index) for own in sets.values()]
        higher = METRICS.get(key)
        shown[key] = latex.side_by_side(*pair, form, higher, printed, within="group")
        heads[key] = heading
    return latex.of_table(
        "comparison",
        lines.assign(**shown).reset_index(drop=True),
        fixed=[(key, heading, "cells") for key, heading in heads.items()],
        written={"method": list(names.where(~printed, grey))},
    )
