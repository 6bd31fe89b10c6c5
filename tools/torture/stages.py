"""Every command of a finished chain, with each of its inputs damaged in every way.

A stage has to refuse it in one line, or to make the same files as before: then it does
not read what was damaged.
"""

import csv
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from alignerf import tabulate
from alignerf.io import owned
from tests import damaged_cases
from tools.torture import damage, running

INPUT = re.compile(r"results/[\w/.{}-]+")
SPLITS = ("test", "train")
# Stages that are given a scene's folder and read its reports too.
OF_REPORTS = ("alignerf.verdict", "alignerf.page", "alignerf.costs")
REPORTS = ("facts.json", "decisions.json", "poses.json", "preflight.json")
# What tables are made of, in a scene's folder or in one of the table's name.
ROWS = ("scores.csv", "trainings.csv")
# No outputs of the stage that leaves them there.
NOT_READ = ("checkpoints", "logs")
# What holds a time as its content, besides keys and columns that end in _s.
TIMED = (".html", ".log", ".tsv", ".provenance.json", "preflight.json", "timing.json")
TIMED += ("misalignment.tex",)


class Stage(NamedTuple):
    """A command of the chain, and the files that it makes."""

    command: list[str]
    outputs: list[str]

    @property
    def module(self):
        return self.command[2]


def of_plan(text):
    """Stages of what `snakemake --forceall -n -p` prints, one of each kind."""
    found = {}
    for job in text.split("\n\n"):
        shell = re.search(r"python -m .*", job)
        outputs = re.search(r"^    output: (.*)$", job, re.MULTILINE)
        if not (shell and outputs):
            continue
        words = shlex.split(re.sub(r" (2>&1 \| tee|>) .*", "", shell[0]))
        told = (w for w in words if w.startswith("--") or w in tabulate.TABLES)
        kind = (words[2], *told)
        kind += trained(words)
        stage = Stage([sys.executable, *words[1:]], outputs[1].split(", "))
        found.setdefault(kind, stage)
    return list(found.values())


def trained(words):
    """What tells trainings apart that have the same options: keys of their job."""
    if "alignerf.train" not in words:
        return ()
    job = json.loads(words[words.index("--config") + 1])
    chosen = (
        key
        for key in ("pose_optimization", "align", "auto", "alignerf")
        if job.get(key)
    )
    return (job["stage"], *chosen)


def plan(root, folder, config):
    """The stages of the chain that lies in the folder."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", root / "Snakefile"]
    command += ["--configfile", config, "--cores", "1", "-n", "--forceall", "-p"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stdout + done.stderr)
    return of_plan(done.stdout)


def inputs_of(stage, folder):
    """Paths, relative to the chain's folder, of what a command may read."""
    named = set()
    for word in stage.command:
        for path in INPUT.findall(word):
            for split in SPLITS if "{split}" in path else ("",):
                named.add(path.replace("{split}", split).rstrip("/."))
    scenes = {str(Path(path).parent) for path in named if path.endswith("/config.yaml")}
    found = {f"{scene}/{name}" for scene in scenes for name in rows_of(stage)}
    for path in named:
        if path.count("/") == 1:
            of_scene = ["cameras.npz", "images"]
            of_scene += REPORTS if stage.module in OF_REPORTS else ()
            found |= {f"{path}/{name}" for name in of_scene}
        else:
            found |= reports_in(folder, path) or {path}
    return sorted(
        path
        for path in found
        if (folder / path).exists()
        and not set(NOT_READ) & set(Path(path).parts)
        and not any(is_part(path, made) for made in stage.outputs)
    )


def rows_of(stage):
    """Files below a scene's folder that a table is made of; none of other stages."""
    if stage.module != "alignerf.tabulate":
        return []
    name = stage.command[stage.command.index("--table") + 1]
    return [str(Path(tabulate.TABLES[name].of, one)) for one in ROWS]


def reports_in(folder, path):
    """The tables and reports of a training in its folder, instead of itself."""
    return {
        str(found.relative_to(folder))
        for kind in ("*.csv", "*.json", "displacement/*.csv", "render/*.json")
        for found in (folder / path).glob(kind)
    }


