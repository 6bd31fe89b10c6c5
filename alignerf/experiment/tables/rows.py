"""The rows of a scene's tables and figures, and the files that each comes from."""

import csv
from typing import NamedTuple

from alignerf.experiment import inputs, kinds, layout, sources, trainings
from alignerf.files import json_rows

# Rules write rows and wait for their files; commands of tables read rows.
as_json, read = json_rows.as_json, json_rows.read
PUBLISHED = sources.ROOT / "results" / "published"


def files_of(rows):
    """The outputs of rules that rows are made from."""
    return layout.outputs_of(json_rows.files_of(rows))


class Misalignment(NamedTuple):
    """A method after a round, set against round 0 of a base."""

    method: str
    field: str
    round: int
    metrics: str
    base: str
    base_metrics: str
    # timing.json of all stages and rounds that led here.
    trainings: list[str]
    # What renderings and warpings between the trainings took: timings and CSVs.
    data: list[str]
    # Scores of cameras moved to fit the photos, where they are asked for.
    aligned_pose: str | None = None
    base_aligned_pose: str | None = None


class Scores(NamedTuple):
    """A method after a round, and the scores of its test views."""

    method: str
    round: int
    metrics: str
    aligned_pose: str | None = None


class Displacement(NamedTuple):
    """A method after a round, and its test views' flow and the flow's parts."""

    method: str
    round: int
    stats: str
    # For the figure of curves: the table shows no score.
    metrics: str | None = None


class Walls(NamedTuple):
    """Snakemake's benchmark of each process of a round; round 0 only trains."""

    train: str
    render: str | None = None
    align: str | None = None


class Times(NamedTuple):
    """A method's round, and the files that tell its seconds."""

    method: str
    round: int
    training: str
    walls: Walls
    rendering: str | None = None
    alignment: str | None = None
    # What the same processes did for the test views, which is no part of a round.
    test_rendering: str | None = None
    test_alignment: str | None = None


class Renders(NamedTuple):
    """Test views of a round, or of a method beside others, and their flow."""

    renders: str
    flow: str
    method: str | None = None


def describe_method(experiment, method):
    """How a table calls a method: its field, and what else the method is."""
    if method in experiment.names(kinds.external):
        return "renders given"
    model = experiment.config["models"][experiment.methods[method]["model"]]
    field = model.get("field", model)
    hashed = "log2_entries" in field
    size = f"2^{field['log2_entries']}" if hashed else field["width"]
    aliased = [] if field.get("anti_aliased", True) else ["aliased"]
    kind = kinds.of_method(experiment.methods[method])
    words = kind.words(experiment, method)
    return ", ".join([f"{field['kind']} {size}", *aliased, *words])


def of_method(experiment, scene, method, round):
    """The fields that rows of several tables share: scores, and what they took."""
    trained = method not in experiment.names(kinds.external)
    training = experiment.at(scene, method, round) if trained else None
    return {
        "method": method,
        "round": round,
        "metrics": f"{experiment.folder(scene, method, round)}/metrics.csv",
        "trainings": trainings.timings_of(training) if training else [],
        "data": trainings.reports_of(training) if training else [],
    }


def aligned_pose(experiment, scene, method, round):
    """Scores of a round's test views by moved cameras, where they are asked for."""
    given = method in experiment.names(kinds.external)
    if not experiment.config["aligned_pose"] or given:
        return None
    return f"{experiment.folder(scene, method, round)}/metrics_aligned_pose.csv"


def misalignment(experiment, scene):
    """One row per method and round."""
    rows = []
    for method, round in experiment.scored(scene):
        base = experiment.baseline(method)
        row = Misalignment(
            **of_method(experiment, scene, method, round),
            aligned_pose=aligned_pose(experiment, scene, method, round),
            field=describe_method(experiment, method),
            base=base,
            base_metrics=f"{experiment.folder(scene, base, 0)}/metrics.csv",
            base_aligned_pose=aligned_pose(experiment, scene, base, 0),
        )
        rows.append(row)
    return rows


