"""What a fly-through shows side by side: a training before, and one after."""

from pathlib import Path
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

    One side alone where the config has nothing to put right.
    """
    if not can_be_rendered(experiment, scene):
        return []
    for method, label, after in put_right(experiment, scene):
        before = experiment.at(scene, method, 0)
        if after.folder != before.folder:
            return [
                side_of(experiment, scene, f"before ({method})", before),
                side_of(experiment, scene, f"after ({label})", after),
            ]
    method = reference_of(experiment)
    return [side_of(experiment, scene, method, experiment.at(scene, method, 0))]


def put_right(experiment, scene):
    """Yield (method before, label, training after), by choice.

    First methods that align themselves on the way or learn their cameras, set against
    what tables set them against; then last rounds, against the same method's round 0.
    Of each kind those come first that belong to the reference.
    """
    own = reference_of(experiment)
    for kind in (kinds.aligned, kinds.learnt):
        names = experiment.names(kind)
        for name in sorted(names, key=lambda name: experiment.baseline(name) != own):
            baseline = experiment.baseline(name)
            yield baseline, name, experiment.at(scene, name, 0)
    for name in sorted(experiment.names(kinds.plain), key=lambda name: name != own):
        last = experiment.last_round(scene, name)
        yield name, f"{name}, round {last}", experiment.at(scene, name, last)


def reference_of(experiment):
    """The method that the reference is set against: its photos are as taken."""
    return experiment.baseline(experiment.config["reference"]["method"])


def can_be_rendered(experiment, scene):
    """Whether the model that a scene is judged by can be asked for other views."""
    others = (*experiment.names(kinds.external), *experiment.names(kinds.given))
    judged = experiment.scenes[scene]["judged"]
    return not judged and reference_of(experiment) not in others


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
            found.append(film_of(scene))
    return found


def film_of(scene):
    """The film of a scene, by its path."""
    return f"results/{scene}/flythrough.webm"


def film_that_is_there(experiment, scene):
    """[film] for the page, which shows it where somebody has asked for one."""
    ours = can_be_rendered(experiment, scene)
    return [film_of(scene)] if ours and Path(film_of(scene)).is_file() else []
