"""Tables across scenes: what each scene is like, and the rows of each table."""

import hashlib
from collections.abc import Callable
from typing import NamedTuple

from alignerf.captures import base
from alignerf.experiment import layout
from alignerf.experiment.step import words
from alignerf.experiment.tables import rows
from alignerf.io import faults, json_files


class Scene(NamedTuple):
    """A scene's settings, and the keys by which tables pool scenes.

    Keys are digests of the settings, equal for scenes that are pooled. like: without
    the seed. alike: without seed and length of training. capture: without seed, length
    and the photos' size. motion_m: None where the truth is not known. steps: None where
    the length is in minutes. share: the length over that of the config's training; None
    where one is in steps, the other in minutes. reference: the method that the training
    of the reference's round 0 is named after.
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


# Settings that `Scene.alike` leaves out, and those that `Scene.capture` leaves out.
LENGTH = ("seed", "steps", "budget_min")
SIZE = (*LENGTH, "downscale", "images")


def of_experiment(experiment):
    """The `Scene` of each scene in the config."""
    return [of_scene(experiment, name) for name in experiment.captures()]


def of_scene(experiment, name):
    """The `Scene` of one scene; motion_m is known for a synthetic scene only."""
    scene = experiment.scenes[name]
    motion_m = None
    if base.of(scene).has_truth:
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
        share=length_fraction(experiment, name),
        reference=experiment.at(name, reference, 0).owner,
    )


def without(scene, *keys):
    """A key, equal for scenes whose settings are, but for some of them.

    A digest: the settings of a hundred scenes are too long for a command line.
    """
    settings = json_files.canonical(
        {key: scene[key] for key in scene if key not in keys}
    )
    return hashlib.sha256(settings.encode()).hexdigest()[:16]


def capture_of(scene):
    """A key, equal for scenes of the same photos at different sizes.

    The pose error `perturb_px` is in pixels of the training size. The key has it in
    pixels of the full size, where an equal angle is an equal number.
    """
    if scene["downscale"] != "auto":
        scaled = {"perturb_px": scene["perturb_px"] * scene["downscale"]}
        scene = scene | scaled
    return without(scene, *SIZE)


def length_fraction(experiment, scene):
    """A scene's length of training over the config's; None where the units differ."""
    own, whole = experiment.scenes[scene], experiment.config["training"]
    key = "steps" if whole["steps"] else "budget_min"
    return own[key] / whole[key] if own[key] else None


def compared(experiment):
    """All `Scene`s, for the comparison (the paper's Tables 2 and 3).

    Raises ValueError where a scene's length is in steps and the config's in minutes, or
    the other way round.
    """
    found = of_experiment(experiment)
    key = "steps" if experiment.config["training"]["steps"] else "budget_min"
    for scene in found:
        if scene.share is None:
            where = f"config: scenes.{scene.scene}"
            raise ValueError(f"{where}: training has {key}, the scene not")
    return found


def regimes(experiment):
    """All `Scene`s, for the table of regimes.

    Raises ValueError where the config has no staged method, or no baseline for it.
    """
    regime_base(experiment)
    return of_experiment(experiment)


def regime_base(experiment):
    """The name of the method that is the baseline of all staged methods."""
    staged = experiment.names("in_crops")
    base = {experiment.baseline(method) for method in staged}
    if len(base) != 1 or base & set(staged):
        raise ValueError(
            "config: methods: regimes need methods with alignerf or aligned_loss, and "
            "one without"
        )
    return next(iter(base))


def in_regimes(experiment, scene):
    """(method, round) of every row: the baseline, the staged methods, warping rounds.

    Warping rounds are those of the baseline, and of warm methods that start from the
    baseline. Staged methods should reach the scores of warping rounds at less cost.
    """
    base = regime_base(experiment)
    warm = experiment.names("goes_on")
    going_on = [method for method in warm if experiment.baseline(method) == base]
    return [
        *((method, 0) for method in (base, *experiment.names("in_crops"))),
        *(
            (method, round)
            for method in (base, *going_on)
            for round in range(1, experiment.last_round(scene, method) + 1)
        ),
    ]


def remedies(experiment):
    """All `Scene`s, for the table of remedies.

    Raises ValueError where methods have several models or `rounds: auto`, and where a
    scene lacks a twin that is trained as long as the config's `training`.
    """
    trained = {name: experiment.methods[name] for name in experiment.trained()}
    if len({method["model"] for method in trained.values()}) > 1:
        raise ValueError("config: methods: target remedies needs one model for all")
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
    """The name of the plain method that all fixes are compared with."""
    return experiment.baseline(experiment.trained()[0])


def in_remedies(experiment, scene):
    """(method, round) of every row: the plain training, each method's last round."""
    last = [(name, experiment.methods[name]["rounds"]) for name in experiment.trained()]
    return list(dict.fromkeys([(remedy_base(experiment), 0), *last]))


def rows_of(experiment, scene, table):
    """The `Row`s of a table, and of the trainings that lead to them.

    table: the folder's name with a slash, of a table across scenes; "" for the scene's
    own tables.
    """
    if not table:
        return rows.of_scene(experiment, scene)
    name = table.removesuffix("/")
    chosen = OF_TABLES[name](experiment, scene)
    every = rows.collected(experiment, scene, chosen, aligned_pose=name != "regimes")
    if name == "remedies":
        # The first row also has the flow from renders to photos: of the training views,
        # where that exists; else of the test views.
        first = next(row for row in every if (row.method, row.round) == chosen[0])
        split = experiment.splits(scene, first.folder)[0]
        at = layout.training(scene, first.folder)
        first.files["displacement"] = at.lengths(split)
    return every


# (method, round) of every row of a table across scenes, in its folder below a scene's.
OF_TABLES = {
    "regimes": in_regimes,
    "remedies": in_remedies,
    "comparison": lambda experiment, scene: experiment.scored(scene),
}


class Across(NamedTuple):
    """A table across scenes: a rule, and a target of its name.

    scenes: from the experiment to its `Scene`s; ValueError for a config of which there
    is no such table. of: whose rows it has, of OF_TABLES. reads: files of each scene
    that it reads besides. stem: what its files are called. beside: option and suffix of
    what is made beside the table. more: options of its own. published: files beside the
    sources. about: what it makes, in a line.
    """

    name: str
    about: str
    scenes: Callable
    of: str
    stem: str
    reads: tuple = ()
    beside: tuple[str, str] = ("figure", ".png")
    more: tuple = ()
    published: tuple = ()

    @property
    def module(self):
        """The command."""
        return f"alignerf.tables.across.{self.name}"

    def inputs(self, experiment):
        """Outputs of rules that it waits for."""
        names = (f"{self.of}/scores.csv", f"{self.of}/trainings.csv", *self.reads)
        found = faults.or_exit(self.scenes, experiment)
        return [f"{layout.Scene(one.scene)}/{name}" for one in found for name in names]

    def options(self, experiment):
        """Words of its command line."""
        found = faults.or_exit(self.scenes, experiment)
        return ["--scenes", rows.as_json(found), *self.more]

    def configs(self, experiment):
        """The scenes' complete configs."""
        return [layout.Scene(name).config for name in experiment.captures()]


def across(experiment):
    """All tables across scenes."""
    published, number = rows.published_table(), experiment.config["published_table"]
    printed = words("", published=published, published_table=number)[1:]
    return [
        Across(
            *("regimes", "Make the table of when each part of AligNeRF pays"),
            *(regimes, "regimes", experiment.config["regimes"]),
            reads=("testset/displacement.csv",),
        ),
        Across(
            *("remedies", "Compare all fixes at equal training time"),
            *(remedies, "remedies", "remedies"),
            reads=("facts.json",),
        ),
        Across(
            *("tradeoff", "Compare what settings cost with what they bring"),
            *(compared, "comparison", "tradeoff"),
        ),
        Across(
            *("comparison", "Compare all methods on all scenes: Tables 2 and 3"),
            *(compared, "comparison", "comparison"),
            beside=("ranking", "_ranking.csv"),
            more=tuple(printed),
            published=(published,),
        ),
    ]
