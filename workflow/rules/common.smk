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
    return train_slice(stage=stage, model=model, method=method)


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


def flow_options():
    """Command line of the flow's settings."""
    flow = config["flow"]
    blur = "--match-blur" if flow["match_blur"] else "--no-match-blur"
    pairs = {
        "--method": flow["method"],
        "--kernel": flow["kernel"],
        "--tolerance-px": flow["tolerance_px"],
    }
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


def trained(scene, method, round):
    """Folder of a method's round."""
    return f"results/{scene}/{method}/round{round}"


def all_rounds():
    """(method, round) of every row of the tables, in the config's order."""
    return [
        (name, k)
        for name, method in config["methods"].items()
        for k in range(method["rounds"] + 1)
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


def truth_of(w):
    """The oracle's folder, where the scene's truth is known."""
    return {"truth": f"results/{w.scene}/truth"} if w.scene in with_truth() else {}


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
        for method, round in all_rounds()
    ]


def table_rows(scene):
    """One entry per method and round, with the files that its row comes from."""
    return [
        {
            "method": method,
            "field": field_name(method),
            "round": round,
            "metrics": f"{trained(scene, method, round)}/metrics.csv",
            "trainings": trainings_of(scene, method, round),
            "data": data_of(scene, method, round),
        }
        for method, round in all_rounds()
    ]


def table_inputs(w):
    rows = table_rows(w.scene)
    files = [[r["metrics"], *r["trainings"], *r["data"]] for r in rows]
    return sorted({path for row in files for path in row})


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
        for k in range(config["methods"][method]["rounds"] + 1)
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


def scene_targets(scene):
    """What `snakemake SCENE` makes."""
    folder = f"results/{scene}"
    return [
        f"{folder}/facts.json",
        f"{folder}/tables/misalignment.csv",
        f"{folder}/tables/misalignment.tex",
        f"{folder}/tables/displacement.csv",
        f"{folder}/tables/displacement.tex",
        f"{folder}/figures/flow.png",
        f"{folder}/figures/rounds.png",
        f"{folder}/figures/views.png",
        f"{folder}/figures/lengths.png",
        f"{folder}/figures/curves.png",
    ]
