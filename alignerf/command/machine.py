"""What a command may use of the machine that it runs on."""

import os


def cores() -> int:
    """Cores that this process may use: fewer than there are in a container, say."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
