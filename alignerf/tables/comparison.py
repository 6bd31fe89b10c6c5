"""The paper's Tables 2 and 3: `python -m alignerf.tables.comparison`.

Reads the scores of all that was trained, or given as renders, on all scenes; writes CSV
and LaTeX. Means are over scenes, and the CSV has each scene's own lines below; scenes
that were trained for another share of the steps are a group of their own (the paper's
1x and 4x). Differences are paired by view; 95 % intervals are over scenes, seeds and
views. What the paper prints for a method stands below ours, or at the end where no
method is called so, and is compared with nothing. Also writes whether test sets rank
the methods alike, which the paper's Table 2 claims.
"""

import itertools

import numpy as np
import pandas as pd

from alignerf.experiment.tables import regimes as regime_rows
from alignerf.experiment.tables import rows as table_rows
from alignerf.files import atomic, csv_files, faults
from alignerf.tables import files as table_files
from alignerf.tables import intervals, misalignment, ranking, scores

TEST_SETS = ("standard", "warped", "control", "oracle", "aligned_pose")
# Of these the LaTeX table shows what the paper's does.
PRINTED_SETS = ("standard", "warped")
METRICS = misalignment.METRICS
PRINTED = misalignment.PRINTED
# The largest resident set of the training's process; not of an accelerator.
MEMORY = "memory_mib"
COSTS = ("train_time_s", "total_time_s", "rays_seen", "params", MEMORY)
# In column `scene`: means over all.
ALL = "all"
COLUMNS = (
    *("group", "scene", "method", "field", "warping", "test_set", "scenes", "views"),
    *METRICS,
    misalignment.PRINTED_ONLY,
    *("difference_to", "difference_db", "difference_low_db", "difference_high_db"),
    *COSTS,
    # The paper of a published row, and what is known of how it came about.
    *("source", "origin"),
)
RANKING_COLUMNS = ("group", "test_set", "beside", "tau", "tau_low", "tau_high", "rows")


def main(argv=None):
    parser = table_files.parser(__doc__)
    parser.add_argument("--ranking", required=True, help="CSV, written")
    parser.add_argument("--published", help="CSV of what papers print")
    parser.add_argument("--published-table", type=int, help="which of its tables")
    args = parser.parse_args(argv)
    scenes = table_rows.read(regime_rows.Comparison, args.rows)
    printed = printed_lines(args.published, args.published_table)
    table, ranks = make_table(scenes, printed), make_ranking(scenes)
    with atomic.replace_file(args.ranking) as path:
        ranks.to_csv(path, index=False, float_format="%.6g")
        table_files.write(table, to_latex, rows=scenes, **table_files.places(args))


def groups_of(scenes):
    """{group's name: its scenes}: those trained for one share of the steps."""
    found = {}
    for scene in sorted(scenes, key=lambda scene: scene.share):
        found.setdefault(f"{scene.share:g}x", []).append(scene)
    return found


def make_table(scenes, printed=()):
    """Lines of `regimes.Comparison` rows, each with what is printed for it below."""
    lines = []
    for name, group in groups_of(scenes).items():
        left = [line | {"scene": ALL} for line in printed if line["group"] == name]
        for key in shared_methods(group):
            lines += lines_of({"group": name, "scene": ALL}, group, key)
            called = method_of(group[0], key).published
            lines += [line for line in left if line["called"] == called]
            left = [line for line in left if line["called"] != called]
        # What others run: ours can only be set beside it.
        lines += left
        lines += lines_by_scene(name, group)
    table = pd.DataFrame(lines, columns=COLUMNS)
    whole_numbers = ("scenes", "views", "rays_seen", "params")
    return table.astype(dict.fromkeys(whole_numbers, "Int64"))


def lines_by_scene(name, group):
    """Lines of each scene, its seeds together, where a group has several scenes."""
    found = {}
    for scene in group:
        found.setdefault(scene.alike, []).append(scene)
    if len(found) == 1:
        return
    for seeds in found.values():
        labels = {"group": name, "scene": seeds[0].scene}
        for key in shared_methods(seeds):
            yield from lines_of(labels, seeds, key)


def shared_methods(group):
    """(method, round) that all scenes have: with `rounds: auto` some have more."""
    found = [[(m.method, m.round) for m in scene.methods] for scene in group]
    shared = set.intersection(*map(set, found))
    return [key for key in found[0] if key in shared]


