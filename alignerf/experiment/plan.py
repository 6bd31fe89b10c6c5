"""An experiment: its methods, the trainings that they come to, and their rounds.

Notation: a method's round 0 trains on the photos as taken, round k on those that round
k - 1 warped, or with cameras that its flow put right.
"""

import functools
import itertools
import re

from alignerf.experiment import kinds, sweep, trainings
from alignerf.experiment.keys import scene as scene_keys
from alignerf.files import json_files


def kept(method):
    """Of an experiment: made once for each of its arguments, then looked up.

    A plan of many scenes asks for the same millions of times. Not for what
    `decided` says, which is another when a checkpoint has run.
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

    The config does not change from then on, nor what the methods return.
    decided(scene=, method=, round=) says whether a method with `rounds: auto` trains
    another round after this one. It is asked only where nothing else says how many.
    """

    def __init__(self, config, decided):
        self.config = config
        self.decided = decided
        self.methods = config["methods"]
        self.scenes = config["scenes"]
        self.known = {}

    @kept
    def names(self, kind):
        """Methods of a kind, one of `kinds.EVERY`, in the config's order."""
        return [name for name, m in self.methods.items() if kinds.of_method(m) is kind]

    @kept
    def in_order(self):
        """All methods, plain ones first: equal trainings have the first one's name."""
        plain = self.names(kinds.plain)
        return [*plain, *(name for name in self.methods if name not in plain)]

    @kept
    def trained(self):
        """Methods that train something: all but another program's renders."""
        return [m for m in self.methods if m not in self.names(kinds.external)]

    @kept
    def baseline(self, method):
        """The method whose round 0 tables set a method against.

        The first plain one of the same model, which a plain one may be itself; of a
        warm one, where it starts. One that has a model alone is its own baseline.
        Renders that are given are set against the reference.
        """
        chosen = self.methods[method]
        if method in self.names(kinds.warm):
            return chosen["warm_start"]["from"]
        if method in self.names(kinds.external):
            return self.config["reference"]["method"]
        plain, model = self.names(kinds.plain), chosen["model"]
        same = (name for name in plain if self.methods[name]["model"] == model)
        return next(same, method)

    @kept
    def rounds_of(self, scene, method):
        """A method's trainings in a scene, round 0 first; equal ones are the same.

        With `rounds: auto`, of all rounds that there may be. Those of plain methods
        come first, and so equal ones have their names, whatever is asked for first.
        """
        for name in itertools.takewhile(lambda name: name != method, self.in_order()):
            self.rounds_of(scene, name)
        equal = self.known.setdefault(("equal", scene), {})

        def once(training):
            return equal.setdefault(training.value, training)

        kind = kinds.of_method(self.methods[method])
        return kind.trainings(self, scene, method, once)

    @kept
    def trainings(self, scene):
        """{folder: training} of all that a scene may need, those before others first.

        The points of the sweep among them.
        """
        chains = [self.rounds_of(scene, method) for method in self.methods]
        chains.append(sweep.trainings(self, scene))
        needed = (one for t in itertools.chain(*chains) for one in trainings.needs(t))
        return {training.folder: training for training in needed}

    def training(self, scene, folder):
        """The training of a folder below a scene's."""
        return self.trainings(scene)[folder]

    def at(self, scene, method, round):
        """The training of a method's round."""
        return self.rounds_of(scene, method)[int(round)]

    def folder(self, scene, method, round):
        """Folder of a method's round, which may have another method's name."""
        if method in self.names(kinds.external):
            return f"results/{scene}/{method}/round0"
        return self.at(scene, method, round).path

    @kept
    def splits(self, scene, folder):
        """The splits whose views are rendered after a training, and aligned.

        Training views are where another training comes from their flow, or the verdict
        looks at it: where a method aligns itself, the reference's show how much there
        is to be aligned. No test view is rendered after a pre-training.
        """
        splits = ["train"] * (folder in self.followed(scene))
        return splits + ["test"] * (not folder.startswith("pretrain/"))

    @kept
    def followed(self, scene):
        """Folders of the trainings whose training views are rendered and aligned."""
        every = self.trainings(scene).values()
        folders = {before.folder for training in every for before in training.flows}
        if self.names(kinds.aligned):
            folders.add(self.at(scene, self.config["reference"]["method"], 0).folder)
        return folders

    def last_round(self, scene, method):
        """A method's last round. With `rounds: auto`, what the rounds have shown."""
        chosen = self.methods[method]
        if chosen["rounds"] != "auto":
            return chosen["rounds"]
        for k in range(chosen["most_rounds"]):
            if not self.decided(scene=scene, method=method, round=k):
                return k
        return k + 1

    def all_rounds(self, scene):
        """(method, round) of every training that is scored, in the config's order."""
        return [
            (name, k)
            for name in self.trained()
            for k in range(self.last_round(scene, name) + 1)
            if self.at(scene, name, k).folder == f"{name}/round{k}"
        ]

    def scored(self, scene):
        """(method, round) of all that is scored: trainings, then given renders."""
        given = self.names(kinds.external)
        return [*self.all_rounds(scene), *((name, 0) for name in given)]

    def reference_round(self, scene):
        """The round whose renders the warped test set is made from."""
        reference = self.config["reference"]
        if reference["round"] == "last":
            return self.last_round(scene, reference["method"])
        return reference["round"]

    def reference_folder(self, scene, round=None):
        """Folder of the reference model, or of another of its method's rounds."""
        if round is None:
            round = self.reference_round(scene)
        return self.folder(scene, self.config["reference"]["method"], round)

    def with_truth(self, known=True):
        """Scenes whose truth is known (or not)."""
        return [name for name in self.scenes if self.has_truth(name) == known]

    def has_truth(self, scene):
        """Whether a scene's truth is known."""
        return scene_keys.SOURCES[self.scenes[scene]["source"]].has_truth

    def truth_of(self, scene):
        """The folder of a scene's truth, where that is known."""
        return f"results/{scene}/truth" if self.has_truth(scene) else None


def goes_on(path):
    """What `flow.rounds` decided, from its file."""
    return json_files.read(path, {"go_on": bool})["go_on"]


def folders(experiment):
    """Regular expression of what is scored or trained, by its folder below a scene's.

    Scenes have the same; one of them has the points of the sweep besides.
    """
    sweeps = experiment.config["tradeoff"]
    scenes = {next(iter(experiment.scenes)), *([sweeps["scene"]] if sweeps else [])}
    names = {name for scene in scenes for name in experiment.trainings(scene)}
    names |= {f"{name}/round0" for name in experiment.names(kinds.external)}
    return one_of(names)


def check_equal(experiment):
    """ValueError where a method trains nothing but what another one trains.

    It would have no row in any table.
    """
    scene, first = next(iter(experiment.scenes)), {}
    for name in experiment.trained():
        rounds = tuple(t.folder for t in experiment.rounds_of(scene, name))
        if rounds in first:
            what = f"the same as methods.{first[rounds]}: trained once, it has one name"
            raise ValueError(f"config: methods.{name}: {what}")
        first[rounds] = name


def one_of(names):
    """Regular expression of these names; of none, it matches nothing."""
    return letters(sorted(names)) or r"(?!)"


def letters(names):
    """The same of sorted names, letter by letter; of none, nothing.

    A plan matches every file with many expressions. One name after the other, what
    that takes grows with the number of scenes.
    """
    parts = []
    for letter, group in itertools.groupby(names, key=lambda name: name[:1]):
        parts.append(re.escape(letter) + letters([name[1:] for name in group if name]))
    return parts[0] if len(parts) == 1 else f"(?:{'|'.join(parts)})" if parts else ""
