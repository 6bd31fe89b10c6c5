"""An experiment: its methods, their rounds, and the folder of each trained model.

Notation: a method's round 0 trains on the photos as taken, round k on those that round
k - 1 warped. *Staged* methods pre-train and fine-tune (AligNeRF), *plain* ones train
in one go; *warm* plain ones go on from the weights of the round before.
"""

import functools
import itertools
import re

from alignerf.command import json_files
from alignerf.experiment import settings


def kept(method):
    """Of an experiment: found once for each of its arguments, then looked up.

    A plan of many scenes asks for the same millions of times. Not for what
    `decided` says, which is another when a checkpoint has run.
    """

    @functools.wraps(method)
    def found(self, *arguments):
        key = (method.__name__, *arguments)
        if key not in self.known:
            self.known[key] = method(self, *arguments)
        return self.known[key]

    return found


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
    def staged(self):
        """Methods that pre-train and fine-tune."""
        return [name for name, m in self.methods.items() if m["alignerf"]]

    @kept
    def given(self):
        """Methods that are another program's renders: they are scored, and no more."""
        return [name for name, m in self.methods.items() if m["renders"]]

    @kept
    def trained(self):
        """All other methods."""
        return [name for name, m in self.methods.items() if not m["renders"]]

    @kept
    def plain(self):
        """Methods trained in one go, on photos or warped photos."""
        return [name for name in self.trained() if name not in self.staged()]

    @kept
    def warm(self):
        """Methods whose rounds go on from the weights of the round before."""
        return [name for name, m in self.methods.items() if m["warm_start"]]

    @kept
    def from_scratch(self):
        """Plain methods that train every round from scratch."""
        others = {*self.warm(), *self.refining(), *self.aligning()}
        return [name for name in self.plain() if name not in others]

    @kept
    def base_of(self, method):
        """Whose round 0 a method is set against, and a plain one begins with.

        With a warm start, that of the method that it starts from; else the first's
        that trains the same model from scratch, which may be the method itself. A
        method that is staged, or learns cameras, has its own where no other has the
        model. Renders that are given are set against the reference's.
        """
        if method in self.warm():
            return self.methods[method]["warm_start"]["from"]
        if method in self.given():
            return self.config["reference"]["method"]
        model = self.methods[method]["model"]
        scratch = self.from_scratch()
        same = [name for name in scratch if self.methods[name]["model"] == model]
        return same[0] if same else method

    @kept
    def owner_of(self, method, round):
        """Under whose name a method's round is trained: the first that does the same.

        Plain methods of a model do the same as long as their rounds change the same.
        """
        k = int(round)
        if method in self.warm():
            return self.base_of(method) if k == 0 else method
        alone = self.staged(), self.refining(), self.aligning(), self.given()
        if any(method in names for names in alone):
            return method
        model, done = self.methods[method]["model"], self.changes(method)[:k]
        return next(
            name
            for name in self.from_scratch()
            if self.methods[name]["model"] == model and self.changes(name)[:k] == done
        )

    @kept
    def refining(self):
        """Methods that learn the cameras with the scene."""
        return [name for name, m in self.methods.items() if m["refine"]]

    @kept
    def aligning(self):
        """Methods whose training puts right what it learns from, on the way."""
        return [name for name, m in self.methods.items() if m["align"]]

    @kept
    def correcting(self):
        """Staged methods whose cameras are put right between their stages."""
        return [
            name for name in self.staged() if self.methods[name]["changes"] != "photos"
        ]

    def pretrained(self, scene, method):
        """Folder of the pre-training that a staged method shares with its ablations."""
        return f"results/{scene}/pretrain/{self.methods[method]['model']}"

    def folder(self, scene, method, round):
        """Folder of a method's round, which may be another method's (`owner_of`)."""
        return f"results/{scene}/{self.owner_of(method, round)}/round{round}"

    @kept
    def changes(self, method):
        """What each round after the first changes: `photos` or `cameras`.

        With `rounds: auto`, of all rounds that there may be.
        """
        found = self.methods[method]
        last = found["rounds"] if found["rounds"] != "auto" else found["most_rounds"]
        if found["changes"] == "cameras_then_photos":
            return ["cameras"] * (last - 1) + ["photos"]
        return [found["changes"]] * last

    def last_round(self, scene, method):
        """A method's last round. With `rounds: auto`, what the rounds have shown."""
        found = self.methods[method]
        if found["rounds"] != "auto":
            return found["rounds"]
        for k in range(found["most_rounds"]):
            if not self.decided(scene=scene, method=method, round=k):
                return k
        return k + 1

    def all_rounds(self, scene):
        """(method, round) of every training, in the config's order."""
        return [
            (name, k)
            for name in self.trained()
            for k in range(self.last_round(scene, name) + 1)
            if self.owner_of(name, k) == name
        ]

    def scored(self, scene):
        """(method, round) of all that is scored: trainings, then given renders."""
        return [*self.all_rounds(scene), *((name, 0) for name in self.given())]

    def change_of(self, method, round):
        """What a round changes; round 0, nothing."""
        return self.changes(method)[int(round) - 1] if int(round) > 0 else None

    def cameras_of(self, scene, method, round):
        """The cameras.npz that a round is trained with: as given, or put right.

        Of a staged method, those of its fine-tuning.
        """
        if method in self.correcting():
            return f"{self.pretrained(scene, method)}/corrected/cameras.npz"
        for k in range(int(round), 0, -1):
            if self.change_of(method, k) == "cameras":
                return f"{self.corrected_folder(scene, method, k)}/cameras.npz"
        return f"results/{scene}/cameras.npz"

    def rendered_with(self, scene, method, round):
        """The cameras.npz of a round's renders: trained with, learnt, or aligned."""
        if method in self.refining():
            return f"{self.folder(scene, method, round)}/refined/cameras.npz"
        if method in self.aligning():
            return f"{self.folder(scene, method, round)}/aligned/cameras.npz"
        return self.cameras_of(scene, method, round)

    def corrected_folder(self, scene, method, round):
        """Where the cameras of a round lie that were put right for it."""
        return f"{self.folder(scene, method, round)}/corrected"

    @kept
    def followed(self):
        """{method: its rounds whose training views are rendered and aligned}.

        Another round trains on these, a search radius comes from them, or the verdict
        looks at them, where a method aligns itself by such a flow.
        """
        found = {name: set() for name in self.methods}
        for name, method in self.methods.items():
            for k in range(len(self.changes(name))):
                found[self.owner_of(name, k)].add(k)
            if method["alignerf"] and method["alignerf"]["radius_px"] == "auto":
                found[self.base_of(name)].add(0)
        if self.aligning():
            # By the reference's the verdict says what there is to be aligned.
            found[self.owner_of(self.config["reference"]["method"], 0)].add(0)
        return found

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
        return settings.SOURCES[self.scenes[scene]["source"]].has_truth


def goes_on(path):
    """What `flow.rounds` decided, from its file."""
    return json_files.read(path, {"go_on": bool})["go_on"]


def at_rounds(found, *, others=False):
    """Regular expression of a method at one of its rounds, or at any other round.

    found: {method: rounds}. Of a path's `{method}/round{round}/` it takes the method
    and looks ahead at the round, since a wildcard's expression knows no other wildcard.
    """
    ahead = "?!" if others else "?="
    return "|".join(
        f"{re.escape(name)}({ahead}/round(?:{one_of(map(str, rounds))})/)"
        for name, rounds in sorted(found.items())
    )


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