def method_of(scene, key):
    """A scene's method at a round."""
    return next(m for m in scene.methods if (m.method, m.round) == key)


def views_of(scene, key):
    """Scores of a scene's method: (test set, metric) columns, a row a view."""
    method = method_of(scene, key)
    return scores.read(method.metrics, METRICS, method.aligned_pose)


def lines_of(labels, scenes, key):
    """Lines of one method, a test set each; labels: of all of them."""
    method = method_of(scenes[0], key)
    own = [views_of(scene, key) for scene in scenes]
    base = [views_of(scene, (method.base, 0)) for scene in scenes]
    labels = labels | {"method": method.method, "field": method.parts}
    labels |= {"warping": scores.warping(method.round), "scenes": len(scenes)}
    labels |= mean_costs([method_of(scene, key) for scene in scenes])
    for test_set in TEST_SETS:
        if not all(test_set in views for views in own):
            continue
        found = [views[test_set] for views in own]
        line = labels | {"test_set": test_set, "views": sum(map(len, found))}
        for metric in METRICS:
            # Of scenes alike, however many views each has; one that lacks it, none has.
            means = [views[metric].mean(skipna=False) for views in found]
            line[metric] = np.mean(means)
        if all(test_set in views for views in base):
            pairs = zip(found, base, strict=True)
            gains = [
                (v["psnr_db"] - b[test_set]["psnr_db"]).to_numpy() for v, b in pairs
            ]
            line |= scores.pooled_mean_and_interval(gains, "difference_")
            line["difference_to"] = method.base
        yield line


def mean_costs(methods):
    """Means over scenes of what a method took; nothing of renders that are given."""
    if not methods[0].trainings:
        return {}
    costs = [table_files.costs_of(method) for method in methods]
    found = {
        key: np.mean([cost[key] for cost in costs]) for key in COSTS if key != MEMORY
    }
    found |= {key: round(found[key]) for key in ("rays_seen", "params")}
    return found | {MEMORY: np.mean([memory_mib(m.process) for m in methods])}


def memory_mib(path):
    """MiB of the training's process, from Snakemake's benchmark."""
    found = csv_files.read(path, sep="\t", columns=["max_rss"])
    return pd.to_numeric(found["max_rss"], errors="coerce").max()


def printed_lines(path, number):
    """Lines of a table of the paper; `called` is what it calls the method."""
    if not path or number is None:
        return []
    columns = ("source", "table", "group", "method", "test_set", "hours", "params_m")
    table = csv_files.read(path, columns=(*columns, *PRINTED, "origin"))
    lines = []
    for row in table[table["table"] == number].to_dict("records"):
        params = row["params_m"]
        lines.append(
            {
                "called": row["method"],
                "method": f"{row['method']}, published",
                "total_time_s": 3600 * row["hours"],
                "params": pd.NA if pd.isna(params) else round(1e6 * params),
                "warping": scores.warping(0),
                **{
                    k: row[k]
                    for k in ("group", "test_set", "source", "origin", *PRINTED)
                },
            }
        )
    return lines


def make_ranking(scenes):
    """Kendall's tau-b between test sets, of all methods of a group, with intervals.

    Of each pair of sets, the methods that have both on all scenes: renders that are
    given have fewer. Means are over the scenes' views, all pooled, and so are the
    draws of the intervals.
    """
    lines = []
    for name, group in groups_of(scenes).items():
        methods = [pooled_psnr(group, key) for key in shared_methods(group)]
        for first, second in itertools.combinations(TEST_SETS, 2):
            both = [sets for sets in methods if first in sets and second in sets]
            if len(both) > 1:
                pair = (
                    np.stack([sets[key] for sets in both]) for key in (first, second)
                )
                lines.append((name, first, second, *tau_of(*pair), len(both)))
    return pd.DataFrame(lines, columns=RANKING_COLUMNS)


def pooled_psnr(group, key):
    """{test set: PSNR in dB [views of all scenes]} of a method; sets that all have."""
    views = [views_of(scene, key) for scene in group]
    return {
        test_set: np.concatenate([v[test_set]["psnr_db"].to_numpy() for v in views])
        for test_set in TEST_SETS
        if all(test_set in v for v in views)
    }


