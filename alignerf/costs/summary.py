"""A measured plan in words, whether it fits this machine, and what is left of it."""

import os
import time
from pathlib import Path

from alignerf.causes import shift
from alignerf.costs.plan import Task
from alignerf.io import faults, json_files

# Names of the config's scenes, one a line: set for all jobs of a run.
SCENES = "ALIGNERF_SCENES"
ASK_EVERY_S = 30.0
KINDS = {"train": "trainings", "render": "rendering", "flow": "flow"}
NUMBERS = ("wall_s", "memory_bytes", "memory_free_bytes", "disk_bytes")
NUMBERS += ("disk_free_bytes", "cores", "parallel_jobs")
KEYS = dict.fromkeys(NUMBERS, json_files.NUMBER) | {"scene": str}
KEYS |= {"tasks": list, "external": list}
# Of what is free: the rest is for what others take meanwhile.
USABLE = 0.9


def read(path):
    """The content of a preflight.json, its tasks as such; ValueError names the file."""
    plan = json_files.read(path, KEYS)
    try:
        tasks = [Task(**task) for task in plan["tasks"]]
        if not all(0 <= number < 1e15 for task in tasks for number in task[2:]):
            raise ValueError("a number out of range")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: not a preflight: {error}") from None
    return plan | {"tasks": tasks}


def check(plan):
    """ValueError with advice where a plan needs more memory or disk than is free, or
    has no time for a verdict.
    """
    less = "--cores 1" if plan["parallel_jobs"] > 1 else "a smaller model or batch_rays"
    advice = {
        "memory": f"{less}, or a larger downscale",
        "disk": "a larger downscale, fewer methods or rounds, or results elsewhere "
        "(--directory)",
    }
    for what, to_do in advice.items():
        needed, free = plan[f"{what}_bytes"], plan[f"{what}_free_bytes"]
        if needed > USABLE * free:
            raise ValueError(
                f"the plan needs {gigabytes(needed)} of {what}, and {gigabytes(free)} "
                f"are free: {to_do}"
            )
    check_length(plan)


def check_length(plan):
    """ValueError where a plan's budget is too short for any verdict."""
    length = plan.get("length") or {}
    if not length.get("budget_min") or length["epochs"] >= shift.FEW_EPOCHS / 2:
        return
    least, enough = length["least_min"], length["enough_min"]
    more = f", {enough} are enough" * (enough > least)
    raise ValueError(
        f"{plan['scene']}: a budget of {length['budget_min']:g} min is too short for a "
        f"verdict: each pixel would be seen {length['epochs']:.2g} times. The least "
        f"that serves is --budget-min {least} (training.budget_min)"
        f"{more}; `preflight: false` in the config trains all the same"
    )


def lines(plan):
    """The cost of a plan in words, line by line."""
    parts = dict.fromkeys([*KINDS.values(), "the rest"], 0.0)
    for task in plan["tasks"]:
        parts[KINDS.get(task.kind, "the rest")] += task.seconds
    said = ", ".join(f"{kind} {minutes(seconds)}" for kind, seconds in parts.items())
    free = [
        f"{what} {gigabytes(plan[f'{what}_bytes'])} of "
        f"{gigabytes(plan[f'{what}_free_bytes'])} free"
        for what in ("memory", "disk")
    ]
    when = f"{minutes(plan['wall_s'])} on {plan['cores']} cores"
    found = [f"{plan['scene']}: about {when}: {said}", f"  {'; '.join(free)}"]
    if (length := plan.get("length")) and (budget_min := length["budget_min"]):
        found.append(
            f"  {budget_min:g} min are of each training; all else comes on top"
        )
    if length and not length["epochs"] >= shift.FEW_EPOCHS / 2:
        seen = f"each pixel is seen {length['epochs']:.2g} times"
        found.append(f"  too short a training for a verdict: {seen}")
    if plan["external"]:
        some = faults.some_names(plan["external"])
        found.append(f"  not counted, as it is not known: time and memory of {some}")
    if plan["wall_s"] > 4 * 3600:
        found.append(
            "  to be done sooner: fewer rounds or methods, training.budget_min"
        )
    return found


def minutes(seconds):
    """'45 s', '34 min', '3.5 h'."""
    if seconds < 60:
        return f"{seconds:.0f} s"
    if seconds < 3600 * 1.5:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def gigabytes(size):
    return f"{size / 1e9:.1f} GB"


class Left:
    """The time left of all tasks, asked by a task that is running itself.

    scene: its folder. output: a file of the task's rule, as a plan names it.
    """

    def __init__(self, scene, output):
        self.scene, self.output = Path(scene), faults.resolved(output)
        self.next_s, self.text = 0.0, ""

    def words(self, share=0.0) -> str:
        """'all: 12 min left of 34 min', or nothing; share: done of this task."""
        if time.monotonic() >= self.next_s:
            self.next_s = time.monotonic() + ASK_EVERY_S
            names = {self.scene.name, *os.environ.get(SCENES, "").split("\n")}

            found = []

            def share_of(path, task):
                found.append(faults.resolved(path) == self.output)
                return share if found[-1] else None

            left = seconds_left(self.scene.parent, names, share_of)
            # A job of no plan, as of a scene whose cost was not asked for.
            said = left and f"all: {minutes(left[0])} left of {minutes(left[1])}"
            self.text = said if any(found) else ""
        return self.text


def seconds_left(results, scenes, share_of):
    """(seconds left, seconds of the whole) of scenes' plans; None without a plan.

    share_of: a function of a task's file and the task: how much of it is done, or None
    where it does not run. A damaged plan counts for nothing: it never fails a run.
    """
    left_s = whole_s = 0.0
    for folder in (Path(results, name) for name in scenes if name):
        try:
            plan = read(folder / "preflight.json")
        except (OSError, ValueError):
            continue
        todo = 0.0
        for task in plan["tasks"]:
            path = folder / task.file
            share = share_of(path, task)
            done = float(path.exists()) if share is None else share
            todo += (1 - done) * task.seconds * task.threads
        every = sum(task.seconds * task.threads for task in plan["tasks"])
        left_s += plan["wall_s"] * todo / every if every else 0.0
        whole_s += plan["wall_s"]
    return (left_s, whole_s) if whole_s else None
