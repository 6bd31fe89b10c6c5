"""What `snakemake SCENE` makes."""

TABLES = ("misalignment", "round_times", "controls", "displacement")
FIGURES = ("flow", "rounds", "views", "lengths", "curves")


def tables(experiment, scene):
    """Where the truth is known, also whether other test sets rank as it does."""
    known = scene in experiment.with_truth()
    return (*TABLES, "ranking") if known else TABLES


def figures(experiment, scene):
    """Only staged methods have something to be compared with side by side."""
    return (*FIGURES, "crops") if experiment.staged() else FIGURES


def of_scene(experiment, scene):
    """What `snakemake SCENE` is run for; what leads there is made too."""
    folder = f"results/{scene}"
    return [
        f"{folder}/config.yaml",
        f"{folder}/facts.json",
        *(
            f"{folder}/tables/{name}.{kind}"
            for name in tables(experiment, scene)
            for kind in ("csv", "tex")
        ),
        *(f"{folder}/figures/{name}.png" for name in figures(experiment, scene)),
    ]
