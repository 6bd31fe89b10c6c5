"""Make the tables of the pages: `python -m tools.docs.tables [--check]`.

A page says `<!-- table: NAME -->`, and `<!-- end -->` below it. What is between them is
written anew from docs/measured/NAME.csv, as NAME says in docs/measured/tables.yaml.
`<!-- list: test_sets -->` lists the program's test sets; `<!-- output: NAME -->` quotes
docs/outputs/NAME.txt, a text that the program has printed.
alignerf/page/accuracy.yaml follows docs/measured/verdicts_heldout.csv or, until those
captures were looked at, verdicts.csv.
--check writes nothing: it names each page and table that differ, and exits with 1.
"""

import argparse
import functools
import re
import string
import sys
import textwrap
from pathlib import Path

import pandas as pd
import yaml

from alignerf import testsets

MEASURED = "docs/measured"
# What the program itself tells of them.
ACCURACY = "alignerf/page/accuracy.yaml"
KINDS = "table|list|output"
MARK = re.compile(rf"(<!-- ({KINDS}): ([\w.]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
# Of a quoted line, in characters.
WIDTH = 106
# What each CSV says of itself, in this order, before its columns.
HEADER = ("commit", "lock", "machine", "command", "measured")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", default=".", type=Path, help="the project's folder")
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    args = parser.parse_args(argv)
    different = False
    for page in pages(args.root):
        text = page.read_text()
        made, changed = filled(text, args.root)
        for name in changed if args.check else ():
            print(f"{page.relative_to(args.root)}: table {name} is not as its CSV says")
        different |= bool(changed)
        if changed and not args.check:
            page.write_text(made)
    if (path := args.root / ACCURACY).read_text() != (text := accuracy(args.root)):
        different = True
        if args.check:
            print(f"{ACCURACY} is not as the CSVs of verdicts say")
        else:
            path.write_text(text)
    return int(args.check and different)


def verdicts(root):
    """How often verdicts on renders were right, by capture: the held-out ones."""
    table = pd.read_csv(root / MEASURED / "verdicts_heldout.csv", comment="#")
    table = table[table["role"] == "held out"]
    if table["first"].isna().all():  # there was no look yet
        table = pd.read_csv(root / MEASURED / "verdicts.csv", comment="#")
    table = table[(table["read_as"] == "its renders") & (table["first_of"] > 0)]
    table = table.set_index("capture")
    return table.astype({"first": int, "first_of": int})


def accuracy(root):
    """How often verdicts on renders were right, as the page tells it."""
    table = verdicts(root)
    lines = [
        f"  {row.Index}: [{row.first}, {row.first_of}]"
        for row in table.drop("all").itertuples()
    ]
    return "\n".join(
        [
            "# Made by `make docs` of docs/measured.",
            "# Of each capture's verdicts: [the planted cause came first, of].",
            "first:",
            *lines,
            "# Causes a verdict that nobody planted.",
            f"false_each: {table.loc['all', 'false_each']}",
            "",
        ]
    )


def pages(root):
    """The files that may hold tables: README.md and all pages below docs/."""
    return [root / "README.md", *sorted((root / "docs").rglob("*.md"))]


def filled(text, root):
    """(text with its tables made anew, names of the tables that changed)."""
    changed = []

    def replace(match):
        start, kind, name, old, end = match.groups()
        new = made(kind, name, root)
        if new != old:
            changed.append(name)
        return start + new + end

    return MARK.sub(replace, text), changed


def made(kind, name, root):
    """What stands between two marks."""
    if kind == "table":
        return of_csv(name, root)
    if kind == "output":
        return quoted((root / "docs/outputs" / f"{name}.txt").read_text())
    if name != "test_sets":
        raise ValueError(f"no list {name}")
    return testsets.markdown()


def quoted(text):
    """A text as a block of code, its lines no wider than a page's."""
    lines = []
    for line in text.splitlines():
        indent = " " * (len(line) - len(line.lstrip()) + 2)
        lines += textwrap.wrap(line, WIDTH, subsequent_indent=indent) or [""]
    return "".join(f"{'    ' + line}".rstrip() + "\n" for line in ["", *lines, ""])


parsed = functools.cache(yaml.safe_load)


def of_csv(name, root):
    specs = parsed((root / MEASURED / "tables.yaml").read_text())
    if name not in specs:
        raise ValueError(f"{MEASURED}/tables.yaml: no table {name}")
    cells = dict(specs[name])
    path = root / MEASURED / f"{cells.pop('csv', name)}.csv"
    return table(path, cells, where=cells.pop("where", {}))


def table(path, columns, where=None):
    """A Markdown table of a CSV; columns: heading -> template or list of templates.

    where: {column: values that rows need there}; other rows are left out.
    """
    rows = pd.read_csv(path, comment="#", dtype=str, keep_default_na=False)
    shown = rows
    for name, values in (where or {}).items():
        values = [*map(str, values)]
        if missing := {*values} - {*rows[name]}:
            raise ValueError(f"{path}: no {name} {', '.join(sorted(missing))}")
        shown = shown[shown[name].isin(values)]
    lines = [list(columns), ["---"] * len(columns)]
    for row in shown.to_dict("records"):
        try:
            lines.append([cell(templates, row) for templates in columns.values()])
        except (KeyError, ValueError) as error:
            raise ValueError(f"{path}: {error}") from error
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def cell(templates, row):
    """The templates filled with a row and joined; those with an empty cell left out."""
    if isinstance(templates, str):
        templates = [templates]
    return ", ".join(t for t in templates if complete(t, row)).format_map(Row(row))


def complete(template, row):
    names = [name for _, name, _, _ in string.Formatter().parse(template) if name]
    return all(row[name] != "" for name in names)


class Row(dict):
    """A CSV's row whose values know their name, for formats that need the interval."""

    def __getitem__(self, name):
        return Value(self, name)


class Value:
    """One cell: as it stands in the CSV without a format, else as the format says."""

    def __init__(self, row, name):
        self.row, self.name = row, name

    def __format__(self, spec):
        kind, _, number = spec.rpartition(" ")
        text = self.row.get(self.name)
        if not spec:
            return text
        if number == "duration":
            return duration(float(text))
        if number == "link":
            return link(text)
        if not kind:
            return format(float(text), number)
        return INTERVALS[kind](float(text), *self.ends(), number)

    def ends(self):
        """Least and largest; of `a_b_db` in `a_low_b_db` or `a_b_low_db`, and so on."""
        for part in (self.name.partition, self.name.rpartition):
            first, _, unit = part("_")
            names = ("_".join(filter(None, (first, e, unit))) for e in ("low", "high"))
            found = [self.row.get(name) for name in names]
            if all(found):
                return [float(end) for end in found]
        return [None, None]


def difference(value, low, high, number):
    """`**+0.37** [+0.14, +0.60]`: bold where the interval does not hold 0."""
    text = format(value, f"+{number}")
    if low > 0 or high < 0:
        text = f"**{text}**"
    return f"{text} [{low:+{number}}, {high:+{number}}]"


def interval(value, low, high, number):
    return f"{value:{number}} [{low:{number}}, {high:{number}}]"


def value_range(value, low, high, number):
    """`177 (174 to 177)`, or `177` where only the median is known."""
    ends = "" if low is None else f" ({low:{number}} to {high:{number}})"
    return f"{value:{number}}{ends}"


INTERVALS = {"difference": difference, "interval": interval, "range": value_range}


def link(path):
    """To a file of the project, from a page in a folder of docs/."""
    inside = path.removeprefix("docs/")
    return f"[{path}]({'../../' if inside == path else '../'}{inside})"


def duration(seconds):
    """`9 min 58 s`; below five minutes `60 s`."""
    if seconds < 300:
        return f"{seconds:g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if rest else f"{minutes} min"


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (ValueError, OSError) as error:
        sys.exit(f"error: {error}")
