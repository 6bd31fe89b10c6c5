"""The paper's Tables 2 and 3: `python -m alignerf.tables.across.comparison`.

Of all that was trained, or given as renders, on all scenes; writes CSV and LaTeX. Means
are over scenes, and the CSV has each scene's own lines below; scenes that were trained
for another share of the steps are a group of their own (the paper's 1x and 4x).
Differences are paired by view; 95 % intervals are over scenes, seeds and views. What
the paper prints for a method stands below ours, or at the end where no method is called
so, and is compared with nothing. Also writes whether test sets rank the methods alike,
which the paper's Table 2 claims.
"""

import itertools

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.files import atomic, csv_files, faults
from alignerf.tables import columns, latex, misalignment, ranking, scores
from alignerf.tables import files as table_files
from alignerf.tables.columns import METRICS, PRINTED_ONLY

TEST_SETS = testsets.shown_in("comparison")
# Of these the LaTeX table shows what the paper's does.
PRINTED_SETS = ("standard", "warped")
PRINTED = misalignment.PRINTED
COSTS = ("train_time_s", "total_time_s", "rays_seen", "params")
# In column `scene`: means over all.
ALL = "all"
NOTES = (
    "Means over scenes. Gains are in PSNR over the method that a row is set",
    "against, paired by view; 95 % intervals; bold: 0 is outside. Published",
    "rows are as printed: their LPIPS is of a network that is not released,",
    "their minutes are of 32 cores of a TPU v2.",
)


def main(argv=None):
    parser = table_files.across(__doc__)
    parser.add_argument("--ranking", required=True, help="CSV, written")
    parser.add_argument("--published", help="CSV of what papers print")
    parser.add_argument("--published-table", type=int, help="which of its tables")
    args = parser.parse_args(argv)
    scenes = table_files.read(args, "comparison")
    printed = printed_lines(args.published, args.published_table)
    table, ranks = make_table(scenes, printed), make_ranking(scenes)
    with atomic.replace_file(args.ranking) as path:
        ranks.to_csv(path, index=False, float_format="%.6g")
        table_files.write_across(table, to_latex, scenes, args)


def groups_of(scenes):
    """{group's name: its scenes}: those trained for one share of the steps."""
    groups = {}
    for one in sorted(scenes, key=lambda one: one.scene.share):
        groups.setdefault(f"{one.scene.share:g}x", []).append(one)
    return groups


def make_table(scenes, printed=()):
    """Lines of `files.Scored`, each with what is printed for it below."""
    lines = []
    for name, group in groups_of(scenes).items():
        left = [line | {"scene": ALL} for line in printed if line["group"] == name]
        for key in table_files.shared_rows(group):
            lines += lines_of({"group": name, "scene": ALL}, group, key)
            called = group[0].row(key).published
            lines += [line for line in left if line["called"] == called]
            left = [line for line in left if line["called"] != called]
        # What others run: ours can only be set beside it.
        lines += left
        lines += lines_by_scene(name, group)
    table = pd.DataFrame(lines, columns=columns.names("comparison"))
    whole_numbers = ("scenes", "views", "rays_seen", "params")
    return table.astype(dict.fromkeys(whole_numbers, "Int64"))


def lines_by_scene(name, group):
    """Lines of each scene, its seeds together, where a group has several scenes."""
    alike = {}
    for one in group:
        alike.setdefault(one.scene.alike, []).append(one)
    if len(alike) == 1:
        return
    for seeds in alike.values():
        labels = {"group": name, "scene": seeds[0].scene.scene}
        for key in table_files.shared_rows(seeds):
            yield from lines_of(labels, seeds, key)


def lines_of(labels, scenes, key):
    """Lines of one method, a test set each; labels: of all of them."""
    rows = [one.row(key) for one in scenes]
    reference = scenes[0].scene.reference
    base = [one.row((reference, 0)).views for one in scenes]
    labels = labels | {"method": rows[0].method, "field": rows[0].description}
    labels |= {"warping": rows[0].warping, "scenes": len(scenes)} | mean_costs(rows)
    for test_set in TEST_SETS:
        if not all(test_set in row.views for row in rows):
            continue
        own = [row.views[test_set] for row in rows]
        line = labels | {"test_set": test_set, "views": sum(map(len, own))}
        for metric in METRICS:
            # Of scenes alike, however many views each has; one that lacks it, none has.
            line[metric] = np.mean([views[metric].mean(skipna=False) for views in own])
        if all(test_set in views for views in base):
            pairs = zip(own, base, strict=True)
            gains = [
                (v["psnr_db"] - b[test_set]["psnr_db"]).to_numpy() for v, b in pairs
            ]
            line |= scores.pooled_mean_and_interval(gains, "difference_")
            line["difference_to"] = reference
        yield line


