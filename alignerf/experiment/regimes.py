"""What stands in the table of regimes (the paper's Table 4 is one of its blocks)."""

from typing import NamedTuple

from alignerf.experiment import rows, settings, slices


class Method(NamedTuple):
    """A method after a round, its scores, and what it took."""

    method: str
    round: int
    # Its field, and the contributions that it has, in words.
    parts: str
    metrics: str
    trainings: list[str]
    data: list[str]


class Regime(NamedTuple):
    """What a scene is like and how long it is trained; its methods, the base first."""

    scene: str
    seed: int
    # All but the seed: equal for scenes that are one regime.
    alike: str
    perturb_px: int | float
    # None where the truth is not known.
    motion_m: int | float | None
    # Of the baseline; None where it has minutes.
    steps: int | None
    # CSV of the warped test set's flow.
    displacement: str
    methods: list[Method]


def name(experiment):
    """What its files in results/ are called."""
    return experiment.config["regimes"]


def scenes(experiment):
    """One row per scene that has a baseline and what is set against it.

    Raises ValueError for a config without them.
    """
    staged = experiment.staged()
    base = {experiment.base_of(method) for method in staged}
    if len(base) != 1 or base & set(staged):
        raise ValueError(
            "config: methods: regimes need methods with alignerf, and one without"
        )
    return [
        Regime(
            scene=scene,
            **like(experiment, scene),
            displacement=f"results/{scene}/testset/displacement.csv",
            methods=[
                Method(
                    parts=rows.field_name(experiment, method),
                    **rows.of_method(experiment, scene, method, round),
                )
                for method, round in rounds(experiment, scene, *base)
            ],
        )
        for scene in experiment.scenes
    ]


def rounds(experiment, scene, base):
    """(method, round) of every row: the baseline, the staged methods, warped photos.

    Trainings on these, of the baseline and then from its weights, are what the staged
    methods are to reach at less cost.
    """
    going_on = [m for m in experiment.warm() if experiment.base_of(m) == base]
    return [
        *((method, 0) for method in (base, *experiment.staged())),
        *(
            (method, round)
            for method in (base, *going_on)
            for round in range(1, experiment.last_round(scene, method) + 1)
        ),
    ]


def like(experiment, name):
    """What a scene is like; how its objects move is known of a made one only."""
    scene = experiment.scenes[name]
    motion_m = None
    if settings.SOURCES[scene["source"]].has_truth:
        motion = scene["courtyard"]
        motion_m = (motion["motion"] != "none") * motion["motion_m"]
    return {
        "seed": scene["seed"],
        "alike": slices.as_json({key: scene[key] for key in scene if key != "seed"}),
        "perturb_px": scene["perturb_px"],
        "motion_m": motion_m,
        "steps": scene["steps"],
    }
