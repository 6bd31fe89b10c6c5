"""What a warped test set's gain is made of: `tables/controls.csv`.

All are means over test views of differences in PSNR, paired by view, both sides on the
same pixels but for the gain, of which `pixel_choice` says how much that is. `remains`
adds up terms on three sets of pixels (all, valid, and valid for the invented flow).
`crossfit`, on the valid ones alone, is the measure of alignment, and `remains` its
check. Each test set says what its score, and its difference to another, tells.
"""

import pandas as pd

from alignerf import testsets
from alignerf.tables import columns, frame, latex, scores
from alignerf.testsets.base import Quantity

# Of the gain, what is left without all that is no alignment.
REMAINS = Quantity("remains", 70)
NOTES = (
    "PSNR in dB, mean over test views; differences paired by view, with 95 %",
    "bootstrap intervals; bold: the interval does not hold 0.",
    "gain = warped - standard; remains = gain - pixels - resampling - overfit.",
    "pose gain: by cameras moved to fit the photos; overfit: where none needs to.",
)


def needed():
    """Names of the test sets that each row has to have."""
    return [
        one.name
        for one in testsets.every()
        if "controls" in one.tables and one.needs in ("", "testset") and not one.moved
    ]


def make_table(views):
    """A line per row of a `frame.read` and quantity."""
    lines = []
    for labels, own in frame.rows_of(views):
        psnr_db = frame.psnr_by_set(own, needed())
        for quantity, values in quantities_of(psnr_db).items():
            named = labels | {"quantity": quantity.name, "views": len(values)}
            lines.append(named | scores.mean_and_interval(values))
    return pd.DataFrame(lines, columns=columns.names("controls"))


def quantities_of(psnr_db):
    """{`Quantity`: dB of each view}, in their order."""
    found = {}
    for one in testsets.every():
        if "controls" in one.tables and one.name in psnr_db:
            if one.score:
                found[one.score] = psnr_db[one.name]
            if one.difference:
                found[one.difference] = psnr_db[one.name] - psnr_db[one.control_of]
    gain = found[testsets.named("warped").difference]
    found[REMAINS] = gain - sum(v for k, v in found.items() if k.is_no_alignment)
    return {key: found[key] for key in sorted(found, key=lambda key: key.order)}


def shown():
    """(name, heading, whether it is a difference) of every quantity, in their order."""
    every = [(REMAINS, True)]
    for one in testsets.every():
        every += [(one.score, False)] * bool(one.score)
        every += [(one.difference, True)] * bool(one.difference)
    every.sort(key=lambda pair: pair[0].order)
    return [(q.name, q.heading or q.name, differs) for q, differs in every]


def to_latex(table):
    """A row per method and warping, a column a quantity."""
    known = set(table["quantity"])
    chosen = [one for one in shown() if one[0] in known]
    rows = table[["method", "warping"]].drop_duplicates()
    for name, _, _ in chosen:
        own = table[table["quantity"] == name].drop(columns=["quantity", "views"])
        ends = dict(zip(scores.with_ends(), scores.with_ends(f"{name}_"), strict=True))
        rows = rows.merge(own.rename(columns=ends), how="left")
    methods = list(map(latex.name, rows["method"]))
    fixed = [
        (f"{name}_db", heading, "interval" if differs else ".2f")
        for name, heading, differs in chosen
    ]
    return latex.of_lines(
        rows,
        {"Method": methods, "Warping": rows["warping"]},
        [],
        fixed=fixed,
        notes=NOTES,
    )
