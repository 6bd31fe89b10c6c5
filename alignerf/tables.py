"""The misalignment table (the paper's Table 1): `python -m alignerf.tables`.

Reads one folder per method and round; writes CSV and LaTeX. Costs are those of the
whole way to a model: all rounds up to its own, and, for staged training, both
stages.
"""

import argparse
import json
import pathlib

import pandas as pd

from alignerf import cli

TEST_SETS = ("standard", "warped", "control", "oracle")
WARPINGS = {0: "none", 1: "once", 2: "twice", 3: "three times"}
METRICS = {"psnr_db": True, "ssim": True, "lpips_alex": False}  # higher is better
COLUMNS = (
    "method",
    "field",
    "warping",
    "test_set",
    *METRICS,
    "train_time_s",
    "data_time_s",
    "params",
    "steps",
    "rays_seen",
)
# The paper's colours for the best, second and third of a column.
COLOURS = ("#FF9999", "#FFCC99", "#FFFF99")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", required=True, help="JSON: what stands in each row")
    parser.add_argument("--csv", required=True, help="table, written")
    parser.add_argument("--tex", required=True, help="table, written")
    args = parser.parse_args(argv)
    entries = json.loads(args.rows)
    table = pd.DataFrame(
        [row for entry in entries for row in rows_of(entry)], columns=COLUMNS
    )
    with cli.replace_file(args.csv) as path:
        table.to_csv(path, index=False, float_format="%.6g")
    with cli.replace_file(args.tex) as path:
        path.write_text(to_latex(table))


def rows_of(entry):
    """Rows of one method and round, one per test set that was scored.

    entry: method, field, round, metrics (CSV), trainings and data (lists of timing
    files of all that it took).
    """
    scores = pd.read_csv(entry["metrics"])
    trainings = [read_json(path) for path in entry["trainings"]]
    costs = {
        key: sum(timing[key] for timing in trainings)
        for key in ("train_time_s", "steps", "rays_seen")
    }
    costs["data_time_s"] = sum(time_of(path) for path in entry["data"])
    costs["params"] = trainings[-1]["params"]
    warping = WARPINGS.get(entry["round"], f"{entry['round']} times")
    for test_set in TEST_SETS:
        views = scores[scores["test_set"] == test_set]
        if len(views) == 0:
            continue
        # A view without a metric leaves the mean empty rather than flatter it.
        means = {key: views[key].mean(skipna=False) for key in METRICS}
        labels = {"method": entry["method"], "field": entry["field"]}
        yield labels | {"warping": warping, "test_set": test_set} | means | costs


def time_of(path):
    """Seconds in a timing file, or in all views of a CSV of displacements."""
    if path.endswith(".csv"):
        return float(pd.read_csv(path)["time_s"].sum())
    return read_json(path)["time_s"]


def read_json(path):
    return json.loads(pathlib.Path(path).read_text())


def to_latex(table):
    """booktabs table: a row per method and warping, test sets side by side.

    The best three of each column are coloured as in the paper. Needs booktabs,
    multirow and xcolor with its `table` option.
    """
    keys = ["method", "warping"]
    shown = [key for key in METRICS if table[key].notna().any()]
    sets = [name for name in TEST_SETS if name in set(table["test_set"])]
    costs = table.drop_duplicates(keys).set_index(keys)
    scores = table.set_index([*keys, "test_set"])[shown].unstack()
    columns = {
        (HEADINGS[key], name.replace("_", r"\_")): scores[key, name]
        for key in shown
        for name in sets
    }
    columns |= {
        ("Cost", "train (min)"): costs["train_time_s"] / 60,
        ("Cost", "data (min)"): costs["data_time_s"] / 60,
        ("Cost", "params (M)"): costs["params"] / 1e6,
    }
    wide = pd.DataFrame(columns).reindex(costs.index)
    wide.index = pd.MultiIndex.from_tuples(
        [(method.replace("_", r"\_"), warping) for method, warping in wide.index],
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
        "% Costs are of all rounds and stages that lead to a row.\n"
        f"{left_out}{tex}"
    )


HEADINGS = {
    "psnr_db": r"PSNR (dB) $\uparrow$",
    "ssim": r"SSIM $\uparrow$",
    "lpips_alex": r"LPIPS (Alex) $\downarrow$",
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
    cli.run(main)
