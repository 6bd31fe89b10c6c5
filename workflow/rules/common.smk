# Functions only: each job's slice of the config, and paths.
import ast
import copy
import functools
import hashlib
import json
import os
import re
import sys
import types
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
    scene = {"seed": config["seed"]} | config["scenes"][name]
    return as_json({key: scene[key] for key in scene if key != "steps"})


def train_slice(*, scene, stage, model, method=None):
    """What a training, and a rendering of its result, depend on."""
    settings = None
    if stage != "full":
        settings = copy.deepcopy(config["methods"][method]["alignerf"])
        settings["frequency_weights"] = frequency_weights_of(method)
        if settings["radius_px"] == "auto":
            settings["radius_px"] = None
    if stage == "pretrain":
        # Ablations share the pre-training: only its length is part of the job.
        settings |= {key: PRETRAIN_IGNORES[key] for key in PRETRAIN_IGNORES}
    return as_json(
        {
            "seed": config["scenes"][scene].get("seed", config["seed"]),
            "stage": stage,
            "model": config["models"][model],
            "training": training_of(config, scene),
            "alignerf": settings,
        }
    )


def frequency_weights_of(method):
    """The weights file, where the method's loss looks through it."""
    weighs = config["methods"][method]["alignerf"]["frequency_weight"] > 0
    return config["frequency_weights"] if weighs else None


PRETRAIN_IGNORES = {
    "finetune_share": 0.0,
    "learning_rates": [0.0, 0.0],
    "patches": 0,
    "patch_px": 0,
    "convolution": False,
    "features": 3,
    "matching": "patch",
    "error": "squared",
    "radius_px": 0,
    "align_penalty": 0.0,
    "frequency_weight": 0.0,
    "frequency_weights": None,
}


def method_slice(scene, method):
    """The slice of a method's last stage."""
    stage = "finetune" if method in staged() else "full"
    model = config["methods"][method]["model"]
    if method in warm():
        return warm_slice(scene, method)
    return train_slice(scene=scene, stage=stage, model=model, method=method)


def warm_slice(scene, method):
    """The slice of a round that goes on from the round before."""
    model = config["methods"][method]["model"]
    job = json.loads(train_slice(scene=scene, stage="full", model=model))
    start, training = config["methods"][method]["warm_start"], job["training"]
    steps = max(1, round(start["share"] * training["steps"]))
    training |= rescaled(training, steps)
    training["learning_rates"] = start["learning_rates"]
    return as_json(job | {"stage": "warm", "training": training})


def pretrain_slice(scene, model):
    """The slice of a model's pre-training, from any method that starts with it."""
    users = [m for m in staged() if config["methods"][m]["model"] == model]
    job = {"scene": scene, "stage": "pretrain", "model": model}
    slices = {train_slice(**job, method=m) for m in users}
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


def displacement_for_radius(w):
    """With `radius_px: auto`, how far the baseline's training views are off."""
    settings = config["methods"][w.method].get("alignerf", {})
    if settings.get("radius_px") != "auto":
        return {}
    folder = trained(w.scene, base_of(w.method), 0)
    return {"displacement": f"{folder}/displacement_train.csv"}


def photos_of_round(w):
    """What round k learns from: the photos, or those warped onto round k - 1."""
    if w.round == "0":
        return {"photos": f"results/{w.scene}/images"}
    before = trained(w.scene, w.method, int(w.round) - 1)
    return {"photos": f"{before}/warped/train", "valid": f"{before}/flow/train"}


def truth_of(w):
    """The oracle's folder, where the scene's truth is known."""
    return {"truth": f"results/{w.scene}/truth"} if w.scene in with_truth() else {}