def tau_of(first, second):
    """(tau-b, low, high) of two scores [methods, views]."""
    count = first.shape[1]
    tau = ranking.tau_b(first.mean(axis=1), second.mean(axis=1))
    if count < 2 or not np.isfinite(tau):
        return tau, np.nan, np.nan
    drawn = [
        ranking.tau_b(first[:, draw].mean(axis=1), second[:, draw].mean(axis=1))
        for draw in intervals.resamples(count, draws=ranking.DRAWS)
    ]
    # A draw in which all methods tie has no rank.
    kept = [value for value in drawn if np.isfinite(value)]
    return (tau, *intervals.from_draws(kept, count))


def to_latex(table):
    """booktabs table of the means: a block a group, standard and warped side by side.

    The best three of each column among ours are coloured as in the paper; published
    rows are grey. Needs booktabs and xcolor with its `table` option.
    """
    table = table[table["scene"] == ALL]
    sets = [name for name in PRINTED_SETS if name in set(table["test_set"])]
    metrics = [
        key for key in (*METRICS, misalignment.PRINTED_ONLY) if table[key].notna().any()
    ]
    lines = []
    for group, of_group in table.groupby("group", sort=False):
        columns = 1 + len(sets) * (len(metrics) + 1) + 2
        lines.append(rf"\multicolumn{{{columns}}}{{l}}{{\emph{{{group}}}}} \\")
        keys = ["method", "warping"]
        rows = list(of_group.groupby(keys, sort=False))
        best = {
            (name, key): places(of_group, name, key) for name in sets for key in metrics
        }
        for (method, warping), own in rows:
            lines.append(latex_row(method, warping, own, sets, metrics, best))
        lines.append(r"\midrule")
    heads = [HEADS[key] for key in metrics] + ["gain (dB)"]
    spans = "".join(
        rf" & \multicolumn{{{len(heads)}}}{{c}}{{{scores.latex_name(name)}}}"
        for name in sets
    )
    return "\n".join(
        [
            "% \\usepackage{booktabs} \\usepackage[table]{xcolor}",
            "% Means over scenes. Gains are in PSNR over the method that a row is set",
            "% against, paired by view; 95 % intervals; bold: 0 is outside. Published",
            "% rows are as printed: their LPIPS is of a network that is not released,",
            "% their minutes are of 32 cores of a TPU v2.",
            rf"\begin{{tabular}}{{l{'r' * (len(sets) * len(heads) + 2)}}}",
            r"\toprule",
            rf"Method{spans} & min & params (M) \\",
            " & ".join(["", *heads * len(sets), "", ""]) + r" \\",
            r"\midrule",
            *lines[:-1],
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )


HEADS = {
    "psnr_db": "PSNR",
    "ssim": "SSIM",
    "lpips_alex": "LPIPS alex",
    "lpips_squeeze": "squeeze",
    "lpips_vgg": "vgg",
    "lpips_published": "LPIPS publ.",
}


def places(of_group, test_set, metric):
    """{(method, warping): 1, 2 or 3} of the best three of ours in a column."""
    ours = of_group[of_group["source"].isna() & (of_group["test_set"] == test_set)]
    column = ours.set_index(["method", "warping"])[metric].dropna()
    ranks = column.rank(ascending=not METRICS.get(metric, False), method="min")
    return {key: int(rank) for key, rank in ranks.items() if rank <= 3}


def latex_row(method, warping, own, sets, metrics, best):
    """One method's line."""
    name = scores.latex_name(scores.row_name(method, warping))
    published = own["source"].notna().any()
    cells = [rf"\textcolor{{gray}}{{{name}}}" if published else name]
    by_set = own.set_index("test_set")
    for test_set in sets:
        if test_set not in by_set.index:
            cells += ["--"] * (len(metrics) + 1)
            continue
        row = by_set.loc[test_set]
        for key in metrics:
            text = scores.shown(row[key], ".2f" if key == "psnr_db" else ".3f")
            place = best[test_set, key].get((method, warping))
            colour = misalignment.COLOURS[place - 1][1:] if place else None
            cells.append(rf"\cellcolor[HTML]{{{colour}}}{text}" if colour else text)
        ends = [row[f"difference{end}_db"] for end in ("", "_low", "_high")]
        cells.append(
            "" if row["difference_to"] == method else scores.latex_difference(*ends)
        )
    first = own.iloc[0]
    cells.append(scores.shown(first["total_time_s"] / 60, ".1f"))
    params = first["params"]
    cells.append("--" if pd.isna(params) else f"{params / 1e6:.2f}")
    return " & ".join(cells) + r" \\"


if __name__ == "__main__":
    faults.run(main)
