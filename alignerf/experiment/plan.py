"""An experiment: its methods, and the trainings of each method, round by round.

Notation: round 0 of a method trains on the photos as taken. Round k trains on photos
that the flow of round k - 1 warped, or with cameras that this flow corrected.
"""

import functools
import importlib
import itertools
import json
import re

from alignerf import methods
from alignerf.captures import base
from alignerf.experiment import jobs, layout, trainings
from alignerf.io import json_files
from alignerf.io.environment import extensions


def kept(method):
    """A cached method of `Experiment`: one computation for equal arguments.

    A plan of many scenes calls a method millions of times with equal arguments.
    """

    @functools.wraps(method)
    def once(self, *arguments):
        key = (method.__name__, *arguments)
        if key not in self.known:
            self.known[key] = method(self, *arguments)
        return self.known[key]

    return once


class Experiment:
    """A config as `check.checked` returns it, and what follows from it.

    Neither the config nor the result of a cached method changes later.
    """

    def __init__(self, config):
        self.config = config
        self.methods = config.methods
        self.scenes = config.scenes
        self.known = {}
        # Methods whose trainings are being made.
        self.making = set()

    def of(self, scene):
        """The experiment of a scene, as of `Experiments`."""
        return self

    @kept
    def names(self, what, known=True):
        """Methods whose record has an attribute (or not), in the config's order."""
        of = methods.of_method
        return [n for n, m in self.methods.items() if getattr(of(m), what) == known]

    @kept
    def in_order(self):
        """All methods, plain methods first.

        A training that several methods share is named after the first of them.
        """
        return self.names("from_scratch") + self.names("from_scratch", False)

    @kept
    def baseline(self, method):
        """The method whose round 0 is the baseline of a method in tables."""
        return methods.of_method(self.methods[method]).baseline(self, method)

    def moves(self, method, round=None):
        """What a method has changed by a round, see `methods.moves`."""
        return methods.moves(self.methods[method], round)

    @kept
    def rounds_of(self, scene, method):
        """A method's trainings in a scene, round 0 first; equal trainings are shared.

        The trainings of methods earlier in `in_order` are always made first, so the
        name of a shared training does not depend on the order of calls.
        """
        for name in itertools.takewhile(lambda name: name != method, self.in_order()):
            self.rounds_of(scene, name)
        equal = self.known.setdefault(("equal", scene), {})

        def once(training):
            return equal.setdefault(training.value, training)

        if method in self.making:
            what = "it sets itself against a plain method of its model: there is none"
            raise ValueError(f"config: methods.{method}: {what}")
        self.making.add(method)
        try:
            record = methods.of_method(self.methods[method])
            return record.trainings(self, scene, method, once)
        finally:
            self.making.discard(method)

    @kept
    def trainings(self, scene):
        """{folder: training} of a scene, in an order in which trainings can run."""
        chains = [self.rounds_of(scene, method) for method in self.methods]
        needed = (one for t in itertools.chain(*chains) for one in trainings.lead_to(t))
        return {training.folder: training for training in needed}

    def training(self, scene, folder):
        """The training of a folder below a scene's."""
        return self.trainings(scene)[folder]

    def at(self, scene, method, round):
        """The training of a method's round."""
        return self.rounds_of(scene, method)[int(round)]

    def folder(self, scene, method, round):
        """Path results/SCENE/... of a method's round.

        A shared training lies in the folder of another method.
        """
        return self.at(scene, method, round).path

    @kept
    def splits(self, scene, folder):
        """The splits whose views are rendered after a training, with their flow.

        `train` for the trainings in `followed`; `test` for all but pre-trainings.
        """
        splits = ["train"] * (folder in self.followed(scene))
        splits += ["test"] * (not folder.startswith("pretrain/"))
        rendered = self.capture(scene).splits(self.scenes[scene])
        return [split for split in splits if split in rendered]

    @kept
    def followed(self, scene):
        """Folders of the trainings whose training views are rendered, with flow.

        Another training needs the flow, or the verdict does: if the config has an
        aligned method or crops, the flow after the reference's round 0 shows how
        misaligned the photos are. Of an external reference this is always wanted.
        """
        every = self.trainings(scene).values()
        folders = {before.folder for training in every for before in training.flows}
        judged = self.parent(scene) or self.crops(scene)
        others = self.config.reference.method not in self.names("ours")
        if judged or others or self.names("in_loop"):
            folders.add(self.judged_folder(scene).name)
        return folders

    def all_rounds(self, scene):
        """(method, round) of every training that is scored, in the config's order.

        A shared training is listed once, under the method that it is named after.
        """
        return [
            (name, k)
            for name in self.methods
            if self.is_scored(scene, name)
            for k in range(self.methods[name].rounds + 1)
            if self.at(scene, name, k).folder == f"{name}/round{k}"
        ]

    def is_scored(self, scene, method):
        """Whether a method has a row at a scene's length of training."""
        lengths, share = self.methods[method].lengths, self.share(scene)
        return lengths is None or share is None or share in lengths

    def share(self, scene):
        """A scene's length of training over the config's; None where units differ."""
        own, whole = self.scenes[scene], self.config.training
        if whole.budget_min:
            return own.budget_min and own.budget_min / whole.budget_min
        return (own.steps or whole.whole) / whole.whole if not own.budget_min else None

    def reference_round(self, scene):
        """The round whose renders the warped test set is made from."""
        reference = self.config.reference
        if reference.round == "last":
            return self.methods[reference.method].rounds
        return reference.round

    def reference_folder(self, scene, round=None):
        """Folder of the reference model, or of another of its method's rounds."""
        if round is None:
            round = self.reference_round(scene)
        return self.folder(scene, self.config.reference.method, round)

    def capture(self, scene):
        """The record of a scene's source."""
        return base.of(self.scenes[scene])

    def source_of(self, scene):
        """The module of the record of a scene's source."""
        return type(base.every()[self.scenes[scene].source]).__module__

    def records_of(self, training):
        """Modules of the records that a training runs: of its method, and its own."""
        method = self.methods.get(training.owner)
        of_method = methods.parts_of(method) if method else []
        return [*training.records, *(type(one).__module__ for one in of_method)]

    def parent(self, scene):
        """The scene that a scene's crops are of; None of other scenes."""
        return self.capture(scene).parent(self.scenes[scene])

    def captures(self):
        """Scenes that stand for themselves: all but crops of another scene."""
        return [name for name in self.scenes if not self.parent(name)]

    def judged(self, known=True):
        """Scenes whose renders another program has made, and are judged (or not)."""
        return [n for n in self.scenes if self.capture(n).trains != known]

    def crops(self, scene):
        """The scenes of crops by which a scene is judged, as given first."""
        return [name for name in self.scenes if self.parent(name) == scene]

    def cameras_by(self, scene):
        """The method whose cameras crops have; None: as given."""
        return self.capture(scene).cameras_by(self.scenes[scene])

    def judged_folder(self, scene):
        """Folder of the training that a scene is judged by: the reference's round 0.

        Of crops that of its baseline, which leaves the cameras as they are.
        """
        method = self.config.reference.method
        if self.parent(scene):
            method = self.baseline(method)
        return self.folder(scene, method, 0)

    def has_truth(self, scene):
        """Whether a scene's truth is known; crops of another scene have none."""
        return self.capture(scene).has_truth

    def truth_of(self, scene):
        """The folder of a scene's truth, where that is known."""
        return layout.Scene(scene).truth if self.has_truth(scene) else None


