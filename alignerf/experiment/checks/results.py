"""The folders that a run writes into, before the workflow engine meets them."""

import os
from pathlib import Path

# Folders of a scene besides those of its methods.
INSIDE = ("images", "tables", "figures", "logs", "tradeoff", "pretrain", "testset")


def check_folders(scenes, methods, results="results"):
    """ValueError for a file in the place of a folder, or a link that leads nowhere."""
    for folder in folders_of(scenes, methods, results):
        # What is not there will be made.
        if os.path.lexists(folder) and not folder.is_dir():
            raise ValueError(
                f"{folder}: a folder was expected there: move this file away"
            )


def check_writable(scenes, methods, results="results"):
    """ValueError for a folder in which this user can write nothing."""
    for folder in folders_of(scenes, methods, results):
        if folder.is_dir() and not os.access(folder, os.W_OK | os.X_OK):
            raise ValueError(f"{folder}: cannot be written to, by its permissions")


def folders_of(scenes, methods, results):
    """Paths of the folders, those above before those below."""
    yield Path(results)
    for scene in scenes:
        yield Path(results, scene)
        for name in (*INSIDE, *methods):
            yield Path(results, scene, name)
