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
    for _, own in views.groupby(frame.ROW, sort=False):
        psnr_db = frame.psnr_by_set(own, needed())
        for quantity, values in quantities_of(psnr_db).items():
            named = {"quantity": quantity.name, "views": len(values)}
            ends = scores.mean_and_interval(values)
            lines.append(frame.labels_of(own) | named | ends)
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
    keys = ["method", "warping"]
    wide = table.pivot(index=keys, columns="quantity", values=scores.with_ends())
    wide.columns = [f"{quantity}_{end}" for end, quantity in wide]
    order = pd.MultiIndex.from_frame(table[keys].drop_duplicates())
    fixed = [
        (f"{name}_db", heading, "interval" if differs else ".2f")
        for name, heading, differs in shown()
    ]
    return latex.of_table("controls", wide.reindex(order).reset_index(), fixed=fixed)
