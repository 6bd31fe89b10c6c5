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


class Remedies(NamedTuple):
    """What a scene is like, and each remedy at one length of training."""

    scene: str
    seed: int
    # All but seed and length: equal for scenes whose times are set side by side.
    alike: str
    # Its length over that of the config's training.
    share: int | float
    # The plain training first.
    methods: list[Method]


def remedies(experiment):
    """One row per scene: the plain training, and every method's last round.

    Raises ValueError for a config in which no scene has the training's own length.
    """
    base = experiment.base_of(next(iter(experiment.methods)))
    found = []
    for scene in experiment.scenes:
        last = {name: experiment.last_round(scene, name) for name in experiment.methods}
        chosen = dict.fromkeys([(base, 0), *last.items()])
        methods = [
            Method(
                parts=rows.field_name(experiment, method),
                **rows.of_method(experiment, scene, method, round),
            )
            for method, round in chosen
        ]
        like = experiment.scenes[scene]
        alike = {key: like[key] for key in like if key not in LENGTH}
        row = Remedies(
            scene=scene,
            seed=like["seed"],
            alike=slices.as_json(alike),
            share=length_share(experiment, scene),
            methods=methods,
        )
        found.append(row)
    if not any(row.share == 1 for row in found):
        raise ValueError("config: scenes: none is trained as long as `training` says")
    return found


# What scenes of the same remedies may differ in.
LENGTH = ("seed", "steps", "budget_min")


def length_share(experiment, scene):
    """How long a scene is trained, over how long the config's training is."""
    own, whole = experiment.scenes[scene], experiment.config["training"]
    key = "steps" if whole["steps"] else "budget_min"
    if not own[key]:
        raise ValueError(f"config: scenes.{scene}: training has {key}, the scene not")
    return own[key] / whole[key]