def mean_costs(rows):
    """Means over scenes of what a method took; nothing of renders that are given."""
    if not rows[0].costs:
        return {}
    means = {key: np.mean([row.costs[key] for row in rows]) for key in COSTS}
    counts = {key: means[key] for key in ("rays_seen", "params")}
    means |= {k: v if np.isnan(v) else round(v) for k, v in counts.items()}
    return means | {"memory_mib": np.mean([row.own["memory_mib"] for row in rows])}


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
        methods = [pooled_psnr(group, key) for key in table_files.shared_rows(group)]
        for first, second in itertools.combinations(TEST_SETS, 2):
            both = [sets for sets in methods if first in sets and second in sets]
            if len(both) > 1:
                pair = (
                    np.stack([sets[key] for sets in both]) for key in (first, second)
                )
                tau = ranking.tau_of(*pair)
                lines.append((name, first, second, *tau, len(both)))
    return pd.DataFrame(lines, columns=columns.names("comparison_ranking"))


def pooled_psnr(group, key):
    """{test set: PSNR in dB [views of all scenes]} of a method; sets that all have."""
    views = [one.row(key).psnr_db() for one in group]
    return {
        test_set: np.concatenate([v[test_set].to_numpy() for v in views])
        for test_set in TEST_SETS
        if all(test_set in v for v in views)
    }


def to_latex(table):
    """The means: a block a group, standard and warped side by side.

    The best three of each column among ours are coloured as in the paper; published
    rows are grey.
    """
    table = table[table["scene"] == ALL]
    sets = [name for name in PRINTED_SETS if name in set(table["test_set"])]
    metrics = [key for key in (*METRICS, PRINTED_ONLY) if table[key].notna().any()]
    span = len(metrics) + 1
    blocks = [
        [
            [latex.Span(rf"\emph{{{group}}}", 3 + len(sets) * span, "l")],
            *rows_of(own, sets, metrics),
        ]
        for group, own in table.groupby("group", sort=False)
    ]
    titles = [latex.Span(latex.name(name), span) for name in sets]
    names = [columns.latex(key) for key in metrics] + ["gain (dB)"]
    heads = [["Method", *titles, "min", "params (M)"], ["", *names * len(sets), "", ""]]
    align = f"l{'r' * (len(sets) * span + 2)}"
    return latex.table(align, heads, latex.blocks(blocks), NOTES, colours=True)


def rows_of(table, sets, metrics):
    """The rows of one group."""
    keys = ["method", "warping"]
    lines = table.drop_duplicates(keys).set_index(keys)
    published = lines["source"].notna()
    names = [latex.name(scores.row_name(*key)) for key in lines.index]
    names = [
        rf"\textcolor{{gray}}{{{name}}}" if printed else name
        for name, printed in zip(names, published, strict=True)
    ]
    body = [names]
    for test_set in sets:
        of_set = table[table["test_set"] == test_set].set_index(keys)
        of_set = of_set.reindex(lines.index)
        for key in metrics:
            texts, ours = columns.shown(of_set[key], key), of_set[key].mask(published)
            body.append(latex.coloured(texts, ours, higher=METRICS.get(key, False)))
        gains = of_set[["difference_to", *misalignment.DIFFERENCE]].itertuples()
        body.append(
            [
                "" if to == method else latex.difference(*ends)
                for (method, _), to, *ends in gains
            ]
        )
    body.append([scores.shown(s / 60, ".1f") for s in lines["total_time_s"]])
    body.append([scores.shown(n / 1e6, ".2f") for n in lines["params"]])
    return latex.rows_of(body)


if __name__ == "__main__":
    faults.run(main)
