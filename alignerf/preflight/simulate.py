"""Tasks on the cores of a machine, and when the last of them ends. No JAX here."""

import heapq
from typing import NamedTuple


class Task(NamedTuple):
    """A piece of a plan: `seconds` on `threads` cores, after other tasks."""

    name: str
    kind: str
    seconds: float
    threads: int
    after: list[str]
    # Below the scene's folder: it is there once the task is done.
    file: str
    # What it leaves on the disk, and its peak in memory where that is much.
    new_bytes: int = 0
    peak_bytes: int = 0


def wall_s(tasks, cores) -> float:
    """Seconds until all are done."""
    return max((end_s for end_s, _ in run(tasks, cores)), default=0.0)


def peak_bytes(tasks, cores) -> int:
    """The most memory that tasks take which run at once."""
    moments = [running for _, running in run(tasks, cores)]
    return max((sum(t.peak_bytes for t in running) for running in moments), default=0)


def run(tasks, cores):
    """Yield, whenever a task ends, (seconds from the start, tasks that ran until then).

    Each begins in its turn, as soon as it can: it waits for those in `after` that are
    among the tasks, and for its threads.
    """
    names = {task.name for task in tasks}
    waiting, done, running = list(tasks), set(), []
    free, now_s = cores, 0.0
    while waiting or running:
        for task in list(waiting):
            threads = min(task.threads, cores)
            if done >= names & set(task.after) and threads <= free:
                free -= threads
                heapq.heappush(running, (now_s + task.seconds, task.name, task))
                waiting.remove(task)
        if not running:
            raise ValueError(f"tasks wait for each other: {waiting[0].name}")
        moment = [task for *_, task in running]
        now_s, name, task = heapq.heappop(running)
        free += min(task.threads, cores)
        done.add(name)
        yield now_s, moment
