# Functions only: the files that each row of a table or figure comes from.
def field_name(method):
    """How a table calls a method's field, and what its frequency loss looks at."""
    field = config["models"][config["methods"][method]["model"]]["field"]
    size = field["width"] if field["kind"] == "mlp" else f"2^{field['log2_entries']}"
    name = f"{field['kind']} {size}"
    if method not in staged():
        return name
    return ", ".join([name, *parts_of(config["methods"][method]["alignerf"])])


def parts_of(settings):
    """The contributions that a staged method has, in words."""
    parts = [f"{settings['features']} features"] if settings["convolution"] else []
    if settings["radius_px"] != 0:
        what = "aligned" if settings["matching"] == "patch" else "contextual"
        parts.append(what)
    if settings["error"] != "squared":
        parts.append(settings["error"])
    if settings["frequency_weight"] > 0:
        parts.append("VGG-19" if config["frequency_weights"] else "derivative bank")
    return parts


def trainings_of(scene, method, round):
    """timing.json of every training that a round needed."""
    if method in staged():
        model = config["methods"][method]["model"]
        first = f"results/{scene}/pretrain/{model}/timing.json"
        return [first, f"{trained(scene, method, round)}/timing.json"]
    return [f"{trained(scene, method, k)}/timing.json" for k in range(int(round) + 1)]


def data_of(scene, method, round):
    """Timing files of the rendering and warping between the rounds, or for a radius.

    The baseline's training, whose renders a radius is measured on, is its own row.
    """
    folders = [trained(scene, method, k) for k in range(int(round))]
    if displacement_for_radius(types.SimpleNamespace(scene=scene, method=method)):
        folders.append(trained(scene, base_of(method), 0))
    return [
        f"{folder}/{name}"
        for folder in folders
        for name in ("render_train.json", "displacement_train.csv")
    ]


def base_of(method):
    """Whose round 0 a method is set against: its own, if it trains from scratch.

    With a warm start, that of the method that it starts from; of a staged method, the
    plain one's of its model, or its own where none has the model.
    """
    if method in warm():
        return config["methods"][method]["warm_start"]["from"]
    if method in plain():
        return method
    model = config["methods"][method]["model"]
    scratch = [name for name in plain() if name not in warm()]
    same = [name for name in scratch if config["methods"][name]["model"] == model]
    return same[0] if same else method


def displacement_rows(scene):
    """One entry per method and round, with its test views' parts and metrics."""
    return [
        {
            "method": method,
            "round": round,
            "stats": f"{trained(scene, method, round)}/decomposition_test.csv",
            "metrics": f"{trained(scene, method, round)}/metrics.csv",
        }
        for method, round in all_rounds(scene)
    ]


def row_files(scene, method, round):
    """A method and round, its scores, and the files that tell what it took."""
    return {
        "method": method,
        "round": round,
        "metrics": f"{trained(scene, method, round)}/metrics.csv",
        "trainings": trainings_of(scene, method, round),
        "data": data_of(scene, method, round),
    }


def table_rows(scene):
    """One entry per method and round, with the files that its row comes from."""
    return [
        row_files(scene, method, round)
        | {
            "field": field_name(method),
            "base": base_of(method),
            "base_metrics": f"{trained(scene, base_of(method), 0)}/metrics.csv",
        }
        for method, round in all_rounds(scene)
    ]


def table_inputs(w):
    rows = table_rows(w.scene)
    files = [
        [r["metrics"], r["base_metrics"], *r["trainings"], *r["data"]] for r in rows
    ]
    return sorted({path for row in files for path in row})


def time_rows(scene):
    """One entry per method and round, with the files that tell its seconds."""
    rows = []
    for method, round in all_rounds(scene):
        folder = trained(scene, method, round)
        row = {
            "method": method,
            "round": round,
            "training": f"{folder}/timing.json",
            "walls": {"train": f"{folder}/logs/train.tsv"},
        }
        if round > 0:
            before = trained(scene, method, round - 1)
            row["rendering"] = f"{before}/render_train.json"
            row["alignment"] = f"{before}/displacement_train.csv"
            row["walls"]["render"] = f"{before}/logs/render_train.tsv"
            row["walls"]["align"] = f"{before}/logs/align_train.tsv"
        rows.append(row)
    return rows


def time_inputs(w):
    rows = time_rows(w.scene)
    keys = ("training", "rendering", "alignment")
    files = [row[key] for row in rows for key in keys if key in row]
    return sorted({*files, *(path for row in rows for path in row["walls"].values())})


def score_rows(scene):
    """Method, round and metrics of every row."""
    keys = ("method", "round", "metrics")
    return [{key: row[key] for key in keys} for row in table_rows(scene)]


def score_inputs(w):
    return [row["metrics"] for row in score_rows(w.scene)]


def figure_folder(scene):
    """The reference method's first round: what the photos as taken are."""
    return trained(scene, config["reference"]["method"], 0)


def figure_rounds(scene):
    """Renders and flow of the test views, round by round, of the reference method."""
    method = config["reference"]["method"]
    return [
        {
            "renders": f"{trained(scene, method, k)}/renders/test",
            "flow": f"{trained(scene, method, k)}/flow/test",
        }
        for k in range(last_round(scene, method) + 1)
    ]


def crop_methods(scene):
    """Staged methods and, before them, what each is set against: round 0 of all."""
    bases = [base_of(method) for method in staged()]
    return [
        {
            "method": method,
            "renders": f"{trained(scene, method, 0)}/renders/test",
            "flow": f"{trained(scene, method, 0)}/flow/test",
        }
        for method in dict.fromkeys([*bases, *staged()])
    ]