def displacement(experiment, scene):
    """One row per method and round."""
    rows = []
    for method, round in experiment.all_rounds(scene):
        folder = experiment.folder(scene, method, round)
        files = (f"{folder}/decomposition_test.csv", f"{folder}/metrics.csv")
        rows.append(Displacement(method, round, *files))
    return rows


def times(experiment, scene):
    """One row per method and round."""
    rows = []
    for method, round in experiment.all_rounds(scene):
        folder = experiment.folder(scene, method, round)
        walls = Walls(f"{folder}/logs/train.tsv")
        row = Times(method, round, f"{folder}/timing.json", walls)
        if round > 0:
            before = experiment.folder(scene, method, round - 1)
            row = row._replace(
                rendering=f"{before}/{trainings.RENDERED}".format(split="train"),
                alignment=f"{before}/{trainings.DISPLACED}".format(split="train"),
                walls=walls._replace(
                    render=f"{before}/logs/render.tsv",
                    align=f"{before}/logs/align.tsv",
                ),
                test_rendering=f"{before}/{trainings.RENDERED}".format(split="test"),
                test_alignment=f"{before}/{trainings.DISPLACED}".format(split="test"),
            )
        rows.append(row)
    return rows


def scores(experiment, scene):
    """One row per method and round."""
    found = misalignment(experiment, scene)
    return [
        Scores(row.method, row.round, row.metrics, row.aligned_pose) for row in found
    ]


def tables(experiment, scene):
    """{table: its rows}; rankings need a truth to be compared with."""
    found = {
        "misalignment": misalignment(experiment, scene),
        "round_times": times(experiment, scene),
        "controls": scores(experiment, scene),
        "displacement": displacement(experiment, scene),
    }
    if experiment.has_truth(scene):
        found["ranking"] = scores(experiment, scene)
    return found


def of_verdict(experiment, scene):
    """Views of the reference's round 0: of the test, and of training where rendered."""
    method = experiment.config["reference"]["method"]
    folder = experiment.reference_folder(scene, 0)
    training = experiment.at(scene, method, 0)
    found = {"timing": f"{folder}/timing.json"}
    for split in experiment.splits(scene, training.folder):
        found |= {
            f"{split}_renders": f"{folder}/renders/{split}",
            f"{split}_flow": f"{folder}/flow/{split}",
            f"{split}_lengths": f"{folder}/displacement/{split}.csv",
            f"{split}_parts": f"{folder}/parts_photos/{split}",
            f"{split}_stats": f"{folder}/decomposition_photos_{split}.csv",
        }
    return found


def of_page(experiment, scene):
    """What its images are of besides: those views' warped photos, and the truth."""
    found = of_verdict(experiment, scene)
    warped = {
        f"{split}_warped": f"{experiment.reference_folder(scene, 0)}/warped/{split}"
        for split in ("train", "test")
        if f"{split}_renders" in found
    }
    return found | warped | inputs.truth_of(experiment, scene)


def options_of(tables):
    """Command line of tables' rows, of `tables`."""
    return [
        part
        for name, found in tables.items()
        for part in ("--rows", name, as_json(found))
    ]


def figure_rounds(experiment, scene):
    """Test views round by round, of the reference method."""
    method = experiment.config["reference"]["method"]
    folders = [
        experiment.folder(scene, method, k)
        for k in range(experiment.last_round(scene, method) + 1)
    ]
    shown = [(folder, None) for folder in folders]
    # And beside them what aligns itself on the way, by its name.
    for name in experiment.names(kinds.aligned):
        shown.append((experiment.folder(scene, name, 0), name))
    return [Renders(f"{f}/renders/test", f"{f}/flow/test", m) for f, m in shown]


def crops(experiment, scene):
    """Staged methods and, before them, what each is set against: round 0 of all."""
    staged = experiment.names(kinds.staged)
    bases = [experiment.baseline(method) for method in staged]
    rows = []
    for method in dict.fromkeys([*bases, *staged]):
        folder = experiment.folder(scene, method, 0)
        files = (f"{folder}/renders/test", f"{folder}/flow/test")
        rows.append(Renders(*files, method))
    return rows


def crops_option(experiment, scene):
    """Command line of the crops; none without a staged method."""
    found = crops(experiment, scene)
    return ["--crops", as_json(found)] if found else []


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
