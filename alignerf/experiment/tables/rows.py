"""The rows of a scene's tables and figures, and the files that each comes from."""

import csv
import json
from typing import NamedTuple

from alignerf.experiment import arguments, layout, sources, trainings
from alignerf.experiment.tables import json_rows

# Rules write rows and wait for their files; commands read rows.
as_json = json_rows.as_json
PUBLISHED = sources.PIPELINE / "results" / "published"
TIMING, PROCESS = "timing.json", "logs/train.tsv"


class Row(NamedTuple):
    """A training, or renders that are given: its names, and its files.

    folder: below the scene's. method, round: as tables call it; None for a training
    that only leads to others. description: field and kind of the method, in words.
    moves_cameras, moves_photos: whether it has changed them by then (`methods.moves`).
    baseline, base: the method whose round 0 it is set against, and that one's folder.
    published: what papers call it. way: the folders of all trainings that lead to it,
    its own last. flows: those of them whose training views were rendered and aligned.
    corrected: those whose cameras were then put right. before: the folder whose flow a
    round begins with. files: {what it tells: path}, see `alignerf.tables.collect`.
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
    before: str | None = None
    moves_cameras: bool = False
    moves_photos: bool = False


class Renders(NamedTuple):
    """Test views of a round, or of a method beside others, and their flow."""

    renders: str
    flow: str
    method: str | None = None


def files_of(rows):
    """The outputs of rules that rows of `Row` are made from."""
    return layout.outputs_of([path for row in rows for path in row.files.values()])


def shown_in(rows):
    """The outputs of rules that rows of `Renders` are."""
    return layout.outputs_of([path for row in rows for path in row[:2]])


def of_scene(experiment, scene):
    """All that is scored in a scene, and what leads there, with all that is known."""
    rows = collected(experiment, scene, experiment.scored(scene), aligned_pose=True)
    begun_with = {row.before for row in rows}
    for row in rows:
        path = f"results/{scene}/{row.folder}"
        if row.method and row.way:
            row.files["parts"] = f"{path}/decomposition_test.csv"
        if row.folder in begun_with:
            row.files["render_process"] = f"{path}/logs/render.tsv"
            row.files["align_process"] = f"{path}/logs/align.tsv"
            row.files["render_test"] = report(path, trainings.RENDERED, "test")
            row.files["align_test"] = report(path, trainings.DISPLACED, "test")
    return rows


def collected(experiment, scene, chosen, *, aligned_pose=False):
    """Rows of these (method, round), after those of other trainings on the way.

    aligned_pose: with scores of cameras moved to fit the photos, where there are such.
    """
    rows = [scored(experiment, scene, *one, aligned_pose) for one in chosen]
    named = {row.folder for row in rows}
    used = [folder for row in rows for folder in (*row.way, *row.flows)]
    others = [
        Row(folder, [], [], [], costs_of(f"results/{scene}/{folder}"))
        for folder in dict.fromkeys(used)
        if folder not in named
    ]
    flows = {folder for row in rows for folder in row.flows}
    moved = {folder for row in rows for folder in row.corrected}
    for row in (*others, *rows):
        path = f"results/{scene}/{row.folder}"
        if row.folder in flows:
            row.files["render"] = report(path, trainings.RENDERED, "train")
            row.files["align"] = report(path, trainings.DISPLACED, "train")
        if row.folder in moved and "corrections" not in row.files:
            row.files["corrections"] = f"{path}/{trainings.CORRECTED}"
    return [*others, *rows]


def scored(experiment, scene, method, round, aligned_pose):
    """The row of a method after a round."""
    path = experiment.folder(scene, method, round)
    root = f"results/{scene}/"
    baseline = experiment.baseline(method)
    base = experiment.folder(scene, baseline, 0).removeprefix(root)
    moved = experiment.moves(method, round)
    row = Row(
        *(path.removeprefix(root), [], [], [], {"scores": f"{path}/metrics.csv"}),
        method=method,
        round=round,
        description=experiment.label(method),
        baseline=baseline,
        base=base,
        # Of the method as it is; no table has one of its rounds.
        published=experiment.methods[method]["published"] if round == 0 else None,
        moves_cameras="cameras" in moved,
        moves_photos="photos" in moved,
    )
    if method not in experiment.trained():
        return row
    training = experiment.at(scene, method, round)
    files = row.files | costs_of(path)
    # Only a model of ours can be asked for a view by another camera.
    moves = experiment.config["aligned_pose"] and training.job.ours
    if aligned_pose and moves:
        files["aligned_pose"] = f"{path}/metrics_aligned_pose.csv"
    corrected = [one.folder for one in trainings.moved_for(training)]
    if experiment.input_cameras(scene, method):
        corrected.append(training.folder)
        files["corrections"] = layout.adjusted(scene, "report.json")
    return row._replace(
        way=[one.folder for one in trainings.lead_to(training)],
        flows=[one.folder for one in trainings.rendered_for(training)],
        corrected=corrected,
        before=training.flows[-1].folder if round > 0 else None,
        files=files,
    )


def costs_of(path):
    """The files that tell what a training was and took."""
    return {"timing": f"{path}/{TIMING}", "process": f"{path}/{PROCESS}"}


def report(path, name, split):
    """The report of a training's renders, or of their flow."""
    return f"{path}/{name.format(split=split)}"


