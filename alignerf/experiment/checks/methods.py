"""Methods: their models and rounds, where they start from, what they cannot have."""

from pathlib import Path

from alignerf.experiment import jobs, kinds, schema
from alignerf.experiment.checks import external
from alignerf.experiment.checks.common import (
    check_path_variable,
    fault,
    is_derived,
    is_there,
)
from alignerf.experiment.keys import method as method_keys
from alignerf.experiment.keys import scene as scene_keys

# Keys of a method that is another program's renders.
OF_RENDERS = ("renders", "published")


def check_method(config, name):
    """Its model, where it starts from, and what a staged training cannot have."""
    method = config["methods"][name]
    if method["renders"]:
        check_renders(config, name)
        return
    if method["external"]:
        external.check(config, name)
        return
    if method["model"] not in config["models"]:
        fault(f"methods.{name}.model", f"no model {method['model']!r}")
    own = kinds.of_method(method)
    if own in kinds.OF_OTHERS:
        check_foreign(config, name, own)
    kind = config["models"][method["model"]]["kind"]
    for stage in ("alignerf", "refine"):
        if method[stage] and kind != "mipnerf360":
            fault(f"methods.{name}.{stage}", f"not of a model of kind {kind}")
    if method["warm_start"]:
        check_warm_start(config, name)
    check_changes(method, f"methods.{name}.changes")
    if method["refine"] and (
        method["alignerf"] or method["warm_start"] or method["rounds"] != 0
    ):
        fault(f"methods.{name}.refine", "not beside rounds, warm_start or alignerf")
    if method["adjust"] and (
        method["alignerf"] or method["warm_start"] or method["rounds"] != 0
    ):
        fault(f"methods.{name}.adjust", "not beside rounds, warm_start or alignerf")
    crops = [
        n for n, s in config["scenes"].items() if s["zoom"] and not s["zoom"]["of"]
    ]
    if method["adjust"] and crops:
        what = f"scenes.{crops[0]} is of crops: give it poses: adjusted"
        fault(f"methods.{name}.adjust", what)
    if method["align"]:
        check_align(config, name)
    shares = (method["refine"] or {}).get("coarse_to_fine")
    if shares and not shares[0] < shares[1] < 1:
        fault(f"methods.{name}.refine.coarse_to_fine", "two shares, first < last < 1")
    if not (found := method["alignerf"]):
        return
    if method["rounds"] != 0:
        fault(f"methods.{name}.rounds", "0 was expected: a staged training has none")
    if found["matching"] == "pixel" and found["radius_px"] == 0:
        fault(f"methods.{name}.alignerf.radius_px", "matching pixel needs 1 or more")
    if found["radius_px"] == "auto":
        check_radius(config, name)


def check_foreign(config, name, kind):
    """A kind of another package stands alone, and checks itself."""
    method = config["methods"][name]
    foreign = [one.KEY for one in kinds.OF_OTHERS if one is not kind]
    own_keys = ("alignerf", "refine", "align", "warm_start", "external")
    for key in (*own_keys, *foreign):
        if method[key]:
            fault(f"methods.{name}.{key}", f"not beside {kind.KEY}")
    if hasattr(kind, "check"):
        kind.check(config, name)


def check_align(config, name):
    """One training, that stops at places of its own, and puts something right there."""
    method, where = config["methods"][name], f"methods.{name}.align"
    others = [key for key in ("alignerf", "warm_start", "refine") if method[key]]
    if others or method["rounds"] != 0 or method["changes"] != "photos":
        others += ["rounds"] * (method["rounds"] != 0)
        fault(where, f"not beside {' or '.join(others or ['changes'])}")
    chosen = method_keys.Align.model_validate(method["align"])
    if not (chosen.cameras_at or chosen.photos_at):
        fault(where, "cameras_at or photos_at: it needs a share at which to align")
    others = [m for n, m in config["methods"].items() if n != name]
    if not any(m["model"] == method["model"] and not is_derived(m) for m in others):
        what = f"another method of model {method['model']!r} without align"
        fault(where, f"it needs {what}, to say what it brought")
    whole = [s for s in config["scenes"].values() if not scene_keys.whole_of(s)]
    lengths = [scene["steps"] for scene in whole]
    for steps in {steps for steps in lengths if steps}:
        jobs.places(chosen, steps, where)


