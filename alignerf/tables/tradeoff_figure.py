"""The figure of a sweep: seconds against decibels, and each variant against the base.

Left the means and the Pareto front; their intervals hold how unlike the views are,
which all variants share. Right the paired differences, from which to judge.
Boxes are [x0, y0, x1, y1] in pixels of the figure.
"""

import itertools

import matplotlib.backends.backend_agg
import matplotlib.figure
import matplotlib.ticker
import numpy as np

# Okabe and Ito's palette, which colour-blind readers tell apart, and two more.
COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"),
    *("#8C564B", "#7F7F7F", "#999933"),
)
MARKERS = "osD^vP<>X"
TITLES = {
    "log2_entries": "table size",
    "samples": "samples a ray",
    "width": "channels",
    "kind": "kind of field",
    "downscale": "image scale",
    "seed": "seed only",
    "several": "several at once",
}
SMALL_PT = 7.5
LABEL_PT = 9
RADIUS_PT = 4.0
SIDES = [*((1, 0), (-1, 0), (0, 1), (0, -1)), *itertools.product((1, -1), repeat=2)]


def draw(table, path):
    """Write the figure of `alignerf.tables.tradeoff`'s table, with a column `kind`."""
    known = table.dropna(subset=["train_time_s", "psnr_db"])
    if known.empty:
        raise ValueError("figure: no variant has a PSNR in every view")
    kinds = dict.fromkeys(known["kind"])
    looks = zip(itertools.cycle(COLOURS), itertools.cycle(MARKERS), strict=False)
    styles = dict(zip(kinds, looks, strict=False))
    figure = matplotlib.figure.Figure(figsize=(11, 5), dpi=200, layout="constrained")
    canvas = matplotlib.backends.backend_agg.FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=[1.6, 1])
    draw_costs(left, known, styles)
    draw_differences(right, known, styles)
    # Where a name finds room depends on the layout of all else.
    figure.draw_without_rendering()
    name_points(left, known, canvas.get_renderer())
    figure.savefig(path)


def draw_costs(axes, table, styles):
    """Training seconds against PSNR, with intervals and the Pareto front."""
    # What a budget of seconds buys: nothing more until the next point's seconds.
    axes.step(
        *front_of(table).T,
        where="post",
        color="0.35",
        linewidth=1,
        label="Pareto front",
        zorder=1,
    )
    for kind, (colour, marker) in styles.items():
        points = table[table["kind"] == kind]
        x, y = points["train_time_s"], points["psnr_db"]
        low, high = points["psnr_low_db"], points["psnr_high_db"]
        axes.vlines(x, low, high, color=colour, linewidth=0.7, alpha=0.35, zorder=0)
        axes.scatter(
            *(x, y),
            c=colour,
            marker=marker,
            s=(2 * RADIUS_PT) ** 2 / 2,
            edgecolors=np.where(points["pareto"], "black", "white"),
            linewidths=np.where(points["pareto"], 1.1, 0.6),
            label=TITLES.get(kind, kind),
            zorder=3,
        )
    axes.set_xscale("log")
    axes.margins(x=0.12)
    label_costs(axes, table["test_set"].iloc[0])


def label_costs(axes, test_set):
    """What the axes show, in which units."""
    axes.xaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    axes.set_xlabel("training time (s, without compilation)", fontsize=LABEL_PT)
    axes.set_ylabel(
        f"PSNR, {test_set} test views (dB, mean and 95 % interval)", fontsize=LABEL_PT
    )
    axes.tick_params(labelsize=LABEL_PT)
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.legend(loc="lower right", fontsize=SMALL_PT, framealpha=0.9)


