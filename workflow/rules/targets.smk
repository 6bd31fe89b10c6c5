# Functions only: what `snakemake SCENE` makes.
def ranking_tables(scene):
    """Where the truth is known, whether other test sets rank as it does."""
    known = scene in with_truth()
    return [
        f"results/{scene}/tables/ranking.{kind}" for kind in ("csv", "tex") if known
    ]


def crop_figures(scene):
    """Only staged methods have something to be compared with side by side."""
    return [f"results/{scene}/figures/crops.png"] if staged() else []


def scene_targets(scene):
    """What `snakemake SCENE` makes."""
    folder = f"results/{scene}"
    return [
        f"{folder}/facts.json",
        f"{folder}/tables/misalignment.csv",
        f"{folder}/tables/misalignment.tex",
        f"{folder}/tables/round_times.csv",
        f"{folder}/tables/round_times.tex",
        f"{folder}/tables/controls.csv",
        f"{folder}/tables/controls.tex",
        *ranking_tables(scene),
        f"{folder}/tables/displacement.csv",
        f"{folder}/tables/displacement.tex",
        f"{folder}/figures/flow.png",
        f"{folder}/figures/rounds.png",
        f"{folder}/figures/views.png",
        f"{folder}/figures/lengths.png",
        f"{folder}/figures/curves.png",
        *crop_figures(scene),
    ]
