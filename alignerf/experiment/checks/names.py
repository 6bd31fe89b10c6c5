"""Names: of scenes, methods and models, and what the paper's tables call them."""

import csv
import re

from alignerf.experiment.checks.common import fault, first
from alignerf.experiment.tables import rows

# What the results' folder holds besides scenes, and a scene's besides methods.
SUFFIXES = (".csv", ".tex", ".png", ".provenance.json")
ACROSS = (
    "tradeoff",
    "comparison",
    "arm",
    *(f"table{n}" for n in range(1, 5)),
)
TABLES = [f"{name}{end}" for name in ACROSS for end in ("", "_ranking", "_effects")]
FILES = {
    *("published", "logs", "bench", "torture", "splats", "README.md"),
    *(f"{name}{end}" for name in TABLES for end in SUFFIXES),
}
FOLDERS = {
    *("images", "truth", "pretrain", "testset", "tables", "figures", "logs"),
    *("facts", "decisions", "poses", "cameras", "config", "preflight"),
    *("masks", "colmap", "points", "bounds", "verdict", "index", "adjusted"),
    "transients",
    *("comparison", "arm", "scores", "trainings"),
}

# The end of a name that Snakemake takes for a loop among rules.
MAX_LETTERS = 100
PERIODIC = re.compile(r"(.+?)\1{19}\Z")


def check_names(config):
    """Names become rules and folders: text, and none that is taken."""
    taken = {
        "scenes": (FILES, "a file of the results"),
        "methods": (FOLDERS, "a folder of every scene"),
        "models": (set(), ""),
    }
    for section, (names, what) in taken.items():
        entries = config.get(section)
        for name in entries if isinstance(entries, dict) else ():
            if not isinstance(name, str):
                fault(f"{section}.{name}", "a name must be text, quote it")
            # Of a longer one the schema says so, and looking would take long.
            if len(name) <= MAX_LETTERS and PERIODIC.search(name):
                reason = "its end repeats itself 20 times or more, choose another"
                fault(f"{section}.{name}", reason)
            if name in names:
                fault(f"{section}.{name}", f"{what} has this name, choose another")


def check_free(scenes, rules):
    """Each scene is a target of its own: no rule may have its name."""
    for name in sorted(set(scenes) & set(rules)):
        fault(f"scenes.{name}", "a rule has this name, choose another")


def check_published(config):
    """Names that the paper's table has, where one is shown."""
    number = config.published_table
    named = {n: m.published for n, m in config.methods.items() if m.published}
    if number is None and named:
        name = first(named)
        fault(f"methods.{name}.published", "only with published_table")
    if number is not None and not named:
        fault("published_table", "no method says what it is called there (`published`)")
    for name, called in named.items():
        known = published_names(number)
        if called not in known:
            fault(
                f"methods.{name}.published", f"{called!r} is none of {', '.join(known)}"
            )


def published_names(number):
    """What the methods of one of the paper's tables are called."""
    with open(rows.published_table(), newline="", encoding="utf-8") as file:
        found = [
            row["method"] for row in csv.DictReader(file) if row["table"] == str(number)
        ]
    return list(dict.fromkeys(found))
