"""What tables across scenes are told of each scene, and what stands in them."""

from typing import NamedTuple

from alignerf.experiment import kinds, slices, sweep
from alignerf.experiment.keys import scene as scene_keys
from alignerf.experiment.tables import rows
from alignerf.experiment.trainings import DISPLACED, RENDERED


class Scene(NamedTuple):
    """What a scene is like, and how long it is trained.

    like: all but the seed, and alike: all but seed and length of training; equal for
    scenes that are pooled. capture: all but these and the photos' size. motion_m: None
    where the truth is not known. steps: None where it has minutes. share: its length
    over that of the config's training; None where they do not compare. reference: the
    method by whose name the reference's round 0 is trained.
    """

    scene: str
    seed: int
    like: str
    alike: str
    capture: str
    perturb_px: int | float
    motion_m: int | float | None
    steps: int | None
    share: int | float | None
    reference: str


# What scenes of the same remedies may differ in, and those of one capture besides.
LENGTH = ("seed", "steps", "budget_min")
SIZE = (*LENGTH, "downscale", "images")


def of_experiment(experiment):
    """A `Scene` each."""
    return [of_scene(experiment, name) for name in experiment.scenes]


def of_scene(experiment, name):
    """How its objects move is known of a made scene only."""
    scene = experiment.scenes[name]
    motion_m = None
    if scene_keys.SOURCES[scene["source"]].has_truth:
        motion = scene["courtyard"]
        motion_m = (motion["motion"] != "none") * motion["motion_m"]
    reference = experiment.config["reference"]["method"]
    return Scene(
        scene=name,
        seed=scene["seed"],
        like=without(scene, "seed"),
        alike=without(scene, *LENGTH),
        capture=capture_of(scene),
        perturb_px=scene["perturb_px"],
        motion_m=motion_m,
        steps=scene["steps"],
        share=length_share(experiment, name),
        reference=experiment.at(name, reference, 0).owner,
    )


def without(scene, *keys):
    """A scene's other keys, as text."""
    return slices.as_json({key: scene[key] for key in scene if key not in keys})


def capture_of(scene):
    """What it has in common with the same photos of other sizes.

    An error of the poses is told in pixels of the training size; the angle counts.
    """
    if scene["downscale"] != "auto":
        scaled = {"perturb_px": scene["perturb_px"] * scene["downscale"]}
        scene = scene | scaled
    return without(scene, *SIZE)


def length_share(experiment, scene):
    """How long a scene is trained, over how long the config's training is."""
    own, whole = experiment.scenes[scene], experiment.config["training"]
    key = "steps" if whole["steps"] else "budget_min"
    return own[key] / whole[key] if own[key] else None


def compared(experiment):
    """`Scene`s that have a length of the config's kind: of the paper's Tables 2 and 3.

    Raises ValueError naming one without.
    """
    found = of_experiment(experiment)
    key = "steps" if experiment.config["training"]["steps"] else "budget_min"
    for scene in found:
        if scene.share is None:
            where = f"config: scenes.{scene.scene}"
            raise ValueError(f"{where}: training has {key}, the scene not")
    return found


def regimes(experiment):
    """`Scene`s of a config that has a baseline and methods that are set against it.

    Raises ValueError for a config without them.
    """
    regime_base(experiment)
    return of_experiment(experiment)


def regime_base(experiment):
    """The baseline of all staged methods."""
    staged = experiment.names(kinds.staged)
    base = {experiment.baseline(method) for method in staged}
    if len(base) != 1 or base & set(staged):
        raise ValueError(
            "config: methods: regimes need methods with alignerf, and one without"
        )
    return next(iter(base))


def in_regimes(experiment, scene):
    """(method, round) of every row: the baseline, the staged methods, warped photos.

    Trainings on these, of the baseline and then from its weights, are what the staged
    methods are to reach at less cost.
    """
    base = regime_base(experiment)
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


def remedies(experiment):
    """`Scene`s of a config whose methods can be compared at equal time.

    Raises ValueError for one whose methods cannot, and for scenes without the
    training's own length.
    """
    trained = {name: experiment.methods[name] for name in experiment.trained()}
    if len({method["model"] for method in trained.values()}) > 1:
        raise ValueError("config: methods: remedies need one model for all")
    for name, method in trained.items():
        if method["rounds"] == "auto":
            where = f"config: methods.{name}.rounds"
            raise ValueError(f"{where}: remedies need a number, not auto")
    found = compared(experiment)
    whole = {(scene.alike, scene.seed) for scene in found if scene.share == 1}
    for scene in found:
        if (scene.alike, scene.seed) not in whole:
            raise ValueError(
                f"config: scenes.{scene.scene}: it is never trained as long as "
                "`training` says, see vary.lengths"
            )
    return found


def remedy_base(experiment):
    """The plain training, before all others."""
    return experiment.baseline(experiment.trained()[0])


def in_remedies(experiment, scene):
    """(method, round): the plain training, and every method's last round."""
    last = [(name, experiment.methods[name]["rounds"]) for name in experiment.trained()]
    return list(dict.fromkeys([(remedy_base(experiment), 0), *last]))


def of_sweep(experiment, scene):
    """A `Row` per variant, the base first; it is called by its variant."""
    return [
        rows.Row(
            *(training.folder, [training.folder], [], []),
            {
                "scores": f"{training.path}/metrics.csv",
                "timing": f"{training.path}/{rows.TIMING}",
                "render_test": rows.report(training.path, RENDERED, "test"),
            },
            method=training.folder.partition("/")[2],
            round=0,
            base="tradeoff/base",
        )
        for training in sweep.trainings(experiment, scene)
    ]


def rows_of(experiment, scene, table):
    """Rows of a table across scenes, and what leads to them; "": of all of a scene's.

    table: the name of its folder, with a slash behind it.
    """
    if not table:
        return rows.of_scene(experiment, scene)
    return OF_TABLES[table](experiment, scene)


def of_regimes(experiment, scene):
    """Rows of `in_regimes`."""
    return rows.collected(experiment, scene, in_regimes(experiment, scene))


def of_comparison(experiment, scene):
    """Rows of all that is scored."""
    chosen = experiment.scored(scene)
    return rows.collected(experiment, scene, chosen, aligned_pose=True)


def of_remedies(experiment, scene):
    """Rows of `in_remedies`; of the first how far its renders are off the photos."""
    chosen = in_remedies(experiment, scene)
    every = rows.collected(experiment, scene, chosen, aligned_pose=True)
    base = next(row for row in every if (row.method, row.round) == chosen[0])
    # Of training views, where it has these.
    split = experiment.splits(scene, base.folder)[0]
    path = f"results/{scene}/{base.folder}"
    base.files["displacement"] = rows.report(path, DISPLACED, split)
    return every


OF_TABLES = {
    "regimes/": of_regimes,
    "remedies/": of_remedies,
    "comparison/": of_comparison,
    "tradeoff/": of_sweep,
}


def files(scene, table):
    """The files that the rows of a table across scenes are collected in."""
    folder = f"results/{scene}/{table}"
    return [f"{folder}/scores.csv", f"{folder}/trainings.csv"]
