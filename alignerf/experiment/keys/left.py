"""What a config with `decide` leaves to the scenes' facts."""

from alignerf.captures import base
from alignerf.experiment.keys.training import OPEN_OF_TRAINING, Training
from alignerf.systems.mipnerf360 import OPEN_OF_MODEL, Grid, Model, Nerf


def leave_open(config):
    """A config as it was written, with all that it leaves to the scenes' facts.

    Without `decide` that is nothing. A complete config says in `decided` what it left;
    what was changed in it since then is no longer left.
    """
    asked = config.get("decide") is True
    models = dict(config.get("models") or {"base": {}})
    for name, model in models.items():
        if model.get("kind", Model().kind) == Model().kind:
            open_keys = open_of_model(model) if asked else []
            models[name] = model | {"decided": open_keys}
    training, scenes = config.get("training") or {}, config["scenes"]
    if asked:
        scenes = {
            name: ({"downscale": "auto"} if base.of(scene).has_path else {}) | scene
            for name, scene in scenes.items()
        }
    own = [one for one in scenes.values() if not base.of(one).parent(one)]
    open_keys = open_of_training(training, own, models.values()) if asked else []
    training = training | {"decided": open_keys}
    return config | {"models": models, "scenes": scenes, "training": training}


def open_of_model(given):
    """The keys that a mip-NeRF 360 as it was written leaves to facts."""
    field = given.get("field") or {}
    usual, grid = Model(), Grid()
    kind = field.get("kind", grid.kind)
    # Only a grid has cells; a field of points contracts nothing.
    fits = {"max_resolution": kind == grid.kind, "radius": kind != Nerf().kind}
    defaults = {
        "near": (usual.near,),
        "radius": (usual.radius,),
        "max_resolution": (grid.max_resolution, usual.field.max_resolution),
    }
    found = []
    for name in OPEN_OF_MODEL:
        value = (field if name == "max_resolution" else given).get(name)
        left = value is None
        if "decided" in given:
            left = name in given["decided"] and value in (None, *defaults[name])
        if left and fits.get(name, True):
            found.append(name)
    return found


def open_of_training(given, scenes, models):
    """Its steps, where neither training nor a scene says how long it is."""
    usual = (None,)
    if "decided" in given:
        if "steps" not in given["decided"]:
            return []
        usual = (None, Training().steps)
    said = [(one.get("steps"), one.get("budget_min")) for one in (given, *scenes)]
    if any("steps" in (model.get("training") or {}) for model in models):
        return []
    if any(steps not in usual or budget_min for steps, budget_min in said):
        return []
    return list(OPEN_OF_TRAINING)
