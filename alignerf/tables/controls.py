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


def quantities():
    """(`Quantity`, test set, the one that is taken off, if any), in their order."""
    every = [(REMAINS, "warped", "standard")]
    for one in testsets.every():
        if "controls" in one.tables:
            every += [(one.score, one.name, None)] * bool(one.score)
            every += [(one.difference, one.name, one.control_of)] * bool(one.difference)
    return sorted(every, key=lambda entry: entry[0].order)


def quantities_of(psnr_db):
    """{`Quantity`: dB of each view}, in their order."""
    found = {
        key: psnr_db[name] - (psnr_db[control] if control else 0)
        for key, name, control in quantities()
        if name in psnr_db
    }
    for key, name, _ in quantities():
        if name in psnr_db and testsets.named(name).partial:
            found[key] = found[key].dropna()
    found[REMAINS] -= sum(db for key, db in found.items() if key.is_no_alignment)
    return found


def shown():
    """(name, heading, whether it is a difference) of every quantity, in their order."""
    return [(q.name, q.heading or q.name, bool(other)) for q, _, other in quantities()]


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
