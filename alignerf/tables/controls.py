"""What a warped test set's gain is made of: `tables/controls.csv`.

All are means over test views of differences in PSNR, paired by view, both sides on the
same pixels but for the gain, of which `pixel_choice` says how much that is. `remains`
adds up terms on three sets of pixels (all, valid, and valid for the invented flow).
`crossfit`, on the valid ones alone, is the measure of alignment, and `remains` its
check.
"""

import pandas as pd

from alignerf.tables import columns, latex, scores

# What is measured, and the two test sets whose difference it is (or one's score).
QUANTITIES = {
    "standard": ("standard", None),
    "warped": ("warped", None),
    "gain": ("warped", "standard"),
    "pixel_choice": ("standard_valid", "standard"),
    "resampling": ("control", "standard"),
    "placebo": ("placebo", "standard"),
    "overfit": ("overfit", "overfit_crossfit"),
    "oracle_offset": ("overfit_crossfit", "aligned"),
    "crossfit": ("crossfit", "standard_valid"),
    "oracle": ("oracle", None),
    "oracle_gain": ("oracle", "standard"),
    "pose_gain": ("aligned_pose", "standard"),
    "pose_overfit": ("aligned_pose_overfit", "oracle"),
}
# What is no alignment; the rest of the gain remains as such.
TAKEN = ("pixel_choice", "resampling", "overfit")
NEEDED = {"standard", "standard_valid", "warped", "control", "placebo", "crossfit"}
NEEDED |= {"aligned", "overfit", "overfit_crossfit"}
HEADINGS = {
    "standard": "standard",
    "warped": "warped",
    "gain": "gain",
    "pixel_choice": "pixels",
    "resampling": "resampling",
    "placebo": "(placebo)",
    "overfit": "overfit",
    "remains": "remains",
    "crossfit": "crossfit",
    "oracle_offset": "oracle offset",
    "oracle": "oracle",
    "oracle_gain": "oracle gain",
    "pose_gain": "pose gain",
    "pose_overfit": "pose overfit",
}
NOTES = (
    "PSNR in dB, mean over test views; differences paired by view, with 95 %",
    "bootstrap intervals; bold: the interval does not hold 0.",
    "gain = warped - standard; remains = gain - pixels - resampling - overfit.",
    "pose gain: by cameras moved to fit the photos; overfit: where none needs to.",
)


def make_table(rows):
    """A line per `results.Row` and quantity."""
    lines = []
    for row in rows:
        labels = {"method": row.method, "warping": row.warping}
        for quantity, values in quantities_of(row.psnr_db(sorted(NEEDED))).items():
            named = labels | {"quantity": quantity, "views": len(values)}
            lines.append(named | scores.mean_and_interval(values))
    return pd.DataFrame(lines, columns=columns.names("controls"))


def quantities_of(psnr_db):
    """{quantity: dB of each view}, in the order of the headings."""
    of_views = {}
    for quantity, (above, below) in QUANTITIES.items():
        if above in psnr_db:
            of_views[quantity] = psnr_db[above] - (psnr_db[below] if below else 0.0)
    taken = sum(of_views[quantity] for quantity in TAKEN)
    of_views["remains"] = of_views["gain"] - taken
    return {name: of_views[name] for name in HEADINGS if name in of_views}


def to_latex(table):
    """A row per method and warping, a column a quantity."""
    quantities = [name for name in HEADINGS if name in set(table["quantity"])]
    rows = []
    for (method, warping), own in table.groupby(["method", "warping"], sort=False):
        texts = {
            line.quantity: cell(line.quantity, line.db, line.low_db, line.high_db)
            for line in own.itertuples()
        }
        cells = [texts.get(quantity, "--") for quantity in quantities]
        rows.append([latex.name(method), warping, *cells])
    names, *others = zip(*rows, strict=True)
    rows = latex.rows_of([latex.once(names), *others])
    heads = ["Method", "Warping", *(HEADINGS[quantity] for quantity in quantities)]
    return latex.table("ll" + "r" * len(quantities), [heads], rows, NOTES)


def cell(quantity, mean, low, high):
    """A score plainly, a difference with its interval."""
    if QUANTITIES.get(quantity, ("", ""))[1] is None:
        return scores.with_interval(mean, float("nan"), float("nan"))
    return latex.difference(mean, low, high)
