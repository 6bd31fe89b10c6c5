"""What the words of a command line ask for, and what a run says of it in the end."""

import csv
import difflib
import os
from pathlib import Path
from typing import NamedTuple

from alignerf.experiment import layout, plan, targets
from alignerf.experiment.tables import shipped
from alignerf.io import provenance

# Of a name that is meant and one that is typed, from 0 to 1.
LIKENESS = 0.7
# Columns of a table of the paper's on a terminal: of a CSV, heading and form.
SHOWN = {"psnr_db": ("PSNR", ".2f"), "ssim": ("SSIM", ".3f"), "lpips": ("LPIPS", ".3f")}


def only_counts(typed):
    """Whether a dry run says how many jobs each rule has, and tells none of them.

    typed: the command line, as Snakemake parses it.
    """
    return typed.dryrun and typed.quiet is None and not provenance.is_verbose()


class Asked(NamedTuple):
    """A command line's targets, and the plan that they are of.

    words: None in the process of a job, which makes what it is told to.
    """

    experiments: plan.Experiments
    words: list | None

    @classmethod
    def of(cls, experiments, words):
        """The same, checked. Raises ValueError for a scene that no asked table has."""
        asked = cls(experiments, words)
        for name in {*(words or ())} & {*shipped.NAMES} - {*experiments.by_name}:
            # Beside a user's config it is no target at all.
            if "" not in experiments.by_name:
                raise ValueError(f"config: small: false: {name} has no full size")
        for scene in asked.beside if asked.tables else ():
            if not any(scene in asked.own(table) for table in asked.tables):
                own = [n for table in asked.tables for n in asked.own(table)]
                tables, known = ", ".join(asked.tables), ", ".join(own)
                raise ValueError(f"{scene}: no scene of {tables}; theirs: {known}")
        return asked

    @property
    def tables(self):
        """The shipped targets that are asked for."""
        words = self.words or ()
        known = [name for name in self.experiments.by_name if name]
        return known if shipped.PAPER in words else [n for n in known if n in words]

    @property
    def beside(self):
        """Scenes that are asked for."""
        return [word for word in self.words or () if word in self.experiments.scenes]

    def own(self, table):
        """Scenes of a shipped target; the figures are of one of Table 1's, too."""
        names = (table, "table1") if table == shipped.FIGURES else (table,)
        return [one for name in names for one in self.experiments.by_name[name].scenes]

    @property
    def narrowed(self):
        """{table: its scenes that are asked for}, all seeds and lengths of each."""
        found = {}
        for table in self.tables:
            again = tuple(
                f"{one}_{kind}" for one in self.beside for kind in ("seed", "x")
            )
            # A table of crops has those of a scene.
            chosen = [
                one
                for one in self.own(table)
                if any(
                    name in self.beside or name.startswith(again)
                    for name in (one, self.experiments.of(one).parent(one) or one)
                )
            ]
            found |= {table: chosen} if chosen else {}
        return found

    @property
    def scenes(self):
        """Scenes whose folders this run may write."""
        if self.words is None:
            return list(self.experiments.scenes)
        known = self.experiments.scenes
        found = [*self.beside, *(n for table in self.tables for n in self.made(table))]
        files = [Path(word).parts for word in self.words if "/" in word]
        found += [one for parts in files for one in parts[1:2] if one in known]
        # Other targets, as `all` and `comparison`, are of the config that runs.
        named = {*self.beside, *shipped.NAMES, shipped.PAPER}
        others = [word for word in self.words if "/" not in word and word not in named]
        if (others or not found) and "" in self.experiments.by_name:
            found += self.own("")
        # A crop is of another scene's photos, which is judged by its crops.
        wholes = [known[name].parent(name) or name for name in found]
        crops = [one for name in wholes for one in known[name].crops(name)]
        return list(dict.fromkeys([*wholes, *crops, *found]))

    def made(self, table):
        """Scenes of which a shipped target makes something."""
        if table == shipped.FIGURES:
            drawn = targets.drawn(self.experiments, self.narrowed)
            return [*self.experiments.by_name[table].scenes, drawn]
        return self.narrowed.get(table, self.own(table))

    def of_scene(self, scene):
        """What a scene's own target makes: nothing beside a table, which it narrows."""
        if self.tables:
            return []
        return targets.of_scene(self.experiments.of(scene), scene)

    def check(self, rules):
        """ValueError for a word that is no rule, scene or file; the nearest name."""
        known = [*self.experiments.scenes, *rules]
        # Rules that make nothing of a user's config alone.
        lacking = {shipped.PAPER, shipped.FIGURES} | {*shipped.NAMES} - {*known}
        for name in self.words or ():
            if len(self.experiments.by_name) == 1 and name in lacking:
                what = "is of the shipped configs: leave out --configfile"
                raise ValueError(f"{name}: {what}")
            if not (name in known or "/" in name or os.path.exists(name)):
                near = difflib.get_close_matches(name, known, 1, LIKENESS)
                hint = f"; perhaps {near[0]!r}" if near else ""
                scenes = ", ".join(self.scenes)
                raise ValueError(
                    f"{name}: no such scene or target{hint}. Scenes of this config: "
                    f"{scenes}. Other targets: snakemake --list-target-rules"
                )

    def last_words(self, export):
        """Lines at a run's end: the tables that it was for, else verdicts.

        export: as of `targets.export_command`.
        """
        if self.tables:
            made = [f"{layout.RESULTS}/{table}.csv" for table in self.tables]
            return [line for path in made for line in of_table(path)]
        first = self.experiments.by_name.get("")
        captures = first.captures() if first else []
        can = first is not None and targets.can_export(first)
        lines = targets.verdicts(captures, export * can)
        names = {"comparison", *shipped.TABLES} & {*(self.words or ())}
        if not self.words or "all" in self.words:
            printed = first is not None and first.config.published_table
            names |= {"comparison"} if printed else set()
        made = [f"{layout.RESULTS}/{name}.csv" for name in sorted(names)]
        return [*(line for path in made for line in of_table(path)), *lines]


