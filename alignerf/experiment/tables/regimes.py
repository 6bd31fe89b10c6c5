"""What stands in the table of regimes (the paper's Table 4 is one of its blocks)."""

from typing import NamedTuple

from alignerf.experiment import kinds, slices, trainings
from alignerf.experiment.keys import scene as scene_keys
from alignerf.experiment.tables import rows


class Method(NamedTuple):
    """A method after a round, its scores, and what it took."""

    method: str
    round: int
    # Its field, and the contributions that it has, in words.
    parts: str
    metrics: str
    trainings: list[str]
    data: list[str]
    # Scores of cameras moved to fit the photos, where a table shows them.
    aligned_pose: str | None = None


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
    staged = experiment.names(kinds.staged)
    base = {experiment.baseline(method) for method in staged}
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
                    parts=rows.describe_method(experiment, method),
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
    warm = experiment.names(kinds.warm)
    going_on = [method for method in warm if experiment.baseline(method) == base]
    return [
        *((method, 0) for method in (base, *experiment.names(kinds.staged))),
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
    if scene_keys.SOURCES[scene["source"]].has_truth:
        motion = scene["courtyard"]
        motion_m = (motion["motion"] != "none") * motion["motion_m"]
    return {
        "seed": scene["seed"],
        "alike": slices.as_json({key: scene[key] for key in scene if key != "seed"}),
        "perturb_px": scene["perturb_px"],
        "motion_m": motion_m,
        "steps": scene["steps"],
    }


# What scenes of the same remedies may differ in, and those of one capture besides.
LENGTH = ("seed", "steps", "budget_min")
SIZE = (*LENGTH, "downscale", "images")


def alike_of(scene):
    """What a scene has in common with those that differ in seed and length only."""
    return slices.as_json({key: scene[key] for key in scene if key not in LENGTH})


def capture_of(scene):
    """What it has in common with the same photos of other sizes.

    An error of the poses is told in pixels of the training size; the angle counts.
    """
    found = {key: scene[key] for key in scene if key not in SIZE}
    if scene["downscale"] != "auto":
        found["perturb_px"] = scene["perturb_px"] * scene["downscale"]
    return slices.as_json(found)


class Remedies(NamedTuple):
    """What a scene is like, and each remedy at one length of training."""

    scene: str
    seed: int
    # All but seed and length: equal for scenes whose times are set side by side.
    alike: str
    # All but its photos' size, too: equal for scenes of one capture.
    capture: str
    # JSON of what its photos are like, and CSV of how far the plain training is off.
    facts: str
    displacement: str
    # Its length over that of the config's training.
    share: int | float
    # The plain training first.
    methods: list[Method]


def remedies(experiment):
    """One row per scene: the plain training, and every method's last round.

    Raises ValueError for methods that cannot be compared, and scenes without the
    training's own length.
    """
    trained = {name: experiment.methods[name] for name in experiment.trained()}
    if len({method["model"] for method in trained.values()}) > 1:
        raise ValueError("config: methods: remedies need one model for all")
    for name, method in trained.items():
        if method["rounds"] == "auto":
            where = f"config: methods.{name}.rounds"
            raise ValueError(f"{where}: remedies need a number, not auto")
    base = experiment.baseline(next(iter(trained)))
    last = {name: method["rounds"] for name, method in trained.items()}
    chosen = dict.fromkeys([(base, 0), *last.items()])
    found = [
        Remedies(
            scene=scene,
            seed=like["seed"],
            alike=alike_of(like),
            capture=capture_of(like),
            facts=f"results/{scene}/facts.json",
            displacement=displacement_of(experiment, scene, base),
            share=length_share(experiment, scene),
            methods=[
                Method(
                    parts=rows.describe_method(experiment, method),
                    aligned_pose=rows.aligned_pose(experiment, scene, method, round),
                    **rows.of_method(experiment, scene, method, round),
                )
                for method, round in chosen
            ],
        )
        for scene, like in experiment.scenes.items()
    ]
    whole = {(row.alike, row.seed) for row in found if row.share == 1}
    for row in found:
        if (row.alike, row.seed) not in whole:
            raise ValueError(
                f"config: scenes.{row.scene}: it is never trained as long as "
                "`training` says, see vary.lengths"
            )
    return found


def displacement_of(experiment, scene, base):
    """CSV of how far the baseline is off: of training views, where it has these."""
    training = experiment.at(scene, base, 0)
    split = experiment.splits(scene, training.folder)[0]
    return f"{training.path}/{trainings.DISPLACED.format(split=split)}"


class Compared(NamedTuple):
    """A method after a round, what papers call it, and what its training held."""

    method: str
    round: int
    parts: str
    metrics: str
    trainings: list[str]
    data: list[str]
    # Whose round 0 all are set against.
    base: str
    aligned_pose: str | None = None
    published: str | None = None
    # Snakemake's benchmark of its training, beside the model.
    process: str | None = None


class Comparison(NamedTuple):
    """A scene, how long it is trained, and all that is scored."""

    scene: str
    # What scenes have in common that differ in seed and length only.
    alike: str
    seed: int
    # Its length over that of the config's training.
    share: int | float
    methods: list[Compared]


def comparison(experiment):
    """One row per scene, for the paper's Tables 2 and 3."""
    return [
        Comparison(
            scene=scene,
            alike=alike_of(found),
            seed=found["seed"],
            share=length_share(experiment, scene),
            methods=[
                compared(experiment, scene, method, round)
                for method, round in experiment.scored(scene)
            ],
        )
        for scene, found in experiment.scenes.items()
    ]


def compared(experiment, scene, method, round):
    """One method of a scene."""
    process = None
    if method not in experiment.names(kinds.external):
        process = f"{experiment.folder(scene, method, round)}/logs/train.tsv"
    return Compared(
        parts=rows.describe_method(experiment, method),
        base=reference_of(experiment, scene),
        aligned_pose=rows.aligned_pose(experiment, scene, method, round),
        # Of the method as it is; no table has one of its rounds.
        published=experiment.methods[method]["published"] if round == 0 else None,
        process=process,
        **rows.of_method(experiment, scene, method, round),
    )


def reference_of(experiment, scene):
    """The method by whose name the reference's round 0 is trained."""
    training = experiment.at(scene, experiment.config["reference"]["method"], 0)
    return training.owner


def length_share(experiment, scene):
    """How long a scene is trained, over how long the config's training is."""
    own, whole = experiment.scenes[scene], experiment.config["training"]
    key = "steps" if whole["steps"] else "budget_min"
    if not own[key]:
        raise ValueError(f"config: scenes.{scene}: training has {key}, the scene not")
    return own[key] / whole[key]
