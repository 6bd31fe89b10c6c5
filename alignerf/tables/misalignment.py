"""The paper's Table 1: `tables/misalignment.csv`.

Reads the scores and costs of every method and round; writes CSV and LaTeX. Costs are
those of the whole way to a model: all rounds up to its own, and, for staged training,
both stages. Differences are to round 0 of the row's base, paired by test view. What
papers print for a scene of this name stands below, and is compared with nothing.
"""

import pandas as pd

from alignerf.files import csv_files
from alignerf.tables import files as table_files
from alignerf.tables import scores

TEST_SETS = (
    *("standard", "warped", "control", "oracle", "oracle_still", "oracle_moving"),
    *("aligned_pose", "aligned_pose_gradient"),
)
# Not every view has pixels for it: the mean is of those that do.
PARTIAL = ("oracle_moving",)
# Whether higher is better.
METRICS = {
    "psnr_db": True,
    "ssim": True,
    "lpips_alex": False,
    "lpips_squeeze": False,
    "lpips_vgg": False,
}
# The network of the papers' LPIPS is not released: it compares with none of ours.
PRINTED_ONLY = "lpips_published"
PRINTED = ("psnr_db", "ssim", PRINTED_ONLY)
COUNTS = ("params", "steps", "rays_seen")
COLUMNS = (
    "method",
    "field",
    "warping",
    "test_set",
    *METRICS,
    PRINTED_ONLY,
    "difference_to",
    "difference_db",
    "difference_low_db",
    "difference_high_db",
    "train_time_s",
    "data_time_s",
    "total_time_s",
    *COUNTS,
    # The paper of a published row; empty for ours.
    "source",
)
# The paper's colours for the best, second and third of a column.
COLOURS = ("#FF9999", "#FFCC99", "#FFFF99")


def make_table(rows, printed=()):
    """A line per method, round and test set, of `rows.Misalignment`; then `printed`."""
    lines = [line for row in rows for line in lines_of(row)]
    table = pd.DataFrame([*lines, *printed], columns=COLUMNS)
    # Whole numbers stay whole beside rows that lack them.
    return table.astype(dict.fromkeys(COUNTS, "Int64"))


def published(path, scene):
    """Lines of a table of results/published that are of a scene of this name.

    Where it says neither, photos as taken are learnt from, and scored. `hours` are of
    the whole way, `params_m` millions, `size` that of the photos.
    """
    columns = ("source", "method", "scene", *PRINTED)
    table = csv_files.read(path, columns=columns)
    places = {"warping": scores.warping(0), "test_set": "standard"}
    table = table.assign(**{k: v for k, v in places.items() if k not in table})
    found = table[table["scene"] == scene]
    if found.duplicated(["method", *places]).any():
        raise ValueError(f"{path}: scene {scene}: a method stands twice")
    for row in found.to_dict("records"):
        where = f" in Table {row['table']} at {row['size']}" if "table" in row else ""
        labels = {"method": f"{row['method']}, published{where}"}
        labels |= {key: row[key] for key in ("source", *places, *PRINTED)}
        if "hours" in row:
            labels["total_time_s"] = 3600 * row["hours"]
            labels["params"] = round(1e6 * row["params_m"])
        yield labels


def lines_of(row):
    """Lines of one method and round, one per test set that was scored."""
    views = scores.read(row.metrics, METRICS, row.aligned_pose)
    base = scores.read(row.base_metrics, METRICS, row.base_aligned_pose)
    if not views.index.equals(base.index):
        raise ValueError(f"{row.metrics}: not the views of {row.base}")
    costs = table_files.costs_of(row) if row.trainings else {}
    labels = {"method": row.method, "field": row.field}
    labels["warping"] = scores.warping(row.round)
    for test_set in TEST_SETS:
        if test_set not in views:
            continue
        own, other = views[test_set], base[test_set]
        if test_set in PARTIAL:
            own, other = own.dropna(how="all"), other.dropna(how="all")
        # A view without a metric leaves the mean empty rather than flatter it.
        means = {key: own[key].mean(skipna=False) for key in METRICS}
        differences_db = own["psnr_db"] - other["psnr_db"]
        yield (
            labels
            | {"test_set": test_set, "difference_to": row.base}
            | means
            | scores.mean_and_interval(differences_db, "difference_")
            | costs
        )