class Experiments:
    """Experiments of different scenes, as one plan.

    by_name: {name: Experiment}; "" is the config that runs, another name the target
    that an experiment belongs to. A user's config has no others beside it.
    """

    def __init__(self, by_name):
        self.by_name = by_name
        self.scenes, self.methods = {}, {}
        for name, one in by_name.items():
            for scene in one.scenes.keys() & self.scenes.keys():
                raise ValueError(f"config: scenes.{scene}: {name} has one of this name")
            self.scenes |= dict.fromkeys(one.scenes, one)
            self.methods |= one.methods

    def of(self, scene):
        """The experiment of a scene."""
        return self.scenes[scene]

    def captures(self, names=("",)):
        """Captures of the experiments of these names, of those that there are."""
        known = [self.by_name[name] for name in names if name in self.by_name]
        return [scene for one in known for scene in one.captures()]


def scene_config(experiment, name):
    """What the poses of a scene depend on: not how long it is trained."""
    scene = experiment.scenes[name]
    capture = experiment.capture(name)
    unused = {"steps", "budget_min"} | scene.foreign
    if scene.poses == "truth" and not scene.triangulate:
        unused.add("colmap")
    # Where a `false` changes what is done, the stage has to be told.
    undecided = scene.model_copy(update={"triangulate": None})
    if not (capture.wants_matches(scene) or capture.wants_matches(undecided)):
        unused.add("triangulate")
    if experiment.parent(name):
        unused |= {"test_every", "perturb_px", "perturb_by", "colmap"}
    optional = ("masks", "crop", "pose_convention", "perturb_by")
    unused |= {key for key in optional if getattr(scene, key) == scene.default(key)}
    return json_files.canonical(scene.model_dump(exclude=unused))


