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
    # What it leaves on the disk.
    new_bytes: int = 0


def wall_s(tasks, cores) -> float:
    """Seconds until all are done; each begins in its turn, as soon as it can.

    A task waits for those in `after` that are among the tasks, and for its threads.
    """
    names = {task.name for task in tasks}
    waiting, done, running = list(tasks), set(), []
    free, now_s = cores, 0.0
    while waiting or running:
        started = []
        for task in waiting:
            ready = done >= names & set(task.after)
            threads = min(task.threads, cores)
            if ready and threads <= free:
                free -= threads
                heapq.heappush(running, (now_s + task.seconds, task.name, threads))
                started.append(task)
        waiting = [task for task in waiting if task not in started]
        if not running:
            raise ValueError(f"tasks wait for each other: {waiting[0].name}")
        now_s, name, threads = heapq.heappop(running)
        free += threads
        done.add(name)
    return now_s
