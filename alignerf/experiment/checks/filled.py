"""Defaults that depend on other keys, paths written out, scenes varied."""

import copy
import itertools

from alignerf import methods
from alignerf.captures import base
from alignerf.experiment import schema
from alignerf.experiment.checks.common import fault, first, home
from alignerf.experiment.keys import scene as scene_keys
from alignerf.experiment.keys import training as training_keys


def completed(config):
    """Fills the defaults that depend on other keys, and writes out paths."""
    given = (config["lpips"] or {}).items()
    config["lpips"] = {net: home(path) for net, path in given if path}
    config["frequency_weights"] = home(config["frequency_weights"])
    config["flow"]["folder"] = home(config["flow"]["folder"])
    if not any((config["aligned_pose"] or {}).values()):
        config["aligned_pose"] = None
    training = config["training"]
    training |= training_keys.length(training)
    for scene in config["scenes"].values():
        scene |= {key: home(scene[key]) for key in ("path", "masks")}
        scene["poses"] = base.of(scene).poses_of(scene)
        if scene["seed"] is None:
            scene["seed"] = config["seed"]
        if not (scene["steps"] or scene["budget_min"]):
            scene |= training_keys.length(training)
    config["scenes"] = varied(config)
    config["vary"] = None
    config["scenes"] |= crops_of(config)
    config["crops"] = None
    for method in config["methods"].values():
        for _, mapping, key in methods.named_folders(method):
            mapping[key] = home(mapping[key])
        if methods.of_method(method).ours:
            method["model"] = method["model"] or first(config["models"])
    of = methods.of_method
    scratch = [n for n, m in config["methods"].items() if of(m).from_scratch]
    reference = config["reference"]
    reference["method"] = reference["method"] or first([*scratch, *config["methods"]])
    return config


def varied(config):
    """The scenes, each with all seeds and lengths that `vary` asks for."""
    vary, found = config["vary"], {}
    if not vary:
        return config["scenes"]
    for name, scene in config["scenes"].items():
        seeds = vary["seeds"] or [scene["seed"]]
        # The scene as it is comes first: other keys may mean the first scene.
        lengths = sorted(vary["lengths"], key=lambda share: share != 1)
        for seed, share in itertools.product(seeds, lengths):
            again = name if seed == seeds[0] else f"{name}_seed{seed}"
            if share != 1:
                again += f"_x{share:g}"
            if again in found or (again != name and again in config["scenes"]):
                fault("vary", f"there would be two scenes {again}")
            steps, budget_min = scene["steps"], scene["budget_min"]
            found[again] = copy.deepcopy(scene) | {
                "seed": seed,
                "steps": steps and max(1, round(share * steps)),
                "budget_min": budget_min and share * budget_min,
            }
            schema.check(scene_keys.Scene, found[again], "scenes", again)
    return found


def crops_of(config):
    """The scenes that `crops` adds: of each scene's photos, at their own size."""
    asked, found = config["crops"], {}
    if not asked:
        return found
    of = methods.of_method
    aligned = [name for name, one in config["methods"].items() if of(one).in_loop]
    length = {"steps": asked["steps"], "budget_min": None}
    for name, scene in config["scenes"].items():
        if base.of(scene).parent(scene):
            continue
        for method in (None, *aligned[:1]):
            crop = {"of": name, "px": asked["px"], "count": asked["count"]}
            crop = schema.filled(scene_keys.Crop, crop | {"cameras": method})
            again = f"{name}_crops" + (f"_{method}" if method else "")
            if again in config["scenes"]:
                fault("crops", f"there would be two scenes {again}")
            whole = {"downscale": 1, "perturb_px": 0.0, "crop": crop}
            found[again] = copy.deepcopy(scene) | whole | length
    return found
