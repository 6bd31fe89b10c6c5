# Functions only: each job's slice of the config, and paths.
import ast
import copy
import functools
import hashlib
import json
import os
import re
import sys
from pathlib import Path


def prepend_to(variable, folder):
    """Put a folder first in a search path that the jobs inherit."""
    rest = os.environ.get(variable)
    os.environ[variable] = os.pathsep.join([str(folder), *filter(None, [rest])])


# As the schema says.
MOST_ROUNDS = 4
# Compiled JAX programs are kept between jobs and runs.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path("results/.jax_cache")))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.5")
# Jobs run the sources beside the Snakefile, wherever the results go, with the Python
# that runs Snakemake, also where its environment is not activated.
prepend_to("PYTHONPATH", ROOT)
prepend_to("PATH", Path(sys.executable).parent)


def staged():
    """Methods that pre-train and fine-tune."""
    return [name for name, m in config["methods"].items() if "alignerf" in m]


def plain():
    """Methods trained in one go, on photos or warped photos."""
    return [name for name in config["methods"] if name not in staged()]


def warm():
    """Methods whose rounds go on from the weights of the round before."""
    return [name for name, m in config["methods"].items() if "warm_start" in m]


def one_of(names):
    """Regular expression of these names; of none, it matches nothing."""
    return "|".join(map(re.escape, sorted(names))) or r"(?!)"


def with_truth(known=True):
    """Scenes whose truth is known (or not)."""
    return [
        name
        for name, scene in config["scenes"].items()
        if (scene["source"] == "courtyard") == known
    ]


def as_json(value):
    """Canonical JSON: a job reruns when, and only when, its slice changes."""
    return json.dumps(value, sort_keys=True)


def scene_slice(name):
    """What the poses of a scene depend on."""
    return as_json({"seed": config["seed"]} | config["scenes"][name])


def train_slice(*, stage, model, method=None):
    """What a training, and a rendering of its result, depend on."""
    settings = None
    if stage != "full":
        settings = copy.deepcopy(config["methods"][method]["alignerf"])
        settings["frequency_weights"] = config["frequency_weights"]
    if stage == "pretrain":
        # Ablations share the pre-training: only its length is part of the job.
        settings |= {key: PRETRAIN_IGNORES[key] for key in PRETRAIN_IGNORES}
    return as_json(
        {
            "seed": config["seed"],
            "stage": stage,
            "model": config["models"][model],
            "training": config["training"],
            "alignerf": settings,
        }
    )


PRETRAIN_IGNORES = {
    "finetune_share": 0.0,
    "learning_rates": [0.0, 0.0],
    "patches": 0,
    "patch_px": 0,
    "radius_px": 0,
    "align_penalty": 0.0,
    "features": 3,
    "frequency_weight": 0.0,
    "frequency_weights": None,
}


def method_slice(method):
    """The slice of a method's last stage."""
    stage = "finetune" if method in staged() else "full"
    model = config["methods"][method]["model"]
    if method in warm():
        return warm_slice(method)
    return train_slice(stage=stage, model=model, method=method)


def warm_slice(method):
    """The slice of a round that goes on from the round before."""
    job = json.loads(
        train_slice(stage="full", model=config["methods"][method]["model"])
    )
    start, training = config["methods"][method]["warm_start"], job["training"]
    training |= {
        "steps": max(1, round(start["share"] * training["steps"])),
        "warmup_steps": round(start["share"] * training["warmup_steps"]),
        "learning_rates": start["learning_rates"],
    }
    return as_json(job | {"stage": "warm", "training": training})


def pretrain_slice(model):
    """The slice of a model's pre-training, from any method that starts with it."""
    users = [m for m in staged() if config["methods"][m]["model"] == model]
    slices = {train_slice(stage="pretrain", model=model, method=m) for m in users}
    if len(slices) != 1:
        stop(f"config: methods {', '.join(users)} disagree about {model}'s pretraining")
    return slices.pop()


@functools.cache
def sources_of(module):
    """SHA-256 of the sources that `python -m module` runs: a change reruns its jobs."""
    todo, seen = [module], set()
    while todo:
        name = todo.pop()
        path = ROOT / Path(*name.split("."))
        path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if path in seen or not path.is_file():
            continue
        seen.add(path)
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                todo += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                todo.append(node.module)
                todo += [f"{node.module}.{alias.name}" for alias in node.names]
    digest = hashlib.sha256()
    for path in sorted(seen):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def flow_options(scene, method, round, split):
    """Command line of the flow's settings, for the views that it is estimated of."""
    flow = config["flow"]
    if flow["method"] != "files":
        return control_options()
    names = {"scene": scene, "method": method, "round": round, "split": split}
    folder = flow["folder"].format(**names)
    return [*control_options(), "--method", "files", "--flows", folder]