def draw_differences(axes, table, styles):
    """Paired differences to the base, the best on top."""
    order = table.sort_values("difference_db")
    places = np.arange(len(order))
    colours, markers = zip(*(styles[kind] for kind in order["kind"]), strict=True)
    low, high = order["difference_low_db"], order["difference_high_db"]
    axes.axvline(0, color="0.35", linewidth=0.8)
    axes.hlines(places, low, high, color=colours, linewidth=1.2)
    for place, x in zip(places, order["difference_db"], strict=True):
        axes.scatter(x, place, c=colours[place], marker=markers[place], s=26, zorder=3)
    axes.set_yticks(places, order["variant"].str.replace("_", " "))
    for label, on_front in zip(axes.get_yticklabels(), order["pareto"], strict=True):
        label.set_fontweight("bold" if on_front else "normal")
    axes.set_xlabel("difference to base (dB, paired, 95 % interval)", fontsize=LABEL_PT)
    axes.tick_params(labelsize=LABEL_PT)
    axes.tick_params(axis="y", labelsize=SMALL_PT, length=0)
    axes.grid(axis="x", color="0.92", linewidth=0.6)


def front_of(table):
    """(seconds, dB) [n, 2] of the Pareto front, from cheap to dear."""
    front = table[table["pareto"]].sort_values("train_time_s")
    return front[["train_time_s", "psnr_db"]].to_numpy()


def name_points(axes, table, renderer):
    """Write each name near its point, where it covers least; the front's go first."""
    # A leader that widened the axes would move all that has its place.
    axes.set_autoscale_on(False)
    pixel = axes.figure.dpi / 72
    points = axes.transData.transform(table[["train_time_s", "psnr_db"]].to_numpy())
    # So near to another point a name would seem to be that one's.
    radius = 2 * RADIUS_PT * pixel
    marks = [np.concatenate([p - radius, p + radius]) for p in points]
    taken = [axes.get_legend().get_window_extent(renderer).extents]
    taken += line_boxes(axes.transData.transform(front_of(table)), 2 * pixel)
    inside = axes.get_window_extent(renderer).extents
    back = axes.transData.inverted()
    order = np.argsort(~table["pareto"].to_numpy(), kind="stable")
    for own, row in zip(order, table.iloc[order].itertuples(), strict=True):
        point, others = points[own], marks[:own] + marks[own + 1 :]
        text = axes.annotate(
            row.variant.replace("_", " "),
            back.transform(point),
            fontsize=SMALL_PT,
            fontweight="bold" if row.pareto else "normal",
            color="black" if row.pareto else "0.3",
            verticalalignment="bottom",
            in_layout=False,
        )
        extent = text.get_window_extent(renderer)
        size = extent.size + 2 * pixel
        far, best = place_name(point, size, others + taken, inside, pixel)
        taken.append(best)
        text.set_position(back.transform(best[:2] + pixel))
        if far:
            nearest = np.clip(point, best[:2], best[2:])
            ends = back.transform([point, nearest])
            axes.plot(*ends.T, color="0.6", linewidth=0.5, zorder=2)


def line_boxes(corners, width):
    """Boxes around a staircase through these corners [n, 2], right then up."""
    turns = np.stack([corners[1:, 0], corners[:-1, 1]], axis=-1)
    ends = [
        *zip(corners[:-1], turns, strict=True),
        *zip(turns, corners[1:], strict=True),
    ]
    return [np.concatenate([a - width, b + width]) for a, b in ends]


def place_name(point, size, taken, inside, pixel):
    """(cost of being far, box) of the place that costs and covers least."""
    found = candidates(point, size, pixel)
    return min(found, key=lambda place: place[0] + covered(place[1], taken, inside))


def candidates(point, size, pixel):
    """(cost of being far, box) of boxes [2] around a point, from near to far."""
    for step, side in itertools.product(range(7), SIDES):
        gap = (RADIUS_PT + 2 + 5 * step) * pixel
        centre = point + np.array(side) * (gap + size / 2)
        yield (
            20 * step * pixel**2,
            np.concatenate([centre - size / 2, centre + size / 2]),
        )


def covered(box, taken, inside):
    """Area in square pixels that a box shares with others; outside counts tenfold."""
    shared = [intersection(box, other) for other in taken]
    return sum(shared) + 10 * (intersection(box, box) - intersection(box, inside))


def intersection(a, b):
    """Area that two boxes share."""
    sides = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
    return np.prod(np.maximum(sides, 0.0))
