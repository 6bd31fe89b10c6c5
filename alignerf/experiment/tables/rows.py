"""The rows of a scene's tables and figures, and the files that each comes from."""

import json
from typing import NamedTuple

from alignerf import methods
from alignerf.experiment import layout, sources, trainings


class Row(NamedTuple):
    """A training: its names, and its files.

    folder: below the scene's. method, round: as tables call it; None for a training
    that only leads to others. description: field and kind of the method, in words.
    moves_cameras, moves_photos: whether it has changed them by then (`methods.moves`).
    baseline, base: the method whose round 0 it is set against, and that one's folder.
    published: what papers call the method. way: the folders of all trainings that lead
    to it, its own last. flows: those of them whose training views were rendered and
    aligned. corrected: those whose cameras were then corrected. files: {what it
    tells: path}, see `alignerf.tables.collect`.
    """

    folder: str
    way: list[str]
    flows: list[str]
    corrected: list[str]
    files: dict
    method: str | None = None
    round: int | None = None
    description: str | None = None
    baseline: str | None = None
    base: str | None = None
    published: str | None = None
    moves_cameras: bool = False
    moves_photos: bool = False


class Renders(NamedTuple):
    """Test views of a round, or of a method beside others, and their flow."""

    renders: str
    flow: str
    method: str | None = None


def as_json(rows):
    """Rows on a command line, as rules write them: a key for each field."""
    return json.dumps([row._asdict() for row in rows], sort_keys=True)


def read(kind, text):
    """The same as a command reads them."""
    return [kind(**row) for row in json.loads(text)]


def files_of(rows):
    """The outputs of rules that rows of `Row` are made from."""
    return layout.outputs_of([path for row in rows for path in row.files.values()])


def shown_in(rows):
    """The outputs of rules that rows of `Renders` are."""
    return layout.outputs_of([path for row in rows for path in row[:2]])


def of_scene(experiment, scene):
    """All that is scored in a scene, and what leads there, with all that is known."""
    rows = collected(experiment, scene, experiment.all_rounds(scene), aligned_pose=True)
    for row in rows:
        if row.method:
            at = layout.training(scene, row.folder)
            row.files["parts"] = at.decomposition("test")
    return rows


def collected(experiment, scene, chosen, *, aligned_pose=False):
    """Rows of these (method, round), after those of other trainings on the way.

    aligned_pose: with scores of cameras moved to fit the photos, where there are such.
    """
    rows = [scored(experiment, scene, *one, aligned_pose) for one in chosen]
    named = {row.folder for row in rows}
    used = [folder for row in rows for folder in (*row.way, *row.flows)]
    others = [
        Row(folder, [], [], [], costs_of(layout.training(scene, folder)))
        for folder in dict.fromkeys(used)
        if folder not in named
    ]
    flows = {folder for row in rows for folder in row.flows}
    moved = {folder for row in rows for folder in row.corrected}
    for row in (*others, *rows):
        at = layout.training(scene, row.folder)
        if row.folder in flows:
            row.files["render"] = at.rendered("train")
            row.files["align"] = at.lengths("train")
        if row.folder in moved and "corrections" not in row.files:
            row.files["corrections"] = at.corrections
    return [*others, *rows]


def scored(experiment, scene, method, round, aligned_pose):
    """The row of a method after a round."""
    at = experiment.folder(scene, method, round)
    baseline = experiment.baseline(method)
    base = experiment.folder(scene, baseline, 0).name
    moved = experiment.moves(method, round)
    training = experiment.at(scene, method, round)
    files = {"scores": at.metrics} | costs_of(at)
    # Only a model of ours can be asked for a view by another camera.
    if aligned_pose and experiment.config.aligned_pose and training.job.ours:
        files["aligned_pose"] = at.metrics_aligned_pose
    corrected = [one.folder for one in trainings.moved_for(training)]
    if methods.input_cameras(experiment, scene, method):
        corrected.append(training.folder)
        files["corrections"] = layout.Scene(scene).adjusted_report
    return Row(
        folder=at.name,
        way=[one.folder for one in trainings.lead_to(training)],
        flows=[one.folder for one in trainings.rendered_for(training)],
        corrected=corrected,
        files=files,
        method=method,
        round=round,
        description=methods.label(experiment, method),
        baseline=baseline,
        base=base,
        published=experiment.methods[method].published,
        moves_cameras="cameras" in moved,
        moves_photos="photos" in moved,
    )


def costs_of(at):
    """The files that tell what a training was and took."""
    return {"timing": at.timing, "process": at.benchmark("train")}


def published_table():
    """What AligNeRF prints in its tables, beside the sources."""
    return str(sources.PIPELINE / "results" / "published" / "tables.csv")
