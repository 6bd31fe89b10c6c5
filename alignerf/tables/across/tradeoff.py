"""What each method costs and brings: `python -m alignerf.tables.across.tradeoff`.

A line has a condition (scenes that differ in seed and length only), a length of
training, and a method after a round; seeds are pooled. Scores are against the oracle
where it is known, else against the photos. Differences are to the reference method's
round 0, trained as long as the config says; 95 % intervals are over views and, where
there are several, seeds. Writes CSV, LaTeX and a figure.
"""

from alignerf.io import atomic, faults
from alignerf.tables import costs, frame, latex, plots, scores

NOTES = (
    "PSNR in dB and its difference to the reference's training of length 1, paired by",
    "view; 95 % intervals. Bold: on the Pareto front of total seconds and PSNR.",
)


def main(argv=None):
    args = faults.arguments(argv, __doc__, frame.OPTIONS | frame.FIGURE)
    views = frame.read_scenes(args, "comparison")
    table = costs.points(views)
    with atomic.replace_file(args.figure) as path:
        plots.costs(table, path)
        frame.write_across(table, to_latex, views, args)


def to_latex(table):
    """A row per condition, method and length; what is on the Pareto front is bold."""
    names = map(latex.name, scores.short_names(table["method"], table["warping"]))
    pairs = zip(names, table["pareto"], strict=True)
    return latex.of_lines(
        table,
        {
            "Condition": list(map(latex.name, table["condition"])),
            "Length": list(map(scores.length, table["length"])),
            "Method": [rf"\textbf{{{n}}}" if front else n for n, front in pairs],
        },
        [],
        fixed=[
            ("total_time_s", "total (s)", ".1f"),
            ("params", "params (M)", "M"),
            ("psnr_db", "PSNR (dB)", ".2f"),
            ("difference_db", "difference (dB)", "interval"),
        ],
        notes=NOTES,
    )


if __name__ == "__main__":
    faults.run(main)