def to_latex(table):
    """booktabs table: a row per method and warping, test sets side by side.

    The best three of each column are coloured as in the paper; published rows, below
    a rule of their own, are not among them. Needs booktabs, multirow and xcolor with
    its `table` option.
    """
    keys = ["method", "warping"]
    wide = side_by_side(table)
    ours = table.drop_duplicates(keys)["source"].isna().to_numpy()
    wide.index = pd.MultiIndex.from_tuples(
        [(scores.latex_name(method), warping) for method, warping in wide.index],
        names=("Method", "Warping"),
    )
    style = wide.style.format(precision=3, na_rep="--")
    short = [c for c in wide if c[0] in (HEADINGS["psnr_db"], "Cost")]
    style = style.format("{:.2f}", na_rep="--", subset=short)
    for key, higher in METRICS.items():
        chosen = [column for column in wide if column[0] == HEADINGS[key]]
        if chosen:
            subset = (wide.index[ours], chosen)
            style = style.apply(colour_best, subset=subset, higher=higher)
    tex = style.to_latex(hrules=True, convert_css=True, multicol_align="c")
    return (
        "% \\usepackage{booktabs,multirow} \\usepackage[table]{xcolor}\n"
        "% Costs are of all rounds and stages that lead to a row. Differences are to\n"
        "% the same model without warping, paired by view, with 95 % bootstrap\n"
        "% intervals; bold: the interval does not hold 0.\n"
        f"{notes(table)}{with_rule(tex, above=(~ours).sum())}"
    )


def side_by_side(table):
    """A row per method and warping: metrics and differences by test set, and costs."""
    keys = ["method", "warping"]
    shown = [key for key in HEADINGS if table[key].notna().any()]
    sets = [name for name in TEST_SETS if name in set(table["test_set"])]
    costs = table.drop_duplicates(keys).set_index(keys)
    wide = table.set_index([*keys, "test_set"]).unstack()
    columns = {
        (HEADINGS[key], name): wide[key, name]
        for key in shown
        # Papers have no other test sets.
        for name in (sets if key in METRICS else ["standard", "warped"])
        if (key, name) in wide and (key in METRICS or wide[key, name].notna().any())
    }
    columns |= {(DIFFERENCE, name): differences(wide, name) for name in sets}
    columns |= {
        ("Cost", "train (min)"): costs["train_time_s"] / 60,
        ("Cost", "data (min)"): costs["data_time_s"] / 60,
        ("Cost", "total (min)"): costs["total_time_s"] / 60,
        ("Cost", "params (M)"): costs["params"] / 1e6,
    }
    return pd.DataFrame(columns).reindex(costs.index)


def notes(table):
    """Comments: which metrics are left out, and whose the published rows are."""
    lines = [
        f"% No {key} column: some view or all lack it, see `note` in metrics.csv.\n"
        for key in METRICS
        if table[key].isna().all()
    ]
    printed = table[table["source"].notna()]
    pairs = zip(printed["method"], printed["source"], strict=True)
    return "".join([*lines, *(f"% {name}: as printed, {of}.\n" for name, of in pairs)])


def with_rule(tex, *, above):
    """A rule above the last rows, as many as `above` says."""
    lines = tex.splitlines(keepends=True)
    if above:
        lines.insert(lines.index("\\bottomrule\n") - above, "\\midrule\n")
    return "".join(lines)


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
    PRINTED_ONLY: r"LPIPS (published) $\downarrow$",
}


def colour_best(column, *, higher):
    """CSS for the best, second and third of a column."""
    ranks = column.rank(ascending=not higher, method="min")
    colours = dict(enumerate(COLOURS, start=1))
    return [
        f"background-color: {colours[rank]}" if rank in colours else ""
        for rank in ranks
    ]
