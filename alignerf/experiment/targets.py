"""What `snakemake SCENE` makes, and what it says in the end."""

import json
from pathlib import Path

TABLES = ("misalignment", "round_times", "controls", "displacement")
# Not in Snakemake's report.
UNREPORTED = ("round_times",)
FIGURES = ("flow", "rounds", "views", "lengths", "curves")


def tables(known):
    """Where the truth is known, also whether other test sets rank as it does."""
    return (*TABLES, "ranking") if known else TABLES


def reported(known):
    """Those that Snakemake's report shows."""
    return [name for name in tables(known) if name not in UNREPORTED]


def beside(known):
    """Files of a scene's tables beside those: in LaTeX, and where they come from."""
    return [
        *(f"results/{{scene}}/tables/{name}.csv" for name in UNREPORTED),
        *(
            f"results/{{scene}}/tables/{name}.{kind}"
            for name in tables(known)
            for kind in ("tex", "provenance.json")
        ),
    ]


def figures(experiment):
    """Only staged methods have something to be compared with side by side."""
    return (*FIGURES, "crops") if experiment.staged() else FIGURES


def of_scene(experiment, scene):
    """What `snakemake SCENE` is run for; what leads there is made too."""
    folder = f"results/{scene}"
    return [
        f"{folder}/config.yaml",
        f"{folder}/facts.json",
        f"{folder}/decisions.json",
        f"{folder}/verdict.json",
        *(
            f"{folder}/tables/{name}.{kind}"
            for name in tables(scene in experiment.with_truth())
            for kind in ("csv", "tex")
        ),
        *(f"{folder}/figures/{name}.png" for name in figures(experiment)),
    ]


def verdicts(scenes, results="results"):
    """Lines of the verdicts that are there, a scene's name before them."""
    lines = []
    for scene in scenes:
        path = Path(results) / scene / "verdict.json"
        if path.is_file():
            found = json.loads(path.read_text(encoding="utf-8"))
            lines += ["", scene, *(f"  {line}" for line in found["verdict"])]
    return lines


def exports(experiment):
    """Folders for other programs: what the last round of each method was trained on.

    Its cameras with the photos as taken and, where it learnt from warped photos, with
    these.
    """
    found, moved = [], {*experiment.refining(), *experiment.correcting()}
    for scene in experiment.scenes:
        for method in experiment.trained():
            last = experiment.last_round(scene, method)
            folder = f"results/{scene}/{method}/export"
            if last > 0 or method in moved:
                found.append(f"{folder}/cameras")
            if experiment.change_of(method, last) == "photos":
                found.append(f"{folder}/photos")
    return found
