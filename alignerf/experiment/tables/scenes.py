"""Tables across scenes: what each scene is like, and the rows of each table."""

import hashlib
import types
from typing import NamedTuple

from alignerf.experiment import layout
from alignerf.experiment.step import words
from alignerf.experiment.tables import rows
from alignerf.io import faults, json_files


class Scene(NamedTuple):
    """A scene's settings, and the keys by which tables pool scenes.

    alike: a digest of the settings but for seed and length of training, equal for
    scenes that are pooled. scene_steps: None where the length is in minutes. share: the
    length over that of the config's training; None where one is in steps, the other in
    minutes. reference: the method that the training of the reference's round 0 is named
    after.
    """

    scene: str
    seed: int
    alike: str
    perturb_px: int | float
    scene_steps: int | None
    share: int | float | None
    reference: str


# Settings that `Scene.alike` leaves out.
LENGTH = ("seed", "steps", "budget_min")


def of_experiment(experiment, names=None):
    """The `Scene` of each capture in the config, or of these scenes."""
    return [of_scene(experiment, name) for name in names or experiment.captures()]


def of_scene(experiment, name):
    """The `Scene` of one scene."""
    scene = experiment.scenes[name]
    reference = experiment.config.reference.method
    usual = None if scene.budget_min else experiment.config.training.whole
    return Scene(
        scene=name,
        seed=scene.seed,
        alike=alike(scene),
        perturb_px=scene.perturb_px,
        scene_steps=scene.steps or usual,
        share=experiment.share(name),
        reference=experiment.at(name, reference, 0).owner,
    )


def alike(scene):
    """A digest: the settings of a hundred scenes are too long for a command line."""
    settings = json_files.canonical(scene.model_dump(exclude={*LENGTH, *scene.foreign}))
    return hashlib.sha256(settings.encode()).hexdigest()[:16]


def compared(experiment, names=None):
    """All `Scene`s, or these, for the comparison.

    Raises ValueError where a scene's length is in steps and the config's in minutes, or
    the other way round.
    """
    found = of_experiment(experiment, names)
    key = "budget_min" if experiment.config.training.budget_min else "steps"
    for scene in found:
        if scene.share is None:
            where = f"config: scenes.{scene.scene}"
            raise ValueError(f"{where}: training has {key}, the scene not")
    return found


def printed(experiment):
    """The same of a table of the paper: crops stand for the scenes that they are of."""
    found = compared(experiment, list(experiment.scenes))
    cropped = {one.alike for one in found if experiment.crops(one.scene)}
    return [one for one in found if one.alike not in cropped]


def in_arm(experiment, scene):
    """(method, 0) of every row: where poses are right, methods that leave them so.

    The paper's NeRF has the true poses. BARF, which learns poses, has perturbed ones.
    """
    wrong = experiment.scenes[scene].perturb_px > 0
    return [
        (name, 0)
        for name in experiment.methods
        if ("cameras" in experiment.moves(name)) == wrong
    ]


def rows_of(experiment, scene, table):
    """The `Row`s of a table, and of the trainings that lead to them.

    table: the folder's name with a slash, of a table across scenes; "" for the scene's
    own tables.
    """
    if not table:
        return rows.of_scene(experiment, scene)
    name = table.removesuffix("/")
    chosen = OF_TABLES[name](experiment, scene)
    every = rows.collected(experiment, scene, chosen, aligned_pose=True)
    if name == "arm":
        # Its baseline is of another scene: each row is set against itself.
        own = [r._replace(base=r.folder, baseline=r.method) for r in every if r.method]
        every = [*(row for row in every if not row.method), *own]
    return every


# (method, round) of every row of a table across scenes, in its folder below a scene's.
OF_TABLES = {
    "comparison": lambda experiment, scene: experiment.all_rounds(scene),
    "arm": in_arm,
}


BESIDE = {"comparison": {"ranking": "_ranking.csv", "effects": "_effects.csv"}}
ABOUT = {
    "comparison": "Compare all methods on all scenes",
    "tradeoff": "Compare what settings cost with what they bring",
    "arm": "Compare NeRF and BARF on a moving arm",
}


class Across(NamedTuple):
    """A table across an experiment's scenes: a rule, and a target of its name.

    kind: of `alignerf.tabulate`. number: of the paper's table that it is beside.
    chosen: scenes that it is narrowed to; none: all.
    """

    name: str
    kind: str
    experiment: object
    number: int | None = None
    chosen: tuple = ()

    @property
    def about(self):
        """What it is for."""
        of_paper = f"Make Table {self.number} of the paper, with its rows beside ours"
        return ABOUT.get(self.name, of_paper)

    @property
    def beside(self):
        """{what: ending} of what is made beside it."""
        return BESIDE.get(self.kind, {"figure": ".png"})

    @property
    def published(self):
        """Files beside the sources."""
        return [rows.published_table()] if self.kind == "comparison" else []

    @property
    def found(self):
        """The `Scene`s that it has; ends the process where there is no such table."""
        scenes = compared if self.name in ABOUT else printed
        every = faults.or_exit(scenes, self.experiment)
        return [one for one in every if not self.chosen or one.scene in self.chosen]

    @property
    def inputs(self):
        """Outputs of rules that it waits for."""
        of = "arm" if self.kind == "arm" else "comparison"
        names = [f"{of}/scores.csv", f"{of}/trainings.csv"]
        names += ["cameras.npz"] * (self.kind == "comparison")
        return [f"{layout.Scene(o.scene)}/{name}" for o in self.found for name in names]

    @property
    def command(self):
        """The command that makes it."""
        return words(
            "alignerf.tabulate",
            table=self.kind,
            scenes=rows.as_json(self.found),
            out=f"{layout.RESULTS}/{self.name}",
            configs=self.configs,
            published=self.published,
            published_table=self.number,
        )

    @property
    def configs(self):
        """The scenes' complete configs."""
        return [layout.Scene(one.scene).config for one in self.found]

    def files(self):
        """What it makes: the table as CSV and LaTeX, and what lies beside."""
        ends = (".csv", ".tex", ".provenance.json", *self.beside.values())
        return [f"{layout.RESULTS}/{self.name}{end}" for end in ends]


# Tables of an experiment by its name; "" is the config that runs.
KINDS = {"": ("tradeoff", "comparison"), "figures": ("arm",), "tradeoff": ("tradeoff",)}


def across(experiments, narrowed=types.MappingProxyType({})):
    """All tables across scenes of `plan.Experiments`; narrowed: {table: its scenes}."""
    found = {}
    for name, experiment in experiments.by_name.items():
        number = experiment.config.published_table
        kinds = {kind: kind for kind in KINDS.get(name, ())}
        if number:
            kinds[name or f"table{number}"] = "comparison"
        for table, kind in kinds.items():
            chosen = tuple(narrowed.get(table, ()))
            of = number if kind == "comparison" else None
            found[table] = Across(table, kind, experiment, of, chosen)
    return list(found.values())