def reference_flow_options(scene):
    """The same for the warped test set."""
    method = config["reference"]["method"]
    return flow_options(scene, method, reference_round(scene), "test")


def control_options():
    """Command line of the estimator's settings, also for images that we make.

    For those no flows are made elsewhere: then it is the default estimator.
    """
    flow = config["flow"]
    blur = "--match-blur" if flow["match_blur"] else "--no-match-blur"
    pairs = {"--kernel": flow["kernel"], "--tolerance-px": flow["tolerance_px"]}
    if flow["method"] != "files":
        pairs["--method"] = flow["method"]
    return [blur, *(str(part) for pair in pairs.items() for part in pair)]


def field_name(method):
    """How a table calls a method's field, and what its frequency loss looks at."""
    field = config["models"][config["methods"][method]["model"]]["field"]
    size = field["width"] if field["kind"] == "mlp" else f"2^{field['log2_entries']}"
    name = f"{field['kind']} {size}"
    if method not in staged():
        return name
    return f"{name}, {'VGG-19' if config['frequency_weights'] else 'derivative bank'}"


def option(name, value):
    """`--name value` for a shell line, nothing where there is no value."""
    return [f"--{name}", str(value)] if value else []


def lpips_options():
    """Command line of the networks of LPIPS whose weights the config names."""
    found = [option(f"lpips-{net}", path) for net, path in config["lpips"].items()]
    return sum(found, [])


def trained(scene, method, round):
    """Folder of a method's round; with a warm start, round 0 is another method's."""
    if method in warm() and int(round) == 0:
        method = config["methods"][method]["warm_start"]["from"]
    return f"results/{scene}/{method}/round{round}"


def last_round(scene, method):
    """A method's last round. With `rounds: auto`, what the rounds so far have shown."""
    found = config["methods"][method]
    if found["rounds"] != "auto":
        return found["rounds"]
    for k in range(found.get("most_rounds", MOST_ROUNDS)):
        place = {"scene": scene, "method": method, "round": k}
        decision = Path(checkpoints.decide.get(**place).output[0])
        if not json.loads(decision.read_text())["go_on"]:
            return k
    return k + 1


def reference_round(scene):
    """The round whose renders the warped test set is made from."""
    reference = config["reference"]
    if reference["round"] == "last":
        return last_round(scene, reference["method"])
    return reference["round"]


def all_rounds(scene):
    """(method, round) of every row of the tables, in the config's order."""
    return [
        (name, k)
        for name in config["methods"]
        for k in range(int(name in warm()), last_round(scene, name) + 1)
    ]


def trainings_of(scene, method, round):
    """timing.json of every training that a round needed."""
    if method in staged():
        model = config["methods"][method]["model"]
        first = f"results/{scene}/pretrain/{model}/timing.json"
        return [first, f"{trained(scene, method, round)}/timing.json"]
    return [f"{trained(scene, method, k)}/timing.json" for k in range(int(round) + 1)]


def data_of(scene, method, round):
    """Timing files of the rendering and warping between the rounds."""
    return [
        f"{trained(scene, method, k)}/{name}"
        for k in range(int(round))
        for name in ("render_train.json", "displacement_train.csv")
    ]


def photos_of_round(w):
    """What round k learns from: the photos, or those warped onto round k - 1."""
    if w.round == "0":
        return {"photos": f"results/{w.scene}/images"}
    before = trained(w.scene, w.method, int(w.round) - 1)
    return {"photos": f"{before}/warped/train", "valid": f"{before}/flow/train"}


def flows_of_rounds(w):
    """The training views' flow after a round, and that of the round before."""
    k, flow = int(w.round), "flow/train"
    found = {"flow": f"{trained(w.scene, w.method, k)}/{flow}"}
    if k > 0:
        found["before_flow"] = f"{trained(w.scene, w.method, k - 1)}/{flow}"
        # The decision is the method's own, also where it starts from another's round.
        found["before"] = f"results/{w.scene}/{w.method}/round{k - 1}/decision.json"
    return found


def reference_views(scene, kind):
    """Renders or depth of the test views by the model that makes the warped test set."""
    folder = trained(scene, config["reference"]["method"], reference_round(scene))
    return f"{folder}/{kind}/test"


