"""Defaults that depend on other keys, and scenes varied."""

import itertools

from alignerf import methods
from alignerf.captures import base
from alignerf.experiment import schema
from alignerf.experiment.checks.common import fault, first
from alignerf.experiment.keys import config as config_keys
from alignerf.experiment.keys import scene as scene_keys


def completed(config):
    """The config, with the defaults that depend on other keys."""
    models, training = config.models, config.training
    closed = {
        name: one.closed(dict.fromkeys(one.open) if config.decide else {})
        for name, one in models.items()
    }
    if not is_open(config):
        training = training.model_copy(update={"steps": training.whole})
    of, chosen = methods.of_method, {}
    for name, one in config.methods.items():
        usual = first(models) if of(one).ours else None
        chosen[name] = one.model_copy(update={"model": one.model or usual})
    scratch = [name for name, one in chosen.items() if of(one).from_scratch]
    method = config.reference.method or first([*scratch, *chosen])
    found = {
        "models": closed,
        "training": training,
        "methods": chosen,
        "reference": config.reference.model_copy(update={"method": method}),
        "lpips": config.lpips or config_keys.Lpips(),
        "scenes": {
            name: of_scene(config, training, name, one)
            for name, one in config.scenes.items()
        },
    }
    config = config.model_copy(update=found)
    config = config.model_copy(update={"scenes": varied(config), "vary": None})
    scenes = config.scenes | crops_of(config)
    return config.model_copy(update={"scenes": scenes, "crops": None})


def is_open(config):
    """Whether facts decide the steps: nothing in the config says how many."""
    own = (one for one in config.scenes.values() if not base.of(one).parent(one))
    lengths = [config.training, *own]
    said = any(one.steps or one.budget_min for one in lengths)
    said = said or any(one.training.steps for one in config.models.values())
    return config.decide and not said


def of_scene(config, training, name, scene):
    """The scene with what the config says of all."""
    found = {"poses": base.of(scene).poses_of(scene)}
    if scene.seed is None:
        found["seed"] = config.seed
    elif config.vary and config.vary.seeds:
        fault(f"scenes.{name}.seed", "not beside vary.seeds")
    if not (scene.steps or scene.budget_min):
        found |= {"steps": training.steps, "budget_min": training.budget_min}
    small = config.decide and "downscale" not in scene.given
    if small and base.of(scene).has_path and base.of(scene).trains:
        found["downscale"] = "auto"
    return scene.model_copy(update=found)


def varied(config):
    """The scenes, each with all seeds and lengths that `vary` asks for."""
    vary, found = config.vary, {}
    if not vary:
        return config.scenes
    for name, scene in config.scenes.items():
        seeds = vary.seeds or [scene.seed]
        # The scene as it is comes first: other keys may mean the first scene.
        lengths = sorted(vary.lengths, key=lambda share: share != 1)
        for seed, share in itertools.product(seeds, lengths):
            again = name if seed == seeds[0] else f"{name}_seed{seed}"
            changed = {"seed": seed}
            if share != 1:
                again += f"_x{share:g}"
                minutes, steps = scene.budget_min, scene.steps
                steps = steps or (None if minutes else config.training.whole)
                changed["steps"] = steps and max(1, round(share * steps))
                changed["budget_min"] = minutes and share * minutes
            if again in found or (again != name and again in config.scenes):
                fault("vary", f"there would be two scenes {again}")
            found[again] = changed_scene(again, scene, changed)
    return found


def changed_scene(name, scene, changed):
    """Another scene of this name; ValueError for keys that it cannot have."""
    values = scene.model_dump() | changed
    return schema.check(scene_keys.Scene, values, "scenes", name)


def crops_of(config):
    """The scenes that `crops` adds: of each scene's photos, at their own size."""
    asked, found = config.crops, {}
    if not asked:
        return found
    of = methods.of_method
    aligned = [name for name, one in config.methods.items() if of(one).in_loop]
    whole = {"downscale": 1, "perturb_px": 0.0}
    whole |= {"steps": asked.steps, "budget_min": None}
    for name, scene in config.scenes.items():
        if base.of(scene).parent(scene):
            continue
        for method in (None, *aligned[:1]):
            again = f"{name}_crops" + (f"_{method}" if method else "")
            if again in config.scenes:
                fault("crops", f"there would be two scenes {again}")
            crop = {"of": name, "px": asked.px, "count": asked.count}
            crop = whole | {"crop": crop | {"cameras": method}}
            found[again] = changed_scene(again, scene, crop)
    return found
