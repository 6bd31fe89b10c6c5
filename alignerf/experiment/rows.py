"""The rows of a scene's tables and figures, and the files that each comes from."""

import csv
from typing import NamedTuple

from alignerf.command import json_rows
from alignerf.experiment import slices, sources

# Rules write rows and wait for their files; commands of tables read rows.
as_json, files_of, read = json_rows.as_json, json_rows.files_of, json_rows.read
PUBLISHED = sources.ROOT / "results" / "published"


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


def field_name(experiment, method):
    """How a table calls a method's field, and what its frequency loss looks at."""
    model = experiment.methods[method]["model"]
    if method in experiment.given():
        return "renders given"
    model = experiment.config["models"][model]
    field = model.get("field", model)
    hashed = "log2_entries" in field
    size = f"2^{field['log2_entries']}" if hashed else field["width"]
    name = f"{field['kind']} {size}"
    if not field.get("anti_aliased", True):
        name = f"{name}, aliased"
    if method in experiment.refining():
        return f"{name}, cameras learnt"
    if chosen := experiment.methods[method]["align"]:
        what = [key for key in ("cameras", "photos") if chosen[f"{key}_at"]]
        return f"{name}, {' and '.join(what)} aligned on the way"
    changes = experiment.methods[method]["changes"]
    if method not in experiment.staged() and changes != "photos":
        then = ", then photos" if changes == "cameras_then_photos" else ""
        return f"{name}, cameras put right{then}"
    if method not in experiment.staged():
        return name
    return ", ".join([name, *parts_of(experiment, method)])


def parts_of(experiment, method):
    """The contributions that a staged method has, in words."""
    settings = experiment.methods[method]["alignerf"]
    parts = [f"{settings['features']} features"] if settings["convolution"] else []
    if settings["radius_px"] != 0:
        what = "aligned" if settings["matching"] == "patch" else "contextual"
        parts.append(what)
    if settings["error"] != "squared":
        parts.append(settings["error"])
    if method in experiment.correcting():
        parts.insert(0, "cameras put right")
    if settings["frequency_weight"] > 0:
        weights = experiment.config["frequency_weights"]
        parts.append("VGG-19" if weights else "derivative bank")
    return parts


def trainings_of(experiment, scene, method, round):
    """timing.json of every training that a round needed; none of given renders."""
    if method in experiment.given():
        return []
    if method in experiment.staged():
        first = f"{experiment.pretrained(scene, method)}/timing.json"
        return [first, f"{experiment.folder(scene, method, round)}/timing.json"]
    return [
        f"{experiment.folder(scene, method, k)}/timing.json"
        for k in range(int(round) + 1)
    ]


def measures_radius(experiment, method):
    """Whether a method's search radius comes from its base's displacement."""
    settings = experiment.methods[method]["alignerf"]
    return bool(settings) and settings["radius_px"] == "auto"


def displacement_for_radius(experiment, scene, method):
    """With `radius_px: auto`, how far the baseline's training views are off."""
    if not measures_radius(experiment, method):
        return {}
    folder = experiment.folder(scene, experiment.base_of(method), 0)
    return {"displacement": f"{folder}/displacement_train.csv"}


def data_of(experiment, scene, method, round):
    """Timing files of the rendering and warping between the rounds, or for a radius.

    The baseline's training, whose renders a radius is measured on, is its own row.
    """
    folders = [experiment.folder(scene, method, k) for k in range(int(round))]
    if method in experiment.correcting():
        folders.append(experiment.pretrained(scene, method))
    if measures_radius(experiment, method):
        folders.append(experiment.folder(scene, experiment.base_of(method), 0))
    return [
        *(
            f"{folder}/{name}"
            for folder in folders
            for name in ("render_train.json", "displacement_train.csv")
        ),
        *corrections_of(experiment, scene, method, round),
    ]


def corrections_of(experiment, scene, method, round):
    """The report of each correction of cameras that a round needed."""
    if method in experiment.correcting():
        folder = experiment.pretrained(scene, method)
        return [f"{folder}/corrected/poses_corrected.json"]
    return [
        f"{experiment.corrected_folder(scene, method, k)}/poses_corrected.json"
        for k in range(1, int(round) + 1)
        if experiment.change_of(method, k) == "cameras"
    ]


