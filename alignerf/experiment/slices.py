"""What each job depends on: its slice of the config, as JSON.

Of all that a config says, a job reruns for a change of its slice alone; for code and
libraries see `sources`. All are functions of the experiment and of the job's names.
"""

import copy
import json

from alignerf.experiment import settings

# Ablations share the pre-training: only its length is part of the job. What is nothing
# to it is written over with these.
PRETRAIN_HAS_NONE = {
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


def as_json(value):
    """Canonical: equal values are equal text."""
    return json.dumps(value, sort_keys=True)


def of_scene(experiment, name):
    """What the poses of a scene depend on: not how long it is trained."""
    scene = experiment.scenes[name]
    unused = {"steps", "budget_min"}
    if not settings.SOURCES[scene["source"]].has_truth:
        unused.add("courtyard")
    if scene["poses"] != "colmap":
        unused.add("colmap")
    if not settings.wants_points(scene):
        unused.add("triangulate")
    if scene["masks"] is None:
        unused.add("masks")
    return as_json({key: scene[key] for key in scene.keys() - unused})


def complete(experiment, name):
    """The whole config of a scene, as it could be run alone."""
    found = experiment.config | {"scenes": {name: experiment.scenes[name]}}
    if found["tradeoff"] and found["tradeoff"]["scene"] != name:
        found["tradeoff"] = None
    # The order of models and methods has a meaning: tables and defaults follow it.
    return json.dumps(found)


def of_round(experiment, scene, method):
    """What the training of a method's last stage, and its renders, depend on."""
    return as_json(round_job(experiment, scene, method))


def round_job(experiment, scene, method):
    """The same before it is text."""
    if method in experiment.staged():
        return job(experiment, scene, method, "finetune")
    found = job(experiment, scene, method, "full")
    found |= {key: experiment.methods[method][key] for key in ("refine", "align")}
    if method not in experiment.warm():
        return found
    start, training = experiment.methods[method]["warm_start"], found["training"]
    training |= part_of(training, start["share"])
    training["learning_rates"] = start["learning_rates"]
    return found | {"stage": "warm"}


def of_pretraining(experiment, scene, model):
    """What a model's pre-training depends on, which staged methods share."""
    users = [m for m in experiment.staged() if experiment.methods[m]["model"] == model]
    return as_json(job(experiment, scene, users[0], "pretrain"))


def of_variant(experiment, name):
    """What the training of a point of the sweep, and its renders, depend on."""
    found = variant_of(experiment.config, name)
    del found["downscale"]
    scene = experiment.config["tradeoff"]["scene"]
    found["decisions"] = decisions_of(experiment.config, scene)
    return as_json(found | {"stage": "full", "alignerf": None})


def job(experiment, scene, method, stage):
    """Seed, stage, model, training and, of a staged one, AligNeRF's settings."""
    config = experiment.config
    found = None
    if stage != "full":
        found = copy.deepcopy(experiment.methods[method]["alignerf"])
        found["frequency_weights"] = frequency_weights_of(experiment, method)
        if found["radius_px"] == "auto":
            found["radius_px"] = None
    if stage == "pretrain":
        found |= PRETRAIN_HAS_NONE
    model = config["models"][experiment.methods[method]["model"]]
    return {
        "seed": experiment.scenes[scene]["seed"],
        "stage": stage,
        "model": model_of(model, experiment.scenes[scene]),
        "training": training_of(config, scene) | model["training"],
        "alignerf": found,
        "decisions": decisions_of(config, scene),
    }


def model_of(model, scene):
    """A model as a job has it: its training is the job's, its background a scene's.

    Transparent pixels stand on the scene's background, so a model that leaves its own
    open knows it.
    """
    found = model | {"training": {}}
    if found.get("background", "") is None:
        found["background"] = scene["background"]
    return found


def decisions_of(config, scene):
    """The file that says what a scene's facts decided; null where nothing is left."""
    open_keys = [config["training"]["decided"]]
    open_keys += [model.get("decided") for model in config["models"].values()]
    return f"results/{scene}/decisions.json" if any(open_keys) else None


def frequency_weights_of(experiment, method):
    """The weights file, where the method's loss looks through it."""
    weighs = experiment.methods[method]["alignerf"]["frequency_weight"] > 0
    return experiment.config["frequency_weights"] if weighs else None


def training_of(config, scene):
    """The config's training, as long as the scene asks for."""
    found, chosen = config["training"], config["scenes"][scene]
    return found | retimed(found, chosen["steps"], chosen["budget_min"])


def retimed(training, steps, budget_min=None):
    """Another length; a given warm-up keeps its share of the steps, where known."""
    warmup_steps = training["warmup_steps"]
    if warmup_steps and steps and training["steps"]:
        warmup_steps = round(warmup_steps / training["steps"] * steps)
    return {"steps": steps, "budget_min": budget_min, "warmup_steps": warmup_steps}


def part_of(training, share):
    """A share of the length, and of a given warm-up."""
    if training["budget_min"] is None:
        return retimed(training, max(1, round(share * training["steps"])))
    warmup_steps = training["warmup_steps"]
    return {
        "budget_min": share * training["budget_min"],
        "warmup_steps": warmup_steps and round(share * warmup_steps),
    }


def variant_of(config, name):
    """A point of the sweep: seed, downscale, model and training.

    `base` or a variant. A field of a kind is whole, one without changes keys of the
    base's field; the base's warm-up keeps its share of the steps.
    """
    sweep = config["tradeoff"]
    change = {} if name == "base" else dict(sweep["variants"][name])
    model = config["models"][sweep["model"]]
    training = training_of(config, sweep["scene"])
    for key in ("proposal", "field"):
        if key in change and "kind" not in change[key]:
            change[key] = model[key] | change[key]
    length = change.get("steps"), change.get("budget_min")
    if any(length):
        change = retimed(training, *length) | change
    found = {"seed": config["scenes"][sweep["scene"]]["seed"], "downscale": 1}
    found = {key: change.pop(key, value) for key, value in found.items()}
    training |= model["training"]
    model = model_of(model, config["scenes"][sweep["scene"]])
    if any(length) or "warmup_steps" in change:
        training["decided"] = []
    of_training = {key: change.pop(key) for key in set(change) & set(training)}
    model |= change
    if "field" in change:
        # The point says its field whole, or what is to be seen of it.
        model["decided"] = [name for name in model["decided"] if name != "finest"]
    return found | {"model": model, "training": training | of_training}