def of_table(path):
    """Lines of a table across scenes as a terminal shows it: the paper's columns.

    Nothing of one that is not there, or has other columns.
    """
    if not Path(path).is_file():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        lines = [line for line in csv.DictReader(file) if line.get("scene") == "all"]
    rows = {}
    for line in lines:
        key = line["group"], line["method"], line["warping"]
        rows.setdefault(key, {})[line["test_set"]] = line
    if not rows:
        return []
    several = len({group for group, _, _ in rows}) > 1
    printed = [row for row in rows.values() if is_printed(row)]
    cells = [
        ["", *(head for head, _ in SHOWN.values()), "min", "params", "paper's PSNR"]
    ]
    for (group, method, warping), row in rows.items():
        if is_printed(row):
            continue
        name = method if warping == "none" else f"{method}, warped {warping}"
        first = next(iter(row.values()))
        minutes = number(first["total_time_s"], ".1f", 60)
        costs = minutes, number(first["params"], ",.0f")
        scored = [pair(row, column, form) for column, (_, form) in SHOWN.items()]
        paper = paper_of(row, printed)
        cells.append([f"{group} " * several + name, *scored, *costs, paper])
    # Without weights of a network there is no LPIPS.
    kept = [i for i in range(len(cells[0])) if not i or any(r[i] for r in cells[1:])]
    cells = [[row[i] for i in kept] for row in cells]
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    shown = [
        "  ".join(
            text.rjust(width) if i else text.ljust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    ]
    return ["", f"{path}: standard / warped test set", *shown]


def is_printed(row):
    return any(line["source"] for line in row.values())


def paper_of(row, printed):
    """The paper's PSNR on both test sets of the row that ours is called like."""
    first = next(iter(row.values()))
    keys = ("group", "published", "warping")
    for other in printed if first["published"] else ():
        line = next(iter(other.values()))
        if all(line[key] == first[key] for key in keys):
            return pair(other, "psnr_db", ".2f")
    return ""


def pair(row, column, form):
    """`standard / warped` of a metric; of LPIPS of the first network that has one."""
    known = next(iter(row.values()))
    for name in [one for one in known if one == column or one.startswith(f"{column}_")]:
        lines = [row[one] for one in ("standard", "warped") if one in row]
        texts = [number(line[name], form) for line in lines if line[name]]
        if texts:
            return "/".join(texts)
    return ""


def number(text, form, divisor=1):
    """A cell as a number in this form; empty where it is."""
    return f"{float(text) / divisor:{form}}" if text else ""
