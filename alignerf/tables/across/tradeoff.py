"""What each method costs and brings: `python -m alignerf.tables.across.tradeoff`.

A line has a capture, a length of training and a method after its last warping; scenes
that differ in seed only are pooled. Scores are means over views against the oracle
where it is known, else against the photos. Differences are to the reference method's
round 0, trained as long as the config says; 95 % intervals are over views and, where
there are several, seeds. Writes CSV, LaTeX and a figure.
"""

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.files import atomic, faults
from alignerf.tables import columns, latex, scores
from alignerf.tables import files as table_files
from alignerf.tables.plots import costs as costs_plot

NOTES = (
    "PSNR in dB and its difference to the reference's training of length 1, paired by",
    "view; 95 % intervals. Bold: on the Pareto front of total seconds and PSNR.",
)


def main(argv=None):
    parser = table_files.across(__doc__)
    parser.add_argument("--figure", required=True, help="PNG, written")
    args = parser.parse_args(argv)
    scenes = table_files.read(args, "comparison")
    table = make_table(scenes)
    with atomic.replace_file(args.figure) as path:
        costs_plot.draw(table, path)
        table_files.write_across(table, to_latex, scenes, args)


def make_table(scenes):
    """Lines of `files.Scored`s, capture by capture, from short to long."""
    captures = {}
    for one in sorted(scenes, key=lambda one: one.scene.share):
        lengths = captures.setdefault(one.scene.alike, {})
        lengths.setdefault(one.scene.share, []).append(one)
    lines = [line for lengths in captures.values() for line in lines_of(lengths)]
    return pd.DataFrame(lines, columns=columns.names("tradeoff"))


def lines_of(lengths):
    """Lines of one capture: {length: its scenes, of a seed each}."""
    whole = lengths.get(1) or next(iter(lengths.values()))
    reference = whole[0].scene.reference
    base = {one.scene.seed: one.row((reference, 0)).psnr_db() for one in whole}
    test_set = testsets.fairest(set.intersection(*(set(one) for one in base.values())))
    lines = []
    for length, group in lengths.items():
        for key in table_files.shared_rows(group):
            rows = [one.row(key) for one in group]
            if not rows[0].costs or any(test_set not in row.views for row in rows):
                continue
            own = [row.psnr_db()[test_set] for row in rows]
            gains = [
                (psnr_db - base[one.scene.seed][test_set]).to_numpy()
                for one, psnr_db in zip(group, own, strict=True)
                if one.scene.seed in base
            ]
            line = {"condition": whole[0].scene.scene, "length": length}
            line |= {"method": rows[0].method, "warping": rows[0].warping}
            line |= {"field": rows[0].description, "test_set": test_set}
            for cost in ("params", "rays_seen", "train_time_s", "total_time_s"):
                line[cost] = np.mean([row.costs[cost] for row in rows])
            line |= scores.pooled_mean_and_interval(
                [one.to_numpy() for one in own], "psnr_"
            )
            line |= scores.pooled_mean_and_interval(gains, "difference_")
            line |= {"seeds": len(rows), "views": sum(map(len, own))}
            lines.append(line)
    found = pd.DataFrame(lines)
    found["pareto"] = pareto_front(found["total_time_s"], found["psnr_db"])
    return found.to_dict("records")


def pareto_front(costs, scores):
    """[n] bool: nothing is as cheap and as good, and better in one of the two.

    Equal points are both on the front; one that is not finite never is.
    """
    costs, scores = np.asarray(costs, np.float64), np.asarray(scores, np.float64)
    known = np.isfinite(costs) & np.isfinite(scores)
    no_worse = (costs[:, None] <= costs) & (scores[:, None] >= scores)
    better = (costs[:, None] < costs) | (scores[:, None] > scores)
    return known & ~(no_worse & better & known[:, None]).any(axis=0)


def to_latex(table):
    """A row per capture, method and length."""
    heads = [
        "Method",
        "Length",
        "Total (s)",
        "Params (M)",
        "PSNR (dB)",
        "Difference (dB)",
    ]
    blocks = []
    for condition, lines in table.groupby("condition", sort=False):
        block = [[latex.Span(rf"\emph{{{latex.name(condition)}}}", len(heads), "l")]]
        names = scores.short_names(lines["method"], lines["warping"])
        for name, line in zip(names, lines.itertuples(), strict=True):
            text = latex.name(name)
            difference = (
                line.difference_db,
                line.difference_low_db,
                line.difference_high_db,
            )
            block.append(
                [
                    rf"\textbf{{{text}}}" if line.pareto else text,
                    f"{line.length:g}x",
                    scores.shown(line.total_time_s, ".1f"),
                    scores.shown(line.params / 1e6, ".2f"),
                    scores.with_interval(
                        line.psnr_db, line.psnr_low_db, line.psnr_high_db
                    ),
                    latex.difference(*difference),
                ]
            )
        blocks.append(block)
    return latex.table("lrrrll", [heads], latex.blocks(blocks), NOTES)


if __name__ == "__main__":
    faults.run(main)
