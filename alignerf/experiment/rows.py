"""The files that each row of a scene's tables and figures comes from."""

from alignerf.experiment import slices


def field_name(experiment, method):
    """How a table calls a method's field, and what its frequency loss looks at."""
    model = experiment.methods[method]["model"]
    field = experiment.config["models"][model]["field"]
    size = field["width"] if field["kind"] == "mlp" else f"2^{field['log2_entries']}"
    name = f"{field['kind']} {size}"
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
    if settings["frequency_weight"] > 0:
        weights = experiment.config["frequency_weights"]
        parts.append("VGG-19" if weights else "derivative bank")
    return parts


def trainings_of(experiment, scene, method, round):
    """timing.json of every training that a round needed."""
    if method in experiment.staged():
        model = experiment.methods[method]["model"]
        first = f"results/{scene}/pretrain/{model}/timing.json"
        return [first, f"{experiment.trained(scene, method, round)}/timing.json"]
    return [
        f"{experiment.trained(scene, method, k)}/timing.json"
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
    folder = experiment.trained(scene, experiment.base_of(method), 0)
    return {"displacement": f"{folder}/displacement_train.csv"}


def data_of(experiment, scene, method, round):
    """Timing files of the rendering and warping between the rounds, or for a radius.

    The baseline's training, whose renders a radius is measured on, is its own row.
    """
    folders = [experiment.trained(scene, method, k) for k in range(int(round))]
    if measures_radius(experiment, method):
        folders.append(experiment.trained(scene, experiment.base_of(method), 0))
    return [
        f"{folder}/{name}"
        for folder in folders
        for name in ("render_train.json", "displacement_train.csv")
    ]


def photos_of_round(experiment, scene, method, round):
    """What round k learns from: the photos, or those warped onto round k - 1."""
    if int(round) == 0:
        return {"photos": f"results/{scene}/images"}
    before = experiment.trained(scene, method, int(round) - 1)
    return {"photos": f"{before}/warped/train", "valid": f"{before}/flow/train"}


def truth_of(experiment, scene):
    """The oracle's folder, where the scene's truth is known."""
    known = scene in experiment.with_truth()
    return {"truth": f"results/{scene}/truth"} if known else {}


def of_method(experiment, scene, method, round):
    """A method and round, its scores, and the files that tell what it took."""
    return {
        "method": method,
        "round": round,
        "metrics": f"{experiment.trained(scene, method, round)}/metrics.csv",
        "trainings": trainings_of(experiment, scene, method, round),
        "data": data_of(experiment, scene, method, round),
    }


def misalignment(experiment, scene):
    """One entry per method and round, with the files that its row comes from."""
    rows = []
    for method, round in experiment.all_rounds(scene):
        base = experiment.base_of(method)
        row = of_method(experiment, scene, method, round)
        row |= {"field": field_name(experiment, method), "base": base}
        row["base_metrics"] = f"{experiment.trained(scene, base, 0)}/metrics.csv"
        rows.append(row)
    return rows


def displacement(experiment, scene):
    """One entry per method and round, with its test views' parts and metrics."""
    rows = []
    for method, round in experiment.all_rounds(scene):
        folder = experiment.trained(scene, method, round)
        row = {"method": method, "round": round}
        row["stats"] = f"{folder}/decomposition_test.csv"
        rows.append(row | {"metrics": f"{folder}/metrics.csv"})
    return rows


def times(experiment, scene):
    """One entry per method and round, with the files that tell its seconds."""
    rows = []
    for method, round in experiment.all_rounds(scene):
        folder = experiment.trained(scene, method, round)
        row = {
            "method": method,
            "round": round,
            "training": f"{folder}/timing.json",
            "walls": {"train": f"{folder}/logs/train.tsv"},
        }
        if round > 0:
            before = experiment.trained(scene, method, round - 1)
            row["rendering"] = f"{before}/render_train.json"
            row["alignment"] = f"{before}/displacement_train.csv"
            row["walls"]["render"] = f"{before}/logs/render_train.tsv"
            row["walls"]["align"] = f"{before}/logs/align_train.tsv"
        rows.append(row)
    return rows


def scores(experiment, scene):
    """Method, round and metrics of every row."""
    keys = ("method", "round", "metrics")
    return [{key: row[key] for key in keys} for row in misalignment(experiment, scene)]


def figure_rounds(experiment, scene):
    """Renders and flow of the test views, round by round, of the reference method."""
    method = experiment.config["reference"]["method"]
    folders = [
        experiment.trained(scene, method, k)
        for k in range(experiment.last_round(scene, method) + 1)
    ]
    return [
        {"renders": f"{folder}/renders/test", "flow": f"{folder}/flow/test"}
        for folder in folders
    ]


def crops(experiment, scene):
    """Staged methods and, before them, what each is set against: round 0 of all."""
    staged = experiment.staged()
    bases = [experiment.base_of(method) for method in staged]
    rows = []
    for method in dict.fromkeys([*bases, *staged]):
        folder = experiment.trained(scene, method, 0)
        row = {"method": method, "renders": f"{folder}/renders/test"}
        rows.append(row | {"flow": f"{folder}/flow/test"})
    return rows


def files_of(rows):
    """All files that rows name, sorted: whatever in them is a path in results/."""
    found = set()
    todo = list(rows)
    while todo:
        value = todo.pop()
        if isinstance(value, dict):
            todo += value.values()
        elif isinstance(value, list):
            todo += value
        elif isinstance(value, str) and value.startswith("results/"):
            found.add(value)
    return sorted(found)


def as_json(rows):
    """Rows as a command of a table takes them."""
    return slices.as_json(rows)
