"""What one row of a paper's table gains over another, the paper's gain beside ours.

`results/table1_effects.csv`, a line for each effect, condition and method of ours.
Methods are found by what the paper calls them (`published` in a config); several of
ours may stand for one of the paper's.
"""

import numpy as np
import pandas as pd

from alignerf.tables import columns, frame, scores

LARGE, SMALL = "mip-NeRF 360, c = 4096", "mip-NeRF 360, c = 1024"
ALIGNERF, BASE = "AligNeRF, c = 1024", "mip-NeRF 360"
PARTS = ("+ convolution", "+ alignment", "+ high-frequency loss")
# {table: [(effect, row, row that it is set against)]}; a row: what the paper calls the
# method, and its rounds of warping.
EFFECTS = {
    1: (
        ("large model, warped once", (LARGE, 1), (LARGE, 0)),
        ("large model, warped twice over once", (LARGE, 2), (LARGE, 1)),
        ("small model, warped once", (SMALL, 1), (SMALL, 0)),
        ("small model, warped twice over once", (SMALL, 2), (SMALL, 1)),
        ("large over small model", (LARGE, 0), (SMALL, 0)),
        ("AligNeRF", (ALIGNERF, 0), (SMALL, 0)),
        ("AligNeRF over warped once", (ALIGNERF, 0), (SMALL, 1)),
    ),
    4: (
        *(
            (one, (one, 0), (before, 0))
            for one, before in zip(PARTS, ("baseline", *PARTS), strict=False)
        ),
        ("all three", (PARTS[-1], 0), ("baseline", 0)),
    ),
}
# Of these the paper says that both rows are level; whether more would do, too.
LEVEL = {
    "small model, warped twice over once": False,
    "AligNeRF over warped once": True,
}
# The best known truth of a scene first; the paper has the last two alone.
TRUTHS = ("oracle", "aligned_pose")
PRINTED = ("warped", "standard")
# Another seed alone moves a plain training by so much.
SPREAD_DB = 0.1
# Seeds without which nothing is called reproduced.
ENOUGH = 3
# A contrast of the paper's in parameters is one of ours from this factor on.
CONTRAST = 2.0
PUBLISHED = {"ssim": "ssim", "lpips": "lpips_published"}


def of_table(number, views, published, pixels):
    """Lines of `columns.yaml`'s `effects`: of a `frame.read_scenes`, for a table.

    published: the paper's table as CSV, a frame. pixels: {scene: its training pixels}.
    """
    paper = published[published["table"] == number]
    lines = []
    for group, printed in paper.fillna({"group": ""}).groupby("group", sort=False):
        own = (
            views
            if number in EFFECTS
            else views[views["share"].map(scores.length) == group]
        )
        for effect in effects_of(number, printed):
            lines += list(lines_of(effect, printed, own, pixels))
    return pd.DataFrame(lines, columns=columns.names("effects"))


def effects_of(number, printed):
    """The effects of a table; of systems, each over mip-NeRF 360."""
    if number in EFFECTS:
        return EFFECTS[number]
    others = [one for one in printed["method"].drop_duplicates() if one != BASE]
    return [(one, (one, 0), (BASE, 0)) for one in others]


def lines_of(effect, printed, views, pixels):
    """Lines of one effect: each condition and length, each pair of our methods."""
    what, one, other = effect
    first = printed.iloc[0]
    labels = {"table": first["table"], "effect": what} | paper_of(printed, one, other)
    found = False
    for (_, share), own in views.groupby(["alike", "share"], sort=False):
        for ours in rows_called(own, one):
            for theirs in rows_called(own, other):
                if not {*of_row(own, ours)["seed"]} & {*of_row(own, theirs)["seed"]}:
                    continue
                found = True
                row = labels | ours_of(own, ours, theirs)
                seen = frame.mean_costs(of_row(own, ours))["rays_seen"]
                row["epochs"] = seen / pixels[own["scene"].iloc[0]]
                row |= {"group": scores.length(share), "reproduced": word(row)}
                yield row
    if not found:
        yield labels | {"group": first["group"], "reproduced": "not tested"}


def paper_of(printed, one, other):
    """The paper's gains on its two test sets, and its factors of hours and size."""
    rows = printed.set_index(["method", "warping", "test_set"])
    found = {}
    for test_set in PRINTED:
        keys = [(name, scores.warping(k), test_set) for name, k in (one, other)]
        if not all(key in rows.index for key in keys):
            continue
        ours, theirs = (rows.loc[key] for key in keys)
        found[f"paper_{test_set}_db"] = ours["psnr_db"] - theirs["psnr_db"]
        for name, column in PUBLISHED.items():
            # Of the warped test set where there is one.
            found.setdefault(f"paper_{name}", ours[column] - theirs[column])
        found["paper_times"] = ours["hours"] / theirs["hours"]
        found["paper_params_times"] = ours["params_m"] / theirs["params_m"]
    return found