def is_part(path, made):
    return f"{path}/".startswith(f"{made}/") or f"{made}/".startswith(f"{path}/")


def attack(stage, path, way, base, place, rng):
    """(finding or None, Ended) of one damage; (None, None) where it does not apply.

    base: the finished chain; place: where its copy is made.
    """
    copy_chain(base, place)
    for output in stage.outputs:
        if (made := place / output).exists():
            damage.removed(made, rng)
    if not damage.ways_of(place / path)[way](place / path, rng):
        return None, None
    before = hidden(place)
    ended = running.run(stage.command, place, running.variables(place))
    if left := hidden(place) - before:
        return f"left {min(left)} behind", ended
    of_file = stage.module, Path(path).name, way
    if ended.code == 0 and EXCUSED & {(stage.module, way), of_file}:
        return None, ended
    return finding(stage, path, ended, base, place), ended


def copy_chain(base, place):
    """The chain by links: who replaces a file leaves the other's as it is."""
    shutil.rmtree(place, ignore_errors=True)
    ignored = shutil.ignore_patterns("checkpoints", ".snakemake*")
    shutil.copytree(base, place, ignore=ignored, copy_function=os.link)


def hidden(folder):
    """Temporary files and folders in it."""
    found = (folder / "results").rglob(".*")
    found = (one for one in found if one.name != owned.MARK)
    return {str(p.relative_to(folder)) for p in found if ".jax_cache" not in str(p)}


# What a stage takes, and why that is right.
EXCUSED = {
    # It aligns the renders that there are; who reads the flows names the one it misses.
    ("flow.align", "a view missing"),
    # Cameras of another training of the same scene are a training's to take.
    ("alignerf.train", "cameras.npz", "another's bytes"),
    # Of other programs' trainings commit, lock and device are not known either.
    *(("alignerf.tables.collect", f"a key missing ({n})") for n in range(3)),
}


def finding(stage, path, ended, base, place):
    """What is wrong with how a stage took a damage; None where nothing is."""
    if ended.code != 0:
        names = [Path(path).name, Path(path).stem, *keys_of(base / path)]
        return running.fault_of(ended, names)
    if ended.peak_mib > running.MAX_MIB:
        return f"{ended.peak_mib:.0f} MiB"
    others = [out for out in stage.outputs if content(base, out) != content(place, out)]
    return f"accepted, with another {others[0]}" if others else None


def keys_of(path):
    """Names that a refusal may give instead: files in a folder, keys of a JSON."""
    if path.is_dir():
        return [found.name for found in path.rglob("*") if found.is_file()]
    if path.suffix == ".json":
        places = damaged_cases.places(json.loads(path.read_text()))
        return [place[-1] for place in places if place and isinstance(place[-1], str)]
    return []


def content(folder, path):
    """{file: what is in it} of an output, without times; None for what is not there."""
    path = folder / path
    if not path.exists():
        return None
    files = [path] if path.is_file() else sorted(path.rglob("*"))
    return {
        str(file.relative_to(folder)): untimed(file)
        for file in files
        if file.is_file() and not file.name.startswith(".")
    }


def untimed(path):
    """Bytes of a file, or its values where some of them are times."""
    if path.name.endswith(TIMED):
        return b""
    if path.suffix == ".json":
        return without_times(json.loads(path.read_text()))
    if path.suffix == ".csv":
        with open(path, newline="") as file:
            rows = [*csv.DictReader(file)]
        # Of a table of metrics a line may be of a time.
        return [without_times(r) for r in rows if not is_measured(r.get("metric", ""))]
    return path.read_bytes()


def without_times(value):
    if isinstance(value, dict):
        return {
            key: without_times(entry)
            for key, entry in value.items()
            if not is_measured(str(key))
        }
    if isinstance(value, str):
        return re.sub(r"\b[\d.]+ (s|min)\b", "", value)
    return list(map(without_times, value)) if isinstance(value, list) else value


def is_measured(key):
    """Whether a value tells of a process: seconds, minutes, memory."""
    return key.endswith("_s") or key in ("seconds", "minutes", "memory_mib")
