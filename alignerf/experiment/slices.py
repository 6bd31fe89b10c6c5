"""What each job depends on: its slice of the config, as JSON.

Of all that a config says, a job reruns for a change of its slice alone; for code and
libraries see `sources`. All are functions of the experiment and of the job's names.
"""

import copy
import json

from alignerf.experiment.keys import scene as scene_keys


def as_json(value):
    """Canonical: equal values are equal text."""
    return json.dumps(value, sort_keys=True)


def of_scene(experiment, name):
    """What the poses of a scene depend on: not how long it is trained."""
    scene = experiment.scenes[name]
    unused = {"steps", "budget_min"}
    if not scene_keys.SOURCES[scene["source"]].has_truth:
        unused.add("courtyard")
    if scene["poses"] == "truth" and not scene["triangulate"]:
        unused.add("colmap")
    # Where a `false` changes what is done, the stage has to be told.
    undecided = scene | {"triangulate": None}
    if not (scene_keys.wants_matches(scene) or scene_keys.wants_matches(undecided)):
        unused.add("triangulate")
    if scene_keys.whole_of(scene):
        unused |= {"test_every", "perturb_px", "colmap"}
    optional = ("masks", "zoom", "judged", "pose_convention")
    unused |= {key for key in optional if scene[key] is None}
    return as_json({key: scene[key] for key in scene.keys() - unused})


def complete(experiment, name):
    """The whole config of a scene, as it could be run alone."""
    whole = experiment.whole(name)
    names = [whole, *experiment.windows(whole)]
    found = {one: experiment.scenes[one] for one in names}
    found = experiment.config | {"scenes": found}
    # The order of models and methods has a meaning: tables and defaults follow it.
    return json.dumps(found)


def full(experiment, scene, method):
    """What a training in one go depends on: `refine` and `align` are part of it."""
    chosen = experiment.methods[method]
    learnt = {key: chosen[key] for key in ("refine", "align")}
    return job(experiment, scene, method, "full") | learnt


def warm(experiment, scene, method):
    """What a round depends on that goes on from the weights of the round before."""
    start = experiment.methods[method]["warm_start"]
    slice_of = full(experiment, scene, method)
    training = slice_of["training"] | part_of(slice_of["training"], start["share"])
    training["learning_rates"] = start["learning_rates"]
    return slice_of | {"training": training, "stage": "warm"}


def pretraining(experiment, scene, method):
    """What a pre-training depends on: methods share it that differ in fine-tuning."""
    share = experiment.methods[method]["alignerf"]["pretrain_share"]
    return job(experiment, scene, method, "pretrain") | {"pretrain_share": share}


def finetuning(experiment, scene, method):
    """What a fine-tuning depends on: all that AligNeRF adds."""
    chosen = copy.deepcopy(experiment.methods[method]["alignerf"])
    chosen["frequency_weights"] = frequency_weights_of(experiment, method)
    if chosen["radius_px"] == "auto":
        chosen["radius_px"] = None
    return job(experiment, scene, method, "finetune") | {"alignerf": chosen}


def external(experiment, scene, method):
    """What a training by another program depends on: its commands, and their numbers.

    Not what it asks for of the machine.
    """
    commands = of_commands(experiment.methods[method])
    text = " ".join(filter(None, commands.values()))
    chosen = experiment.scenes[scene]
    used = {key: chosen[key] for key in ("seed", "steps") if f"{{{key}}}" in text}
    return {"external": commands | used}


def of_commands(method):
    """The commands of an external method, or the folders that stand for them."""
    asked = ("gpu", "mem_mb")
    return {key: v for key, v in method["external"].items() if key not in asked}


def job(experiment, scene, method, stage):
    """Seed, stage, model and training, which all stages have."""
    config = experiment.config
    model = config["models"][experiment.methods[method]["model"]]
    return {
        "seed": experiment.scenes[scene]["seed"],
        "stage": stage,
        "model": model_of(model, experiment.scenes[scene]),
        "training": training_of(config, scene) | model["training"],
        "alignerf": None,
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