def rows_called(views, row):
    """(method, round) of ours that stand for a row of the paper's."""
    called, round = row
    own = views[(views["published"] == called) & (views["round"] == round)]
    return list(own[frame.ROW].drop_duplicates().itertuples(index=False, name=None))


def ours_of(views, ours, theirs):
    """Our gain of a (method, round) over another, by test set, and its costs."""
    own, base = of_row(views, ours), of_row(views, theirs)
    seeds = sorted(set(own["seed"]) & set(base["seed"]))
    own, base = (rows[rows["seed"].isin(seeds)] for rows in (own, base))
    first = own.iloc[0]
    row = {"condition": first["scene"], "method": row_name(ours)}
    row |= {"over": row_name(theirs), "seeds": len(seeds)}
    row["steps"] = first["scene_steps"]
    known = frame.known(own) & frame.known(base)
    paired = frame.beside(own, base, "theirs_db")
    for test_set in (*PRINTED, *TRUTHS):
        if test_set in known:
            lines = frame.scored(paired, test_set)
            row |= frame.gains(lines, "theirs_db", f"{test_set}_")
    row["truth"] = next((name for name in TRUTHS if name in known), None)
    if row["truth"]:
        ends = map(scores.with_ends, ("truth_", f"{row['truth']}_"))
        row |= {name: row[known] for name, known in zip(*ends, strict=True)}
    for name in ("ssim", *columns.NETWORKS):
        # On the warped test set, as the paper's; a net without weights has none.
        pair = [one[one["test_set"] == "warped"][name].mean() for one in (own, base)]
        row[name] = pair[0] - pair[1]
    costs, of_base = frame.mean_costs(own), frame.mean_costs(base)
    for name, column in (("times", "total_time_s"), ("params_times", "params")):
        row[name] = costs[column] / of_base[column]
    return row


def row_name(row):
    """A (method, round) as tables call it."""
    return scores.row_name(row[0], scores.warping(row[1]))


def of_row(views, row):
    """The lines of a (method, round)."""
    return views[(views["method"] == row[0]) & (views["round"] == row[1])]


def word(row):
    """Whether an effect of the paper shows here, by rule.

    By the truth where that is known, else by the warped test set, else the standard.
    `partly`: by the truth, and not by the paper's own test set. An effect of LEVEL is
    level where its interval comes within the seeds' spread of 0.
    """
    paper, ours = (row.get(f"{p}params_times", np.nan) for p in ("paper_", ""))
    # As a logarithm: a factor and its inverse are one contrast.
    one_size = abs(np.log(paper)) > np.log(CONTRAST) > abs(np.log(ours))
    # Systems of Tables 2 and 3 are set against each other for more than their size.
    if one_size and row["table"] in EFFECTS:
        return "not tested: models of one size"
    names = [name for name in ("truth", *PRINTED) if f"{name}_db" in row]
    paper_db = row.get("paper_warped_db", row.get("paper_standard_db"))
    if not names or pd.isna(row[f"{names[0]}_db"]):
        return "not tested"
    if row["seeds"] < ENOUGH:
        return "one seed" if row["seeds"] == 1 else "two seeds"
    if row["effect"] in LEVEL:
        first, second = (place(row, name) for name in names[:2])
        if first == second == "level":
            return "yes: level"
        if first == "above" and LEVEL[row["effect"]]:
            return "yes: above"
        return "partly: level" if first == "level" else f"no: {first}"
    if abs(row[f"{names[0]}_db"]) < SPREAD_DB:
        return "below the seeds' spread"
    signs = [sign(row, name) * np.sign(paper_db) for name in names[:2]]
    if signs[0] > 0:
        return "yes" if min(signs) > 0 else "partly"
    return "no: the opposite" if signs[0] < 0 else "no"


def place(row, name):
    """`level`, `above` or `below`; level: the interval reaches the seeds' spread."""
    _, low, high = (row[end] for end in scores.with_ends(f"{name}_"))
    if low > SPREAD_DB:
        return "above"
    return "below" if high < -SPREAD_DB else "level"


def sign(row, name):
    """Of a gain; 0 where its interval holds 0, or where it has none."""
    _, low, high = (row[end] for end in scores.with_ends(f"{name}_"))
    return int(low > 0) - int(high < 0)
