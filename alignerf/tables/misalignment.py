"""The paper's Table 1: `tables/misalignment.csv`.

Costs are those of the whole way to a model: all rounds up to its own, and, for staged
training, both stages. Differences are to round 0 of the row's baseline, paired by test
view. What papers print for a scene of this name stands below, and is compared with
nothing.
"""

import pandas as pd

from alignerf import testsets
from alignerf.files import csv_files
from alignerf.tables import columns, latex, scores
from alignerf.tables.columns import METRICS, PRINTED_ONLY

TEST_SETS = testsets.shown_in("misalignment")
# Not every view has pixels for it: the mean is of those that do.
PARTIAL = ("oracle_moving",)
PRINTED = ("psnr_db", "ssim", PRINTED_ONLY)
COUNTS = ("params", "steps", "rays_seen")
MOVES = ("moves_cameras", "moves_photos")
KEYS = ["method", "warping"]
TIMES = ("train", "data", "total")
DIFFERENCE = scores.with_ends("difference_")
NOTES = (
    "Costs are of all rounds and stages that lead to a row. Differences are to",
    "the same model without warping, paired by view, with 95 % bootstrap",
    "intervals; bold: the interval does not hold 0.",
)


def make_table(rows, printed=()):
    """A line per `results.Row` and test set that was scored; then `printed`."""
    lines = [line for row in rows for line in lines_of(row)]
    table = pd.DataFrame([*lines, *printed], columns=columns.names("misalignment"))
    # Whole numbers stay whole beside rows that lack them.
    return table.astype(dict.fromkeys(COUNTS, "Int64"))


def lines_of(row):
    """Lines of one method and round."""
    labels = {"method": row.method, "field": row.description, "warping": row.warping}
    labels |= {key: row.own[key] for key in MOVES}
    for test_set in TEST_SETS:
        if test_set not in row.views:
            continue
        own, other = row.views[test_set], row.base[test_set]
        if test_set in PARTIAL:
            own, other = own.dropna(how="all"), other.dropna(how="all")
        # A view without a metric leaves the mean empty rather than flatter it.
        means = {key: own[key].mean(skipna=False) for key in METRICS}
        differences_db = own["psnr_db"] - other["psnr_db"]
        yield (
            labels
            | {"test_set": test_set, "difference_to": row.baseline}
            | means
            | scores.mean_and_interval(differences_db, "difference_")
            | row.costs
        )


def published(path, scene):
    """Lines of a table of results/published that are of a scene of this name.

    Where it says neither, photos as taken are learnt from, and scored. `hours` are of
    the whole way, `params_m` millions, `size` that of the photos.
    """
    needed = ("source", "method", "scene", *PRINTED)
    table = csv_files.read(path, columns=needed)
    places = {"warping": scores.warping(0), "test_set": "standard"}
    table = table.assign(**{k: v for k, v in places.items() if k not in table})
    table = table[table["scene"] == scene]
    if table.duplicated(["method", *places]).any():
        raise ValueError(f"{path}: scene {scene}: a method stands twice")
    for row in table.to_dict("records"):
        where = f" in Table {row['table']} at {row['size']}" if "table" in row else ""
        labels = {"method": f"{row['method']}, published{where}"}
        labels |= {key: row[key] for key in ("source", *places, *PRINTED)}
        if "hours" in row:
            labels["total_time_s"] = 3600 * row["hours"]
            labels["params"] = round(1e6 * row["params_m"])
        yield labels


def to_latex(table):
    """A row per method and warping, test sets side by side.

    The best three of each column are coloured as in the paper; published rows, below a
    rule of their own, are not among them.
    """
    lines = table.drop_duplicates(KEYS)
    names = map(latex.name, lines["method"])
    labels = {"Method": names, "Warping": lines["warping"]}
    align, heads, rows = latex.side_by_side(labels, dict(groups(table, lines)))
    # A rule above what papers print.
    ours = int(lines["source"].isna().sum())
    if ours < len(rows):
        rows.insert(ours, latex.RULE)
    return latex.table(align, heads, rows, [*NOTES, *notes(table)], colours=True)


def groups(table, lines):
    """(heading, {heading below it: cells}): metrics and differences, and costs."""
    wide = table.set_index([*KEYS, "test_set"]).unstack()
    wide = wide.reindex(pd.MultiIndex.from_frame(lines[KEYS]))
    sets = [name for name in TEST_SETS if name in set(table["test_set"])]
    ours = lines["source"].isna().to_numpy()
    for key in (*METRICS, PRINTED_ONLY):
        # Papers have no other test sets.
        kept = sets if key in METRICS else ("standard", "warped")
        kept = [name for name in kept if (key, name) in wide]
        if key not in METRICS:
            kept = [name for name in kept if wide[key, name].notna().any()]
        if table[key].notna().any():
            yield (
                columns.latex(key),
                {name: metric_cells(wide[key, name], key, ours) for name in kept},
            )
    yield "PSNR gained (dB)", {name: difference_cells(wide, name) for name in sets}
    costs = {f"{key} (min)": lines[f"{key}_time_s"] / 60 for key in TIMES}
    costs["params (M)"] = lines["params"].astype(float) / 1e6
    cells = {k: [scores.shown(v, ".2f") for v in column] for k, column in costs.items()}
    yield "Cost", cells


def metric_cells(column, key, ours):
    """Numbers of a metric; the best three of ours are coloured."""
    texts = columns.shown(column, key)
    if key not in METRICS:
        return texts
    return latex.coloured(texts, column.where(ours), higher=METRICS[key])


def difference_cells(wide, test_set):
    """Differences on a test set with their intervals; none to itself."""
    own = (wide.index.get_level_values("warping") == scores.warping(0)) & (
        wide.index.get_level_values("method") == wide["difference_to", test_set]
    )
    parts = zip(own, *(wide[key, test_set] for key in DIFFERENCE), strict=True)
    return ["" if base else latex.difference(*part) for base, *part in parts]


def notes(table):
    """Which metrics are left out, and whose the published rows are."""
    lines = [
        f"No {key} column: some view or all lack it, see `note` in metrics.csv."
        for key in METRICS
        if table[key].isna().all()
    ]
    printed = table[table["source"].notna()]
    pairs = zip(printed["method"], printed["source"], strict=True)
    return [*lines, *(f"{name}: as printed, {paper}." for name, paper in pairs)]