def complete_config(experiment, name):
    """The whole config of a scene, as it could be run alone."""
    parent = experiment.parent(name) or name
    found = {one: experiment.scenes[one] for one in (parent, *experiment.crops(parent))}
    # A new record changes nothing that was made without it.
    unused = {
        "scenes": {one: scene.foreign for one, scene in found.items()},
        "methods": {one: methods.unused(m) for one, m in experiment.methods.items()},
    }
    found = experiment.config.model_copy(update={"scenes": found})
    # The order of models and methods has a meaning: tables and defaults follow it.
    unused |= {"small": True, "full_size": True}
    return json.dumps(found.model_dump(exclude=unused))


def folders(experiments):
    """Regular expression of all folders below a scene's that are trained or scored."""
    names = set()
    for one in experiments:
        names |= set(one.trainings(next(iter(one.scenes))))
    return one_of(names)


def check_equal(experiment):
    """Raise ValueError where two methods have the same trainings.

    The second method would have no row in any table.
    """
    scene, first = next(iter(experiment.scenes)), {}
    for name in experiment.methods:
        rounds = tuple(t.folder for t in experiment.rounds_of(scene, name))
        if rounds in first:
            what = f"the same as methods.{first[rounds]}: trained once, it has one name"
            raise ValueError(f"config: methods.{name}: {what}")
        first[rounds] = name


def check_lengths(experiment):
    """Raise ValueError for lengths that no scene has, or the baseline lacks."""
    for name in experiment.methods:
        at = [one for one in experiment.scenes if experiment.is_scored(one, name)]
        where = f"config: methods.{name}.lengths"
        if not at:
            raise ValueError(f"{where}: no scene is trained for any of these")
        base = experiment.baseline(name)
        if not all(experiment.is_scored(one, base) for one in at):
            raise ValueError(f"{where}: {base}, its baseline, lacks some of them")


# Parts whose losses the tests of the program trace.
OF_PROGRAM = ("alignerf.alignment.", "alignerf.contributions.")


def check_losses(experiment):
    """Raise ValueError where a part of one's own fails, as by a wrong shape.

    Before anything runs, and by shapes alone.
    """
    scene = next(iter(experiment.scenes))
    for name in experiment.names("ours"):
        for one in experiment.rounds_of(scene, name):
            if one.job.part and not one.job.part.startswith(OF_PROGRAM):
                values = one.job.model_dump() | {"decisions": None}
                # A plan of other methods waits for no JAX.
                compose = importlib.import_module("alignerf.training.compose")
                job = jobs.parse(values)
                _, reason = extensions.tried(compose.trace, job)
                if reason:
                    raise ValueError(f"config: methods.{name}: its loss: {reason}")


def one_of(names):
    """Regular expression of these names; of none, it matches nothing."""
    return letters(sorted(names)) or r"(?!)"


def letters(names):
    """Regular expression of sorted names, as a prefix tree; "" for no names.

    Snakemake matches every file with many expressions. In an alternation of whole
    names the time of a match grows with the number of names; in a prefix tree not.
    """
    parts = []
    for letter, group in itertools.groupby(names, key=lambda name: name[:1]):
        parts.append(re.escape(letter) + letters([name[1:] for name in group if name]))
    return parts[0] if len(parts) == 1 else f"(?:{'|'.join(parts)})" if parts else ""