def check_renders(config, name):
    """Another program's renders: nothing is trained, and a folder for each scene."""
    method = config["methods"][name]
    trained = {key: value for key, value in method.items() if key not in OF_RENDERS}
    default = schema.as_config(method_keys.Method())
    for key, value in trained.items():
        if value != default[key]:
            fault(f"methods.{name}.{key}", "not beside renders: nothing is trained")
    where = f"methods.{name}.renders"
    rest = method["renders"].replace("{scene}", "")
    if set(rest) & set("{}"):
        fault(where, f"{method['renders']}: in braces only scene has a meaning")
    check_path_variable(where, method["renders"])
    for scene, chosen in config["scenes"].items():
        if scene_keys.whole_of(chosen):
            continue
        path = method["renders"].replace("{scene}", scene)
        if not is_there(path, of_kind=Path.is_dir):
            fault(where, f"{path} does not exist")
    if config["reference"]["method"] == name:
        fault("reference.method", f"{name} is not trained: nothing warps onto it")


def check_changes(method, where):
    """There are the rounds that change the cameras, and one for the photos.

    A staged training has none: it may put the cameras right between its stages.
    """
    changes, rounds = method["changes"], method["rounds"]
    if method["alignerf"]:
        if changes == "cameras_then_photos":
            fault(where, "a staged training has no round that warps photos")
        if changes == "cameras" and method["alignerf"]["radius_px"] == "auto":
            fault(where, "radius_px auto is measured before cameras are put right")
        return
    if changes == "cameras" and rounds == 0:
        fault(where, "cameras need a round to be put right for")
    if changes == "cameras_then_photos" and (rounds == "auto" or rounds < 2):
        fault(where, "cameras_then_photos needs a number of rounds, 2 or more")


def check_warm_start(config, name):
    """It goes on from round 0 of a method that trains the same model from scratch."""
    method = config["methods"][name]
    start = method["warm_start"]["from"]
    source = config["methods"].get(start)
    where = f"methods.{name}.warm_start"
    if method["alignerf"]:
        fault(where, "not for a staged training")
    if not source or is_derived(source):
        fault(f"{where}.from", f"no method {start!r} from scratch")
    if source["model"] != method["model"]:
        fault(
            f"{where}.from", f"model {source['model']!r} instead of {method['model']!r}"
        )
    if method["rounds"] == 0:
        fault(f"methods.{name}.rounds", "a warm start needs a round to start")


def check_radius(config, name):
    """`auto` measures the misalignment by a method that trains the model in one go."""
    model = config["methods"][name]["model"]
    methods = config["methods"].values()
    if not any(m["model"] == model and not is_derived(m) for m in methods):
        fault(
            f"methods.{name}.alignerf.radius_px",
            f"auto needs a method of model {model!r} without alignerf",
        )


def check_pretraining(config):
    """Staged methods of a model share one pre-training, so they agree on its length."""
    for model in config["models"]:
        users = {
            name: method["alignerf"]["pretrain_share"]
            for name, method in config["methods"].items()
            if method["alignerf"] and method["model"] == model
        }
        if len(set(users.values())) > 1:
            fault(
                f"methods {', '.join(users)}",
                f"they disagree about {model}'s pretraining, see pretrain_share",
            )


def check_reference(config):
    """The reference's round is one that is trained, whatever the flow does."""
    name, round = config["reference"]["method"], config["reference"]["round"]
    if name not in config["methods"]:
        fault("reference.method", f"no method {name!r}")
    rounds = config["methods"][name]["rounds"]
    if round == "last":
        return
    if rounds == "auto" and round > 1:
        fault("reference.round", "with rounds: auto it must be 0, 1 or last")
    if rounds != "auto" and round > rounds:
        fault("reference.round", f"{name} has fewer rounds")
