"""A job of the workflow as a reader names it, and how far it is by its log."""

import os
import re
from pathlib import Path

from alignerf.io import faults, progress

# {} is the training, as `of_training` names it. Other rules have their own name.
NAMES = {
    "poses": "photos and cameras",
    "facts": "facts about the photos, settings that suit them",
    "config": "the complete config",
    "preflight": "what the run will cost",
    "preview": "what the run will cost",
    "train": "{}: training",
    "render": "{}: renders",
    "align": "{}: flow from renders to photos",
    "decompose": "{}: parts of the flow",
    "overfit": "{}: error of the flow estimator",
    "correct_poses": "{}: cameras corrected",
    "align_test_poses": "{}: cameras fitted to test photos",
    "evaluate": "{}: scores",
    "decide": "{}: decision on another round",
    "testset": "warped test photos",
    "control_sets": "controls of the warped test photos",
    "collect": "scores and costs",
    "tables": "table",
    "draw": "figures",
    "verdict": "verdict",
    "page": "page",
    "export_folder": "{}: files for other programs",
}
# What two jobs of one training differ in besides.
BESIDES = {"split": "{} photos", "what": "{}", "table": "{}"}
MOVED = "with moved cameras"
LAST_BYTES = 4000


def name_of(rule, wildcards, captures):
    """'plain: training', after the scene's name where there are several.

    wildcards: {name: value} of the job. captures: scenes of the run.
    """
    parts = [NAMES.get(rule, rule.replace("_", " ")).format(of_training(wildcards))]
    for key, text in BESIDES.items():
        if wildcards.get(key):
            parts.append(text.format(wildcards[key]))
    if wildcards.get("moved"):
        parts.append(MOVED)
    scene = wildcards.get("scene")
    alone = scene is None or [scene] == list(captures)
    return ("" if alone else f"{scene}: ") + ", ".join(parts)


def of_training(wildcards):
    """'plain' of plain/round0, 'plain, round 1' of plain/round1."""
    name = wildcards.get("training") or wildcards.get("method") or "all"
    if "round" in wildcards and "training" not in wildcards:
        name += f"/round{wildcards['round']}"
    name = re.sub(r"/round(\d+)", r", round \1", name.replace("/round0", ""))
    return name.replace("/", " ")


def last_shown(logs):
    """The last `progress.Shown` of a job's logs; None where there is none."""
    for path in logs:
        lines = re.split(r"[\r\n]+", last_text(Path(path)).strip())
        if (shown := progress.read(lines[-1])) is not None:
            return shown
    return None


def last_text(path):
    """The end of a file; nothing where it cannot be read."""
    try:
        with open(path, "rb") as file:
            file.seek(max(0, os.fstat(file.fileno()).st_size - LAST_BYTES))
            return file.read().decode(errors="replace")
    except OSError:
        return ""


def said(logs):
    """Lines of a job's logs, without those of its progress."""
    found = []
    for path in logs:
        try:
            text = Path(path).read_text(encoding="utf-8", errors="replace")
        except OSError:
            continue
        lines = [line.split("\r")[-1].rstrip() for line in text.splitlines()]
        found += [line for line in lines if line and not progress.read(line)]
    return found


def warnings(logs):
    """The warnings among them, each once."""
    found = (line for line in said(logs) if line.startswith(faults.WARNING))
    return list(dict.fromkeys(found))
