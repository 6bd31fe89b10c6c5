"""The time left of the whole plan, for the progress lines of a running job.

The tasks left are those of the scenes' `preflight.json` whose files do not exist yet.
Without a preflight there is no text; a damaged one never fails a run.
"""

import math
import os
import time
from pathlib import Path

from alignerf.files import faults, json_files
from alignerf.preflight import fit, simulate

# Of the config's scenes, one a line: name, and the digest of what each has to do. Set
# for all jobs of a run.
SCENES = "ALIGNERF_SCENES"
ASK_EVERY_S, ASK_SHARE = 10.0, 100.0
# What a file that is no plan, or a damaged one, ends in.
NO_PLAN = (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError)


class Left:
    """The time left of all tasks, asked by a task that is running itself.

    scene: its folder. timing: the file that the task ends with.
    """

    def __init__(self, scene, timing):
        self.scene, self.timing = Path(scene), Path(timing)
        self.next_s, self.text = 0.0, ""

    def words(self, share=0.0) -> str:
        """'all: 12 min left of 34 min', or nothing; share: done of this task."""
        begun_s = time.monotonic()
        if begun_s >= self.next_s:
            try:
                self.text = text_of(plans_of(self.scene), self.timing, share)
            except NO_PLAN:
                self.text = ""
            # Plans of many scenes take seconds: the training is what is to be done.
            now_s = time.monotonic()
            self.next_s = now_s + max(ASK_EVERY_S, ASK_SHARE * (now_s - begun_s))
        return self.text


def plans_of(scene: Path):
    """(folder, plan) of each scene of the run that has a plan; scene: one of them."""
    return plans_in(scene.parent, os.environ.get(SCENES, ""), scene.name)


def plans_in(results: Path, scenes, own=None):
    """The same; scenes: lines as of SCENES. own: a scene whatever they say."""
    lines = (line for line in scenes.split("\n") if line)
    digests = {own: ""} if own is not None else {}
    digests |= dict(line.partition(" ")[::2] for line in lines)
    plans = []
    for name, digest in digests.items():
        path = results / name / "preflight.json"
        plan = path.is_file() and json_files.read(path)
        # What was measured for another config says nothing of this one.
        if plan and digest in ("", plan.get("work", "")):
            plans.append((path.parent, plan))
    return plans


def text_of(plans, timing: Path, share):
    """The text of `Left.words`; plans: (folder, plan) of each scene."""
    ours = faults.resolved(timing)
    found = []

    def share_of(path, task):
        if faults.resolved(path) != ours:
            return None
        found.append(task)
        return share

    if not plans:
        return ""
    left_s, whole_s = seconds(plans, share_of)
    if not found:
        # Another plan's job.
        return ""
    return f"all: {fit.minutes(left_s)} left of {fit.minutes(whole_s)}"


def seconds(plans, share_of):
    """(seconds left, seconds of the whole) of all scenes' plans, side by side.

    share_of: a function of a task's file and the task: how much of it is done, or None
    where it does not run. Raises ValueError where somebody has changed a plan.
    """
    left = []
    for folder, plan in plans:
        for task in fit.tasks_of(plan):
            path = folder / task.file
            share = share_of(path, task)
            if share is not None:
                left.append(task._replace(seconds=(1 - share) * task.seconds))
            elif not path.exists():
                left.append(task)
    cores = max(plan["cores"] for _, plan in plans)
    whole_s = fit.in_all([plan for _, plan in plans])
    left_s = simulate.wall_s(left, cores)
    if not (0 <= left_s < math.inf and 0 <= whole_s < math.inf):
        raise ValueError(f"{left_s} of {whole_s} seconds are left")
    return left_s, whole_s
