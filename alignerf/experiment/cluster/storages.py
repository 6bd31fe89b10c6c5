"""Results in a storage of Snakemake's (`--default-storage-provider`)."""

import os
from pathlib import Path

# Where Snakemake has the copies of files that lie in a storage.
STORAGE = ".snakemake/storage"


def here(file):
    """A rule's output, which a plan is to read; fetched, where a storage has it.

    Snakemake fetches what jobs need. Each time, since the job may have made it anew.
    """
    if file.is_storage:
        Path(file).parent.mkdir(parents=True, exist_ok=True)
        file.storage_object.retrieve_object()
    return file


def link(scenes, output, results="results"):
    """Let results/SCENE lead to where a storage's files lie while jobs use them.

    Of a job Snakemake moves the files that its rule names; its command finds these, as
    without a storage, below the scene's folder. output: where Snakemake has a file that
    a rule writes there.
    Raises ValueError for results that are others'.
    """
    copies = Path(output).parents[1]
    in_storage = copies != Path(results)
    for scene in scenes:
        there, copy = Path(results) / scene, copies.absolute() / scene
        if not in_storage:
            if there.is_symlink() and STORAGE in os.readlink(there):
                raise ValueError(f"{there}: leads into a storage: remove this link")
            continue
        copy.mkdir(parents=True, exist_ok=True)
        there.parent.mkdir(exist_ok=True)
        if not os.path.lexists(there):
            there.symlink_to(copy)
        if there.resolve() != copy.resolve():
            raise ValueError(
                f"{there}: lies on the disk, or in another storage: run where it does "
                "not, or move it away"
            )
