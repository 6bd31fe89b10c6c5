"""What a warped test set's gain is made of: `tables/controls.csv`.

Reads the scores of every method and round; writes CSV and LaTeX. All are means over
test views of differences in PSNR, paired by view, both sides on the same pixels but
for the gain, of which `choice` says how much that is. What `remains` adds up terms on
three sets of pixels (all, valid, and valid for the invented flow): `held_out`, on
the valid ones alone, is the measure of alignment, and `remains` its check.
"""

import pandas as pd

from alignerf.tables import scores

# What is measured, and the two test sets whose difference it is (or one's score).
QUANTITIES = {
    "standard": ("standard", None),
    "warped": ("warped", None),
    "gain": ("warped", "standard"),
    "choice": ("standard_valid", "standard"),
    "resampling": ("control", "standard"),
    "placebo": ("placebo", "standard"),
    "leak": ("leak", "leak_held_out"),
    "displaced": ("leak_held_out", "aligned"),
    "held_out": ("held_out", "standard_valid"),
    "oracle": ("oracle", None),
    "oracle_gain": ("oracle", "standard"),
    "pose_gain": ("aligned_pose", "standard"),
    "pose_leak": ("aligned_pose_leak", "oracle"),
    "gradient_gain": ("aligned_pose_gradient", "standard"),
    "gradient_leak": ("aligned_pose_gradient_leak", "oracle"),
}
# What is no alignment; the rest of the gain remains as such.
TAKEN = ("choice", "resampling", "leak")
NEEDED = {"standard", "standard_valid", "warped", "control", "placebo", "held_out"}
NEEDED |= {"aligned", "leak", "leak_held_out"}
COLUMNS = ("method", "warping", "quantity", "db", "low_db", "high_db", "views")
HEADINGS = {
    "standard": "standard",
    "warped": "warped",
    "gain": "gain",
    "choice": "pixels",
    "resampling": "resampling",
    "placebo": "(placebo)",
    "leak": "leak",
    "remains": "remains",
    "held_out": "held out",
    "displaced": "displaced",
    "oracle": "oracle",
    "oracle_gain": "oracle gain",
    "pose_gain": "pose gain",
    "pose_leak": "pose leak",
    "gradient_gain": "gradient gain",
    "gradient_leak": "gradient leak",
}


def make_table(rows):
    """A line per method, round and quantity, of `rows.Scores`."""
    lines = []
    for row in rows:
        labels = {"method": row.method, "warping": scores.warping(row.round)}
        psnr_db = scores.read_psnr(row.metrics, sorted(NEEDED), row.aligned_pose)
        for quantity, values in quantities_of(psnr_db).items():
            named = labels | {"quantity": quantity, "views": len(values)}
            lines.append(named | scores.mean_and_interval(values))
    return pd.DataFrame(lines, columns=COLUMNS)


def quantities_of(psnr_db):
    """{quantity: dB of each view}, in the order of the headings."""
    found = {}
    for quantity, (above, below) in QUANTITIES.items():
        if above in psnr_db:
            found[quantity] = psnr_db[above] - (psnr_db[below] if below else 0.0)
    found["remains"] = found["gain"] - sum(found[quantity] for quantity in TAKEN)
    return {quantity: found[quantity] for quantity in HEADINGS if quantity in found}


def to_latex(table):
    """booktabs table, a row per method and warping. Needs booktabs and multirow."""
    keys = ["method", "warping"]
    lines = table.drop_duplicates(keys)[keys]
    shown = [quantity for quantity in HEADINGS if quantity in set(table["quantity"])]
    cells = {
        (*row[:2], row[2]): cell(*row[2:6])
        for row in table[list(COLUMNS)].itertuples(index=False)
    }
    wide = pd.DataFrame(
        [
            {
                HEADINGS[quantity]: cells.get((method, warping, quantity), "--")
                for quantity in shown
            }
            for method, warping in lines.itertuples(index=False)
        ],
        index=pd.MultiIndex.from_tuples(
            [(scores.latex_name(method), name) for method, name in lines.values],
            names=("Method", "Warping"),
        ),
    )
    columns = "ll" + "r" * len(shown)
    tex = wide.style.to_latex(hrules=True, column_format=columns)
    return (
        "% \\usepackage{booktabs,multirow}\n"
        "% PSNR in dB, mean over test views; differences paired by view, with 95 %\n"
        "% bootstrap intervals; bold: the interval does not hold 0.\n"
        "% gain = warped - standard; remains = gain - pixels - resampling - leak.\n"
        "% pose gain: by cameras moved to fit the photos; leak: where none needs to.\n"
        f"{tex}"
    )


def cell(quantity, mean, low, high):
    """A score plainly, a difference with its interval."""
    if QUANTITIES.get(quantity, ("", ""))[1] is None:
        return scores.with_interval(mean, float("nan"), float("nan"))
    return scores.latex_difference(mean, low, high)
