"""The figure of `tables.across.regimes`: what each method gains, regime by regime."""

import matplotlib.figure
import numpy as np
import pandas as pd

from alignerf.tables import scores

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#444444")
# 6 of them and 7 colours: no two of 42 rows look alike.
MARKERS = "osD^vP"
LABEL_PT, SMALL_PT = 9, 7.5
# Against the truth where it is known, else against the photos.
PREFERRED = ("oracle", "crossfit", "standard")


def draw(table, path):
    """Write the figure of a table with the columns of `tables.across.regimes`.

    A panel per curve (see `panels`), the difference to the baseline with its 95 %
    interval; regimes that are on no curve stand side by side in a panel of their own.
    """
    shown = pd.concat(
        map(compared, [rows for _, rows in table.groupby("scene", sort=False)])
    )
    if shown.empty:
        raise ValueError("figure: no method besides the baseline has a score")
    curves = panels(shown)
    figure = matplotlib.figure.Figure(
        figsize=(1.5 + 3.2 * len(curves), 3.6), dpi=200, layout="constrained"
    )
    axes = np.atleast_1d(figure.subplots(1, len(curves), sharey=True, squeeze=True))
    for one, (title, label, rows, x) in zip(axes, curves, strict=True):
        draw_panel(one, rows, x, names=list(dict.fromkeys(shown["row"])))
        one.set_title(title, fontsize=LABEL_PT)
        one.set_xlabel(label, fontsize=LABEL_PT)
    axes[0].set_ylabel(
        f"PSNR ({', '.join(dict.fromkeys(shown['test_set']))}) against the baseline\n"
        "(dB, paired, 95 % interval)",
        fontsize=LABEL_PT,
    )
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside upper center",
        ncols=3 if len(curves) > 1 else 2,
        fontsize=SMALL_PT,
    )
    figure.savefig(path)


def compared(rows):
    """What a regime's rows gain, on the test set that says most of it.

    Adds the column `row`: what the method and its warping are called.
    """
    known = set(rows["test_set"])
    chosen = next(name for name in PREFERRED if name in known)
    names = list(map(scores.row_name, rows["method"], rows["warping"]))
    rows = rows.assign(row=names)
    return rows[(rows["row"] != names[0]) & (rows["test_set"] == chosen)]


def panels(rows):
    """[(title, axis label, rows, x of each row)]: what is turned in each panel.

    Pose error without and with motion, at the number of steps that most regimes
    have; steps, where a regime was trained for several; and all else by name.
    """
    found, used = [], pd.Series(False, index=rows.index)
    usual = rows.drop_duplicates("scene")["steps"].mode().iloc[0]
    for motion, title in ((False, "nothing moves"), (True, "objects move")):
        chosen = (rows["motion_m"] > 0) == motion
        chosen &= rows["motion_m"].notna() & (rows["steps"] == usual)
        if rows.loc[chosen, "perturb_px"].nunique() > 1:
            found.append((title, "pose error (px)", rows[chosen], "perturb_px"))
            used |= chosen
    place = ["perturb_px", "motion_m"]
    budgets = rows.groupby(place)["steps"].transform("nunique") > 1
    if budgets.any():
        found.append(("budget", "steps of the baseline", rows[budgets], "steps"))
        used |= budgets
    if not used.all():
        found.append(("scenes", "", rows[~used], "scene"))
    return found


def draw_panel(axes, rows, x, *, names):
    """One line a row of the table; points a little apart, so that intervals show."""
    axes.axhline(0, color="0.35", linewidth=0.8)
    values = list(dict.fromkeys(rows[x] if x == "scene" else sorted(rows[x])))
    for place, name in enumerate(names):
        own = rows[rows["row"] == name].sort_values(x)
        shift = 0.08 * (place - (len(names) - 1) / 2)
        at = [values.index(value) + shift for value in own[x]]
        middle = own["difference_db"]
        low, high = (
            middle - own["difference_low_db"],
            own["difference_high_db"] - middle,
        )
        axes.errorbar(
            at,
            middle,
            yerr=[low.clip(lower=0), high.clip(lower=0)],
            label=name.replace("_", " "),
            color=COLOURS[place % len(COLOURS)],
            marker=MARKERS[place % len(MARKERS)],
            markersize=4,
            linewidth=0.0 if x == "scene" else 1.2,
            elinewidth=0.8,
        )
    texts = [value if x == "scene" else f"{value:g}" for value in values]
    axes.set_xticks(range(len(values)), texts)
    axes.tick_params(labelsize=SMALL_PT)
    axes.grid(axis="y", color="0.92", linewidth=0.6)
