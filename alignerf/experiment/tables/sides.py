"""What a fly-through shows side by side: a training before, and one after."""

from typing import NamedTuple

from alignerf.experiment import inputs, kinds, layout
from alignerf.experiment.tables import json_rows, rows


class Side(NamedTuple):
    """A trained model: what the film calls it, its job as JSON, and its files.

    cameras: those that its renders are seen by. timing: what rendering its test views
    took, with so many threads.
    """

    label: str
    job: str
    model: str
    cameras: str
    timing: str
    threads: int


def of(experiment, scene):
    """The sides of a scene's film, before first; [] where no model of ours is trained.

    Before: the training that the reference's method is set against. After: a method
    that aligns itself on the way or, where the config has none, the last round of the
    first method with several. Without either there is one side.
    """
    if not can_be_rendered(experiment, scene):
        return []
    method = experiment.baseline(experiment.config["reference"]["method"])
    before = experiment.at(scene, method, 0)
    after = after_of(experiment, scene, method)
    label = f"before ({method})" if after else method
    sides = [side_of(experiment, scene, label, before)]
    if after:
        name, training = after
        sides.append(side_of(experiment, scene, f"after ({name})", training))
    return sides


def can_be_rendered(experiment, scene):
    """Whether the model that a scene is judged by can be asked for other views."""
    method = experiment.baseline(experiment.config["reference"]["method"])
    others = (*experiment.names(kinds.external), *experiment.names(kinds.given))
    return not experiment.scenes[scene]["judged"] and method not in others


def after_of(experiment, scene, method):
    """(name, training) of what put something right, or None.

    Of methods that do, those come first that are set against `method`.
    """
    own = [n for n in experiment.trained() if experiment.baseline(n) == method]
    rest = [name for name in experiment.trained() if name not in own]
    for name in [*own, *rest]:
        if name in experiment.names(kinds.aligned):
            return name, experiment.at(scene, name, 0)
    reference = experiment.config["reference"]["method"]
    for name in dict.fromkeys([reference, *own]):
        several = name in experiment.trained() and experiment.methods[name]["rounds"]
        last = experiment.last_round(scene, name) if several else 0
        if last:
            return f"{name}, round {last}", experiment.at(scene, name, last)
    return None


def side_of(experiment, scene, label, training):
    """The side of a training."""
    return Side(
        label,
        training.job,
        training.model,
        f"{training.learnt}/cameras.npz",
        rows.report(training.path, "render/{split}.json", "test"),
        inputs.threads_of(experiment, scene, training.folder),
    )


def option(experiment, scene):
    """The sides of a film as a command reads them."""
    return json_rows.as_json(of(experiment, scene))


def files(experiment, scene):
    """The outputs of rules that a film is made from."""
    every = of(experiment, scene)
    paths = [path for s in every for path in (s.model, s.cameras, s.timing)]
    return layout.outputs_of(paths)


def films(experiment):
    """What `snakemake flythrough` makes: of every capture a path and, if ours, a film.

    Renders that are judged may come without cameras: they have neither.
    """
    found = []
    for scene in experiment.captures():
        judged = experiment.scenes[scene]["judged"]
        if not judged or judged["cameras"]:
            found.append(f"results/{scene}/camera_path.json")
        if can_be_rendered(experiment, scene):
            found.append(f"results/{scene}/flythrough.webm")
    return found
