"""Results in a storage of Snakemake's (`--default-storage-provider`)."""

from pathlib import Path


def here(file):
    """A rule's output, which a plan is to read; fetched, where a storage has it.

    Snakemake fetches what jobs need. Each time, since the job may have made it anew.
    """
    if file.is_storage:
        Path(file).parent.mkdir(parents=True, exist_ok=True)
        file.storage_object.retrieve_object()
    return file


def link(scenes, copies, results="results"):
    """Let results/SCENE lead to where a storage's files lie while jobs use them.

    Of a job Snakemake moves the files that its rule names; its command finds these, as
    without a storage, below the scene's folder. copies: where Snakemake has `results`.
    Raises ValueError for results that are others'.
    """
    if Path(copies) == Path(results):
        return
    for scene in scenes:
        there = Path(results) / scene
        copy = Path(copies).absolute() / scene
        copy.mkdir(parents=True, exist_ok=True)
        if not there.exists():
            there.parent.mkdir(exist_ok=True)
            there.symlink_to(copy)
        elif there.resolve() != copy.resolve():
            raise ValueError(
                f"{there}: lies on the disk, or in another storage: run where it does "
                "not, or move it away"
            )
