"""Lines of code, words of pages and seconds of tests, against tests/ratchet.yaml.

Counts may fall, and then the file is to follow: `python -m tests.ratchet` lowers its
numbers. A rise is written there by hand, with its reason and what went for it:
    alignerf/scenes: {lines: 4321, reason: "reads scans of an app", gone: "llff"}
"""

import ast
import io
import re
import tokenize
from collections import Counter
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parent.parent
LIMITS = Path(__file__).with_suffix(".yaml")
# A number may be above the real one by so many, or by this share of it.
SLACK, SLACK_FRACTION = 30, 0.03
NO_CODE = {getattr(tokenize, name) for name in ("COMMENT", "NL", "NEWLINE", "INDENT")}
NO_CODE |= {tokenize.DEDENT, tokenize.ENDMARKER}
PRODUCT = ("alignerf", "flow", "workflow")
# What is no Python, how a line of it begins that is a comment, and what is not written
# by hand.
OTHER = {
    ".cc": "//",
    ".h": "//",
    ".css": "/*",
    ".html": "{#",
    ".js": "//",
    ".yaml": "#",
}
MADE = {"vendor", "schemas"}


def lines():
    """{package: its lines of code}, of Python and of the workflow's rules."""
    counts = Counter()
    for path in [ROOT / "Snakefile", *files(*PRODUCT, "docs")]:
        if path.suffix in ("", ".py", ".smk"):
            counts[package(path.relative_to(ROOT))] += code_lines(path)
    return counts


def other():
    """{package: lines of its C++, pages, styles, scripts and YAML}, without blanks."""
    counts = Counter()
    for path in files(*PRODUCT):
        if (comment := OTHER.get(path.suffix)) and not MADE & {*path.parts}:
            told = map(str.strip, path.read_text().splitlines())
            found = [line for line in told if line and not line.startswith(comment)]
            counts[package(path.relative_to(ROOT))] += len(found)
    return counts


def raw():
    """{folder: all lines of its Python} of what checks the product."""
    counts = Counter()
    for path in files("tests", "tools"):
        if path.suffix == ".py":
            counts[path.relative_to(ROOT).parts[0]] += len(
                path.read_text().splitlines()
            )
    return counts


def files(*tops):
    return [path for top in tops for path in sorted((ROOT / top).rglob("*.*"))]


def package(path):
    """`alignerf/scenes` of what lies below it; `flow`, `docs` and `workflow` whole."""
    top, *below = path.parts[:-1] or ("workflow",)
    return "/".join([top, *below[:1]]) if top == "alignerf" else top


def code_lines(path):
    """Lines that are neither blank nor of comments or docstrings alone."""
    text = path.read_text()
    counted = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in NO_CODE:
            counted.update(range(token.start[0], token.end[0] + 1))
    # A rule's strings stand alone as docstrings do: all of them count.
    return len(counted - docstrings(text) if path.suffix == ".py" else counted)


def docstrings(text):
    """The numbers of their lines."""
    documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, documented) and ast.get_docstring(node, clean=False):
            found.update(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return found


def words():
    """{folder: words of its pages}; a folder of docs/ with all below it."""
    counts = Counter()
    for path in [ROOT / "README.md", *ROOT.glob("docs/**/*.md")]:
        folder = path.relative_to(ROOT).parts[:-1][:2]
        counts["/".join(folder) or "README.md"] += len(path.read_text().split())
    return counts


COUNTS = {"lines": lines, "other": other, "raw": raw, "words": words}


def limits(unit):
    """{name: number} of the file's part."""
    part = yaml.safe_load(LIMITS.read_text())[unit]
    return {
        name: entry[unit] if isinstance(entry, dict) else entry
        for name, entry in part.items()
    }


def faults(unit, counts, most):
    """What is above its limit or far below it, in words."""
    for name in sorted(counts.keys() | most.keys()):
        now, limit = counts.get(name, 0), most.get(name, 0)
        if name not in counts:
            yield f"{name}: there is none; take it out of tests/{LIMITS.name}"
        elif now > limit:
            yield (
                f"{name}: {now:,} {unit}, {now - limit:,} above its {limit:,}: cut, "
                f"or raise the limit in tests/{LIMITS.name} with a reason and what went"
            )
        elif limit > now + max(SLACK, SLACK_FRACTION * now):
            yield (
                f"{name}: {now:,} {unit}, far below its {limit:,}: lower the limit "
                "(python -m tests.ratchet)"
            )


def seconds(stats):
    """{folder: seconds of its tests} of a terminal reporter's reports.

    The seconds of a subtest, whose report has a context, are within those of its test.
    """
    totals = Counter()
    for report in (report for reports in stats.values() for report in reports):
        duration = getattr(report, "duration", 0)
        if duration and not hasattr(report, "context"):
            totals[report.nodeid.partition("::")[0].rpartition("/")[0]] += duration
    return totals


def slow(totals):
    """What took more than its budget, in words."""
    budgets = limits("seconds")
    for folder, took in sorted(totals.items()):
        if took > (budget := budgets.get(folder, budgets["default"])):
            yield f"{folder}: {took:.0f} s of tests, budget {budget} s"


def lower():
    """Write what has fallen into the file; its reasons stay."""
    text = LIMITS.read_text()
    for unit, count in COUNTS.items():
        counts = count()
        for name, limit in limits(unit).items():
            if (now := counts.get(name, limit)) < limit:
                entry = rf"(?ms)(^{unit}:\n.*?^  {re.escape(name)}: \D*)\d+"
                text = re.sub(entry, rf"\g<1>{now}", text, count=1)
    LIMITS.write_text(text)


if __name__ == "__main__":
    lower()