def of_verdict(experiment, scene):
    """Views of the reference's round 0: of the test, and of training where rendered."""
    folder = experiment.judged_folder(scene)
    files = {"timing": f"{folder}/{TIMING}"}
    for split in experiment.splits(scene, folder.removeprefix(f"results/{scene}/")):
        files |= {
            f"{split}_renders": f"{folder}/renders/{split}",
            f"{split}_depth": f"{folder}/depth/{split}",
            f"{split}_flow": f"{folder}/flow/{split}",
            f"{split}_lengths": f"{folder}/displacement/{split}.csv",
            f"{split}_parts": f"{folder}/parts_photos/{split}",
            f"{split}_stats": f"{folder}/decomposition_photos_{split}.csv",
        }
    return files


def verdict_options(experiment, scene):
    """Options of the verdict: what an estimator invents, gains, windows.

    Of windows: those with cameras as given, and as put right.
    """
    windows = {
        name: experiment.judged_folder(windows)
        for name, windows in judging(experiment, scene).items()
    }
    aligned = {
        name: f"{experiment.folder(scene, name, 0)}/{TIMING}"
        for name in experiment.names("in_loop")
    }
    told = compared(experiment, scene)
    if aligned and "misalignment" in told:
        told |= {"aligned": json.dumps(aligned)}
    if corrected := corrections(experiment, scene):
        told |= {"corrected": json.dumps(corrected)}
    return arguments.options(told | windows)


def corrections(experiment, scene):
    """{method: cameras.npz} of the methods whose training has moved cameras."""
    if experiment.parent(scene) or not experiment.capture(scene).trains:
        return {}
    return {
        name: f"{experiment.folder(scene, name, 0)}/learnt/cameras.npz"
        for name in experiment.trained()
        if "cameras" in experiment.moves(name, 0)
    }


def compared(experiment, scene):
    """{option: file} of what tells how much of a shift is the estimator's own.

    And, of a scene whose models this run has trained, what its remedies brought.
    """
    capture = experiment.capture(scene)
    if not capture.trains:
        found = {"overfit": f"{experiment.judged_folder(scene)}/overfit.csv"}
        before = capture.before(experiment.scenes[scene])
        return found | ({"before": before} if before else {})
    return {
        "overfit": f"results/{scene}/testset/overfit.csv",
        "misalignment": f"results/{scene}/tables/misalignment.csv",
    }


def judging(experiment, scene):
    """{option: scene} of the windows that a scene is judged by: one of each kind."""
    found = {}
    for name in experiment.windows(scene):
        moved = experiment.cameras_by(name) is not None
        found.setdefault("windows-corrected" if moved else "windows", name)
    return found if "windows" in found else {}


def files_of_windows(experiment, scene):
    """The outputs of rules that the verdict reads of windows."""
    files = []
    for name in judging(experiment, scene).values():
        files += of_verdict(experiment, name).values()
        files += [f"results/{name}/{kind}" for kind in ("cameras.npz", "poses.json")]
    return layout.outputs_of(files)


def figure_rounds(experiment, scene):
    """Test views round by round, of the reference method; none without such views."""
    if "test" not in experiment.capture(scene).splits(experiment.scenes[scene]):
        return []
    method = experiment.config["reference"]["method"]
    folders = [
        experiment.folder(scene, method, k)
        for k in range(experiment.last_round(scene, method) + 1)
    ]
    shown = [(folder, None) for folder in folders]
    # And beside them what aligns itself on the way, by its name.
    for name in experiment.names("in_loop"):
        shown.append((experiment.folder(scene, name, 0), name))
    return [Renders(f"{f}/renders/test", f"{f}/flow/test", m) for f, m in shown]


def crops(experiment, scene):
    """Staged methods and, before them, what each is set against: round 0 of all."""
    staged = experiment.names("in_crops")
    bases = [experiment.baseline(method) for method in staged]
    rows = []
    for method in dict.fromkeys([*bases, *staged]):
        folder = experiment.folder(scene, method, 0)
        files = (f"{folder}/renders/test", f"{folder}/flow/test")
        rows.append(Renders(*files, method))
    return rows


def crops_option(experiment, scene):
    """Command line of the crops; none without a staged method."""
    rows = crops(experiment, scene)
    return ["--crops", as_json(rows)] if rows else []


def published_table():
    """What AligNeRF prints in its tables, beside the sources."""
    return str(PUBLISHED / "tables.csv")


def published(scene):
    """Tables of papers, beside the sources, with a row of a scene of this name."""
    return [str(path) for path in sorted(PUBLISHED.glob("*.csv")) if has(path, scene)]


def has(path, scene):
    """Whether a published table has a scene of this name; `mean` is of all."""
    with open(path, newline="", encoding="utf-8") as file:
        return scene in {row["scene"] for row in csv.DictReader(file)} - {"mean"}