def photos_of_round(experiment, scene, method, round):
    """What round k learns from: the photos, or those warped onto round k - 1."""
    if experiment.change_of(method, round) != "photos":
        return {"photos": f"results/{scene}/images"}
    before = experiment.folder(scene, method, int(round) - 1)
    return {"photos": f"{before}/warped/train", "valid": f"{before}/flow/train"}


def photos_learnt(experiment, scene, method, round):
    """What a round has learnt from in the end: `photos_of_round`, or aligned photos."""
    if method not in experiment.aligning():
        return photos_of_round(experiment, scene, method, round)
    folder = f"{experiment.folder(scene, method, round)}/aligned"
    return {"photos": f"{folder}/photos", "valid": f"{folder}/valid"}


def verdict_of(experiment, scene, method):
    """What says whether a method's alignment on the way paid; nothing of others."""
    aligns = method in experiment.aligning()
    return f"results/{scene}/verdict.json" if aligns else []


def renders_of(experiment, scene, method, round):
    """The folder of a round's test views: its own, or another program's."""
    if method in experiment.given():
        return experiment.methods[method]["renders"].replace("{scene}", scene)
    return f"{experiment.folder(scene, method, round)}/renders/test"


def decisions_of(experiment, scene):
    """What the scene's facts decided, where the config leaves something to them."""
    return slices.decisions_of(experiment.config, scene) or []


def truth_of(experiment, scene):
    """The oracle's folder, where the scene's truth is known."""
    known = experiment.has_truth(scene)
    return {"truth": f"results/{scene}/truth"} if known else {}


def of_method(experiment, scene, method, round):
    """The fields that rows of several tables share: scores, and what they took."""
    return {
        "method": method,
        "round": round,
        "metrics": f"{experiment.folder(scene, method, round)}/metrics.csv",
        "trainings": trainings_of(experiment, scene, method, round),
        "data": data_of(experiment, scene, method, round),
    }


def aligned_pose(experiment, scene, method, round):
    """Scores of a round's test views by moved cameras, where they are asked for."""
    if not experiment.config["aligned_pose"] or method in experiment.given():
        return None
    return f"{experiment.folder(scene, method, round)}/metrics_aligned_pose.csv"


def misalignment(experiment, scene):
    """One row per method and round."""
    rows = []
    for method, round in experiment.scored(scene):
        base = experiment.base_of(method)
        row = Misalignment(
            **of_method(experiment, scene, method, round),
            aligned_pose=aligned_pose(experiment, scene, method, round),
            field=field_name(experiment, method),
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
                rendering=f"{before}/render_train.json",
                alignment=f"{before}/displacement_train.csv",
                walls=walls._replace(
                    render=f"{before}/logs/render.tsv",
                    align=f"{before}/logs/align.tsv",
                ),
                test_rendering=f"{before}/render_test.json",
                test_alignment=f"{before}/displacement_test.csv",
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
    followed = 0 in experiment.followed()[experiment.owner_of(method, 0)]
    found = {"timing": f"{folder}/timing.json"}
    for split in ("train", "test") if followed else ("test",):
        found |= {
            f"{split}_renders": f"{folder}/renders/{split}",
            f"{split}_flow": f"{folder}/flow/{split}",
            f"{split}_lengths": f"{folder}/displacement_{split}.csv",
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
    return found | warped | truth_of(experiment, scene)


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
    # And beside them what aligns itself on the way, by its name.
    found = [(folder, None) for folder in folders]
    found += [(experiment.folder(scene, m, 0), m) for m in experiment.aligning()]
    return [Renders(f"{f}/renders/test", f"{f}/flow/test", m) for f, m in found]


def crops(experiment, scene):
    """Staged methods and, before them, what each is set against: round 0 of all."""
    staged = experiment.staged()
    bases = [experiment.base_of(method) for method in staged]
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