# Folders of flow.control_sets beside the warped test set.
CONTROL_SETS = (
    *("control", "placebo", "held_out"),
    *("aligned", "leak", "leak_flow", "leak_held_out"),
)


def truth_of(w):
    """The oracle's folder, where the scene's truth is known."""
    return {"truth": f"results/{w.scene}/truth"} if w.scene in with_truth() else {}


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


def model_flow_of(w):
    """The flow from render to oracle, where the scene's truth is known."""
    if w.scene not in with_truth():
        return {}
    return {"model": f"{trained(w.scene, w.method, w.round)}/flow_oracle/test"}


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


def table_rows(scene):
    """One entry per method and round, with the files that its row comes from."""
    return [
        {
            "method": method,
            "field": field_name(method),
            "round": round,
            "metrics": f"{trained(scene, method, round)}/metrics.csv",
            "base": base_of(method),
            "base_metrics": f"{trained(scene, base_of(method), 0)}/metrics.csv",
            "trainings": trainings_of(scene, method, round),
            "data": data_of(scene, method, round),
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


def flow_benchmark_models(scene):
    """<method>/round<k> of the reference method, before and after all warping."""
    method = config["reference"]["method"]
    rounds = sorted({0, last_round(scene, method)})
    found = [trained(scene, method, k) for k in rounds]
    return [folder.removeprefix(f"results/{scene}/") for folder in found]


def flow_benchmark_scene():
    """Command line of the scene with a truth, the config's first; or none."""
    return [
        part
        for name in with_truth()[:1]
        for part in (
            *("--scene", f"results/{name}"),
            *("--renders", *flow_benchmark_models(name)),
        )
    ]


def flow_benchmark_inputs(w):
    """Photos, truth and renders of that scene."""
    return [
        f"results/{name}/{path}"
        for name in with_truth()[:1]
        for path in (
            *("images", "truth"),
            *(f"{model}/renders/test" for model in flow_benchmark_models(name)),
        )
    ]


def sweep():
    """The config's tradeoff: its scene, and its variants from the base on."""
    if "tradeoff" not in config:
        stop("config: tradeoff: not there, see workflow/config/demo.yaml")
    found = config["tradeoff"]
    return found["scene"], {"base": {}} | found["variants"]


def variant_slice(name):
    """What the training of a variant, and a rendering of it, depend on."""
    job = variant_of(config, name)
    del job["downscale"]
    return as_json(job | {"stage": "full", "alignerf": None})


def photos_of_variant(w):
    """The scene's own photos and cameras, or those made smaller."""
    folder, factor = f"results/{w.scene}", variant_of(config, w.variant)["downscale"]
    if factor != 1:
        folder = f"{folder}/tradeoff/downscale-{factor}"
    return {"photos": f"{folder}/images", "cameras": f"{folder}/cameras.npz"}


def sweep_rows():
    """One entry per variant, with the files that its row comes from."""
    scene, variants = sweep()
    folders = {name: f"results/{scene}/tradeoff/{name}" for name in variants}
    return [
        {
            "variant": name,
            "changes": variants[name],
            "metrics": f"{folder}/metrics.csv",
            "training": f"{folder}/timing.json",
            "rendering": f"{folder}/render_test.json",
        }
        for name, folder in folders.items()
    ]


def sweep_inputs(w):
    keys = ("metrics", "training", "rendering")
    return [row[key] for row in sweep_rows() for key in keys]


def ranking_tables(scene):
    """Where the truth is known, whether other test sets rank as it does."""
    known = scene in with_truth()
    return [
        f"results/{scene}/tables/ranking.{kind}" for kind in ("csv", "tex") if known
    ]


def scene_targets(scene):
    """What `snakemake SCENE` makes."""
    folder = f"results/{scene}"
    return [
        f"{folder}/facts.json",
        f"{folder}/tables/misalignment.csv",
        f"{folder}/tables/misalignment.tex",
        f"{folder}/tables/round_times.csv",
        f"{folder}/tables/round_times.tex",
        f"{folder}/tables/controls.csv",
        f"{folder}/tables/controls.tex",
        *ranking_tables(scene),
        f"{folder}/tables/displacement.csv",
        f"{folder}/tables/displacement.tex",
        f"{folder}/figures/flow.png",
        f"{folder}/figures/rounds.png",
        f"{folder}/figures/views.png",
        f"{folder}/figures/lengths.png",
        f"{folder}/figures/curves.png",
    ]
