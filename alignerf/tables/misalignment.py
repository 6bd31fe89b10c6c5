"""The paper's Table 1: `python -m alignerf.tables.misalignment`.

Reads one folder per method and round; writes CSV and LaTeX. Costs are those of the
whole way to a model: all rounds up to its own, and, for staged training, both
stages. Differences are to round 0 of the row's base, paired by test view.
"""

import pandas as pd

from alignerf.command import faults
from alignerf.tables import files as table_files
from alignerf.tables import scores

TEST_SETS = ("standard", "warped", "control", "oracle")
# Whether higher is better.
METRICS = {
    "psnr_db": True,
    "ssim": True,
    "lpips_alex": False,
    "lpips_squeeze": False,
    "lpips_vgg": False,
}
COLUMNS = (
    "method",
    "field",
    "warping",
    "test_set",
    *METRICS,
    "difference_to",
    "difference_db",
    "difference_low_db",
    "difference_high_db",
    "train_time_s",
    "data_time_s",
    "total_time_s",
    "params",
    "steps",
    "rays_seen",
)
# The paper's colours for the best, second and third of a column.
COLOURS = ("#FF9999", "#FFCC99", "#FFFF99")


def main(argv=None):
    table_files.run(__doc__, argv, make_table, to_latex)


def make_table(entries):
    """A row per method, round and test set; an entry is that of `rows_of`."""
    rows = [row for entry in entries for row in rows_of(entry)]
    return pd.DataFrame(rows, columns=COLUMNS)


def rows_of(entry):
    """Rows of one method and round, one per test set that was scored.

    entry: method, field, round, metrics (CSV), base and base_metrics (the method
    whose round 0 it is set against, and that one's CSV), trainings and data (lists
    of timing files of all that it took).
    """
    views = scores.read(entry["metrics"], METRICS)
    base = scores.read(entry["base_metrics"], METRICS)
    if not views.index.equals(base.index):
        raise ValueError(f"{entry['metrics']}: not the views of {entry['base']}")
    costs = table_files.costs_of(entry)
    labels = {"method": entry["method"], "field": entry["field"]}
    labels["warping"] = scores.warping(entry["round"])
    for test_set in TEST_SETS:
        if test_set not in views:
            continue
        # A view without a metric leaves the mean empty rather than flatter it.
        means = {key: views[test_set, key].mean(skipna=False) for key in METRICS}
        differences_db = views[test_set, "psnr_db"] - base[test_set, "psnr_db"]
        yield (
            labels
            | {"test_set": test_set, "difference_to": entry["base"]}
            | means
            | scores.mean_and_interval(differences_db, "difference_")
            | costs
        )


def to_latex(table):
    """booktabs table: a row per method and warping, test sets side by side.

    The best three of each column are coloured as in the paper. Needs booktabs,
    multirow and xcolor with its `table` option.
    """
    keys = ["method", "warping"]
    shown = [key for key in METRICS if table[key].notna().any()]
    sets = [name for name in TEST_SETS if name in set(table["test_set"])]
    costs = table.drop_duplicates(keys).set_index(keys)
    wide = table.set_index([*keys, "test_set"]).unstack()
    columns = {(HEADINGS[key], name): wide[key, name] for key in shown for name in sets}
    columns |= {(DIFFERENCE, name): differences(wide, name) for name in sets}
    columns |= {
        ("Cost", "train (min)"): costs["train_time_s"] / 60,
        ("Cost", "data (min)"): costs["data_time_s"] / 60,
        ("Cost", "total (min)"): costs["total_time_s"] / 60,
        ("Cost", "params (M)"): costs["params"] / 1e6,
    }
    wide = pd.DataFrame(columns).reindex(costs.index)
    wide.index = pd.MultiIndex.from_tuples(
        [(scores.latex_name(method), warping) for method, warping in wide.index],
        names=("Method", "Warping"),
    )
    style = wide.style.format(precision=3, na_rep="--")
    short = [c for c in wide if c[0] in (HEADINGS["psnr_db"], "Cost")]
    style = style.format("{:.2f}", na_rep="--", subset=short)
    for key in shown:
        chosen = [column for column in wide if column[0] == HEADINGS[key]]
        style = style.apply(colour_best, subset=chosen, higher=METRICS[key])
    left_out = "".join(
        f"% No {key} column: some view or all lack it, see `note` in metrics.csv.\n"
        for key in METRICS
        if key not in shown
    )
    tex = style.to_latex(hrules=True, convert_css=True, multicol_align="c")
    return (
        "% \\usepackage{booktabs,multirow} \\usepackage[table]{xcolor}\n"
        "% Costs are of all rounds and stages that lead to a row. Differences are to\n"
        "% the same model without warping, paired by view, with 95 % bootstrap\n"
        "% intervals; bold: the interval does not hold 0.\n"
        f"{left_out}{tex}"
    )


def differences(wide, test_set):
    """The differences on a test set as text, with their intervals; none to itself."""
    keys = ("difference_db", "difference_low_db", "difference_high_db")
    own = (wide.index.get_level_values("warping") == scores.warping(0)) & (
        wide.index.get_level_values("method") == wide["difference_to", test_set]
    )
    parts = zip(own, *(wide[key, test_set] for key in keys), strict=True)
    texts = ["" if base else scores.latex_difference(*part) for base, *part in parts]
    return pd.Series(texts, index=wide.index)


DIFFERENCE = r"PSNR gained (dB)"
HEADINGS = {
    "psnr_db": r"PSNR (dB) $\uparrow$",
    "ssim": r"SSIM $\uparrow$",
    "lpips_alex": r"LPIPS (Alex) $\downarrow$",
    "lpips_squeeze": r"LPIPS (Squeeze) $\downarrow$",
    "lpips_vgg": r"LPIPS (VGG) $\downarrow$",
}


def colour_best(column, *, higher):
    """CSS for the best, second and third of a column."""
    ranks = column.rank(ascending=not higher, method="min")
    colours = dict(enumerate(COLOURS, start=1))
    return [
        f"background-color: {colours[rank]}" if rank in colours else ""
        for rank in ranks
    ]


if __name__ == "__main__":
    faults.run(main)
