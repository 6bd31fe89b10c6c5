"""Whether a plan fits this machine, and its cost in words. No JAX here."""

from alignerf.files import faults
from alignerf.preflight import simulate

KINDS = {"train": "trainings", "render": "rendering", "flow": "flow"}
# Of what is free: the rest is for what others take meanwhile.
USABLE = 0.9


def check(plan):
    """ValueError with advice where a plan needs more memory or disk than is free."""
    memory, disk = plan["memory_bytes"], plan["disk_bytes"]
    if memory > USABLE * plan["memory_free_bytes"]:
        smaller = "--cores 1" if plan["lanes"] > 1 else "a smaller model or batch_rays"
        raise ValueError(
            f"the plan needs {gigabytes(memory)} of memory, and "
            f"{gigabytes(plan['memory_free_bytes'])} are free: {smaller}, or a larger "
            "downscale"
        )
    if disk > USABLE * plan["disk_free_bytes"]:
        raise ValueError(
            f"the plan needs {gigabytes(disk)} of disk, and "
            f"{gigabytes(plan['disk_free_bytes'])} are free: a larger downscale, fewer "
            "methods or rounds, or results elsewhere (--directory)"
        )


def lines(plan, name):
    """The cost of a plan in words, line by line."""
    tasks = plan["tasks"]
    parts = {}
    for task in tasks:
        kind = KINDS.get(task["kind"], "the rest")
        parts[kind] = parts.get(kind, 0.0) + task["seconds"]
    count = sum(task["kind"] == "train" for task in tasks)
    trainings = "1 training" if count == 1 else f"{count} trainings"
    said = ", ".join(
        f"{trainings if kind == 'trainings' else kind} {minutes(seconds)}"
        for kind, seconds in parts.items()
    )
    cores = f"{plan['cores']} core" + "s" * (plan["cores"] > 1)
    return [
        f"{name}: about {minutes(plan['wall_s'])} on {cores}: {said}",
        f"  memory {gigabytes(plan['memory_bytes'])} of "
        f"{gigabytes(plan['memory_free_bytes'])} free; disk "
        f"{gigabytes(plan['disk_bytes'])} of {gigabytes(plan['disk_free_bytes'])} free",
        *unknown(plan),
        *advice(plan),
    ]


def unknown(plan):
    """The line of what other programs take, which is not known."""
    if not (names := plan.get("external")):
        return []
    some = faults.some_names(names)
    return [f"  not counted, as it is not known: time and memory of {some}"]


def advice(plan):
    """Advice on making a long plan shorter."""
    if plan["wall_s"] < 4 * 3600:
        return []
    return ["  to be done sooner: fewer rounds or methods, training.budget_min"]


def in_all(plans):
    """Seconds until the plans of all scenes, run side by side, are done."""
    tasks = [task for plan in plans for task in tasks_of(plan)]
    return simulate.wall_s(tasks, max(plan["cores"] for plan in plans))


def tasks_of(plan):
    """A plan's tasks; names and files are told from other scenes'."""
    scene = plan["scene"]
    return [
        simulate.Task(
            **one
            | {
                "name": f"{scene}/{one['name']}",
                "after": [f"{scene}/{name}" for name in one["after"]],
            }
        )
        for one in plan["tasks"]
    ]


def minutes(seconds):
    """'45 s', '34 min', '3.5 h'."""
    if seconds < 60:
        return f"{seconds:.0f} s"
    if seconds < 3600 * 1.5:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def gigabytes(size):
    return f"{size / 1e9:.1f} GB"
