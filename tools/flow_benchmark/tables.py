"""The flow benchmark as CSV, LaTeX and a figure."""

from contextlib import ExitStack

import matplotlib.figure
import pandas as pd

from alignerf.io import atomic, provenance

SHARES = ["within_025", "within_050", "within_100"]
BOLD = "font-weight: bold"
# A marker for each method, filled where the blur was matched.
MARKERS = "osD^v<>pP*Xh"


def write(table, outputs, *, configs=()):
    """Write the files of `outputs` ("csv", "tex", "figure"), all of them or none.

    Beside the CSV, with them, its provenance. configs: that of the scene, if any.
    """
    origin = provenance.describe([], configs, devices=[provenance.processor()])
    outputs = outputs | {"provenance": provenance.path_beside(outputs["csv"])}
    with ExitStack() as stack:
        paths = {
            kind: stack.enter_context(atomic.replace_file(path))
            for kind, path in outputs.items()
        }
        table.to_csv(paths["csv"], index=False, float_format="%.6g")
        paths["tex"].write_text(to_latex(table))
        paths["provenance"].write_text(provenance.as_json(origin))
        draw(table).savefig(paths["figure"], dpi=150, format="png")


def to_latex(table):
    """Two booktabs tables: mean end-point errors, then shares of pixels.

    A row per method and blur matching, a column per kind of data. The least error of
    a column, and the largest share within half a pixel, are bold.
    """
    rows = table.assign(
        method=table["method"].str.replace("_", r"\_"),
        match_blur=table["match_blur"].map({False: "no", True: "yes"}),
        data=table["data"].str.replace("_", r"\_"),
    ).rename(columns={"method": "Method", "match_blur": "Blur matched"})
    order = list(dict.fromkeys(rows["data"]))
    keys = ["Method", "Blur matched"]
    wide = rows.pivot_table(
        index=keys, columns="data", values=["epe_px", *SHARES], sort=False, dropna=False
    )
    errors = wide["epe_px"].reindex(columns=order)
    errors["Mpx/s"] = rows.groupby(keys, sort=False)["mpx_per_s"].median()
    style = errors.style.format(precision=3, na_rep="--")
    style = style.highlight_min(subset=order, props=BOLD)
    first = style.to_latex(hrules=True, convert_css=True)
    second = share_style(wide.reindex(columns=order, level=1))
    return (
        "% \\usepackage{booktabs,multirow}\n"
        "% Mean end-point error in pixels; megapixels per second, median over data.\n"
        f"{first}\n% Pixels (%) within 0.25 / 0.5 / 1 px of the truth.\n"
        f"{second.to_latex(hrules=True, convert_css=True)}"
    )


def share_style(wide):
    """Cells "a / b / c", per cent within 0.25, 0.5 and 1 px, the best b bold."""
    shares = [(100 * wide[key]).round() for key in SHARES]
    best = shares[1] == shares[1].max()
    joined = shares[0].map(show)
    for share in shares[1:]:
        joined += " / " + share.map(show)
    return joined.style.apply(
        lambda column: best[column.name].map({True: BOLD, False: ""})
    )


def show(percent):
    return "--" if pd.isna(percent) else f"{percent:.0f}"


def draw(table):
    """Figure: error by kind of data, and error on renders (else all) over speed.

    A method without a number for some data has no mean: the note says why.
    """
    order = list(dict.fromkeys(table["data"]))
    figure = matplotlib.figure.Figure(figsize=(13, 6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[2, 1])
    aimed = [data for data in order if " round" in data and "overfit" not in data]
    markers = dict(zip(dict.fromkeys(table["method"]), MARKERS, strict=False))
    for number, ((method, matched), rows) in enumerate(
        table.groupby(["method", "match_blur"], sort=False)
    ):
        colour = f"C{list(markers).index(method)}"
        look = {"marker": markers[method], "color": colour, "linestyle": "none"}
        look["fillstyle"] = "full" if matched else "none"
        label = f"{method}, blur matched" if matched else method
        at = [order.index(data) + 0.03 * (number - 10) for data in rows["data"]]
        left.plot(at, rows["epe_px"], label=label, **look)
        chosen = rows[rows["data"].isin(aimed or order)]
        mean_px = chosen["epe_px"].mean(skipna=False)
        right.plot(chosen["mpx_per_s"].median(), mean_px, **look)
    left.set_xticks(range(len(order)), order, rotation=60, ha="right", fontsize=8)
    left.set(yscale="log", ylabel="mean end-point error (px)")
    left.legend(fontsize=6, ncols=3)
    what = "renders of trained models" if aimed else "all data"
    right.set(xscale="log", xlabel="megapixels per second")
    right.set_ylabel(f"mean end-point error (px), {what}")
    for axis in (left, right):
        axis.grid(alpha=0.3)
    return figure
