"""The config's check, before anything is planned: a fault is one line with its key."""

import copy
import csv
import itertools
import math
import os
import re
from pathlib import Path

from alignerf.command import faults, yaml_files
from alignerf.experiment import rows, schema, settings, slices

# What the results' folder holds besides scenes, and a scene's besides methods.
SUFFIXES = (".csv", ".tex", ".png", ".provenance.json")
TABLES = ("tradeoff", "flow_benchmark", "remedies", "comparison", "comparison_ranking")
FILES = {
    *("published", "logs", "bench", "torture", "README.md"),
    *(f"{name}{end}" for name in TABLES for end in SUFFIXES),
}
FOLDERS = {
    *("images", "truth", "pretrain", "testset", "tables", "figures", "logs"),
    *("facts", "decisions", "poses", "cameras", "config", "tradeoff", "preflight"),
    *("masks", "colmap", "points", "bounds", "verdict", "index"),
}
# The Snakefile asks nothing but this package.
or_exit = faults.or_exit
DATA = re.compile(r"\$\{ALIGNERF_DATA:-([^{}]*)\}")
# What no machine is asked for: parameters and all of their training, or courtyard's
# photos, eight bits a channel.
MOST_BYTES = 2**38
# Keys of a method that is another program's renders.
OF_RENDERS = ("renders", "published")
# Sources whose photos may have alpha.
TRANSPARENT = ("photos", "transforms", "blender")
# Keys of a training that do nothing for a kind of model.
OF_PROPOSALS = ("interlevel_weight", "distortion_weight", "proposal_share")
NOT_OF_SYSTEMS = dict.fromkeys(("nerf", "mipnerf", "nerfpp"), OF_PROPOSALS)
NOT_OF_SYSTEMS |= {"ngp": ("distortion_weight",)}
# A side, as of a grid's finest level: their third power is a 64-bit number.
MOST_CELLS = 2**20
# In units of the largest camera coordinate.
MOST_FAR = 100
MOST_PHOTO_BYTES = 2**35


def checked(config, files=()):
    """The complete config: checked, and every key that it leaves out filled.

    config: what YAML made of `files`, merged. Raises ValueError, naming the key or
    the file.
    """
    for path in files:
        yaml_files.check(path)
    if not isinstance(config, dict):
        fault("top level", "a config is a mapping of keys")
    check_names(config)
    schema.check(settings.Config, config)
    check_given(config)
    config = settings.leave_open(config)
    config = completed(schema.filled(settings.Config, config))
    for name, model in config["models"].items():
        check_model(model, "models", name)
    for name in config["methods"]:
        check_method(config, name)
    check_pretraining(config)
    check_reference(config)
    for name, scene in config["scenes"].items():
        check_scene(scene, "scenes", name)
        check_path(scene, name)
    check_published(config)
    check_flow(config["flow"])
    check_weights(config)
    if config["tradeoff"]:
        check_tradeoff(config)
    return config


def fault(where, what):
    raise ValueError(f"config: {where}: {what}")


def completed(config):
    """Fills the defaults that depend on other keys, and writes out paths."""
    given = (config["lpips"] or {}).items()
    config["lpips"] = {net: home(path) for net, path in given if path}
    config["frequency_weights"] = home(config["frequency_weights"])
    config["flow"]["folder"] = home(config["flow"]["folder"])
    if not any((config["aligned_pose"] or {}).values()):
        config["aligned_pose"] = None
    training = config["training"]
    training |= settings.length(training)
    for scene in config["scenes"].values():
        scene |= {key: home(scene[key]) for key in ("path", "masks")}
        scene["poses"] = settings.poses_of(scene)
        if scene["seed"] is None:
            scene["seed"] = config["seed"]
        if not (scene["steps"] or scene["budget_min"]):
            scene |= settings.length(training)
    config["scenes"] = varied(config)
    config["vary"] = None
    for method in config["methods"].values():
        method["renders"] = home(method["renders"])
        if not method["renders"]:
            method["model"] = method["model"] or first(config["models"])
    scratch = [n for n, m in config["methods"].items() if not is_derived(m)]
    reference = config["reference"]
    reference["method"] = reference["method"] or first([*scratch, *config["methods"]])
    if sweep := config["tradeoff"]:
        sweep["scene"] = sweep["scene"] or first(config["scenes"])
        sweep["model"] = sweep["model"] or first(config["models"])
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
            schema.check(settings.Scene, found[again], "scenes", again)
    return found


def home(path):
    """A path with `~` and ${ALIGNERF_DATA:-default} written out, as a shell does it.

    The variable names the folder of real data, the default stands in the config.
    """
    if path is None:
        return None
    given = os.environ.get("ALIGNERF_DATA")
    path = DATA.sub(lambda found: given or found[1], path)
    try:
        return str(Path(path).expanduser())
    except RuntimeError:
        raise ValueError(f"config: {path}: no such user's home") from None


def is_there(path, *, of_kind=Path.exists):
    """Whether a path exists; one that no file can have does not."""
    try:
        return of_kind(Path(path))
    except OSError:
        return False


def first(names):
    return next(iter(names))


def is_derived(method):
    """Whether a method is no training from scratch that others may be set against."""
    others = ("warm_start", "alignerf", "refine", "renders")
    return any(method[key] for key in others)


def check_given(config):
    """What only the config as it was written can tell: keys that act on nothing."""
    settings.check_length(config.get("training", {}), "training")
    for name, scene in config["scenes"].items():
        settings.check_length(scene, f"scenes.{name}")
        # Its default stands in every complete config.
        every = scene.get("test_every", settings.Scene.test_every)
        if scene["source"] == "blender" and every != settings.Scene.test_every:
            fault(f"scenes.{name}.test_every", "blender's files say what is held out")
        if scene.get("seed") is not None and (config.get("vary") or {}).get("seeds"):
            fault(f"scenes.{name}.seed", "not beside vary.seeds")
    variants = (config.get("tradeoff") or {}).get("variants", {})
    for name, variant in variants.items():
        settings.check_length(variant, f"tradeoff.variants.{name}")
    for name, method in (config.get("methods") or {}).items():
        # Its default stands in every complete config.
        default = settings.Method().most_rounds
        given = method.get("most_rounds", default)
        if given != default and method.get("rounds") != "auto":
            fault(f"methods.{name}.most_rounds", "only with `rounds: auto`")


def check_model(model, *place):
    """Its depths are in order, and its fields' parameters fit into a machine."""
    where = ".".join(place)
    if model["near"] >= model.get("far", math.inf):
        fault(where, "near must be smaller than far")
    if settings.field_kind(model) == "nerf" and model["far"] > MOST_FAR:
        # Sines of distant points are noise, and nothing contracts them.
        fault(f"{where}.far", f"field nerf sees no farther than {MOST_FAR}")
    for key in NOT_OF_SYSTEMS.get(model["kind"], ()):
        if key in model["training"]:
            fault(f"{where}.training.{key}", f"kind {model['kind']} has none")
    if model["kind"] == "ngp":
        cells = model["finest"] * model["side"]
        if not model["coarsest"] < cells <= MOST_CELLS:
            fault(
                f"{where}.finest",
                f"{cells:g} cells over the box are not from {model['coarsest'] + 1} to "
                f"{MOST_CELLS}",
            )
    parts = {key: model[key] for key in ("proposal", "field") if key in model}
    for key, field in (parts or {"width": model}).items():
        if "log2_entries" in field:
            values = field["levels"] * field["features"] * 2 ** field["log2_entries"]
        else:
            networks = settings.NETWORKS.get(model["kind"], 1)
            values = networks * field["depth"] * field["width"] ** 2
        # Besides the parameters, their gradients and the two moments of Adam.
        if 16 * values > MOST_BYTES:
            size = f"{16 * values / 2**30:.0f} GiB to train are more than"
            fault(f"{where}.{key}", f"{size} {MOST_BYTES / 2**30:g} GiB")


def check_method(config, name):
    """Its model, where it starts from, and what a staged training cannot have."""
    method = config["methods"][name]
    if method["renders"]:
        check_renders(config, name)
        return
    if method["model"] not in config["models"]:
        fault(f"methods.{name}.model", f"no model {method['model']!r}")
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


def check_renders(config, name):
    """Another program's renders: nothing is trained, and a folder for each scene."""
    method = config["methods"][name]
    trained = {key: value for key, value in method.items() if key not in OF_RENDERS}
    default = schema.as_config(settings.Method())
    for key, value in trained.items():
        if value != default[key]:
            fault(f"methods.{name}.{key}", "not beside renders: nothing is trained")
    where = f"methods.{name}.renders"
    rest = method["renders"].replace("{scene}", "")
    if set(rest) & set("{}"):
        fault(where, f"{method['renders']}: in braces only scene has a meaning")
    for scene in config["scenes"]:
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


def check_scene(scene, *place):
    """What the keys of a scene ask of each other; `place` are the keys above them."""
    where = "".join(f"{key}." for key in place)
    source = settings.SOURCES[scene["source"]]
    if scene["poses"] not in source.poses:
        fault(
            f"{where}poses",
            f"{scene['poses']!r} is not possible for source {scene['source']!r}, only "
            + " or ".join(source.poses),
        )
    if source.has_path and not scene["path"]:
        fault(f"{where}path", f"source {scene['source']!r} needs one")
    if scene["images"] is not None and scene["source"] != "mipnerf360":
        fault(f"{where}images", f"source {scene['source']!r} has no such folders")
    if scene["background"] and scene["source"] not in TRANSPARENT:
        fault(f"{where}background", f"source {scene['source']!r} has no alpha")
    if scene["masks"] and scene["source"] != "photos":
        fault(f"{where}masks", f"only of source 'photos', not {scene['source']!r}")
    model = scene["colmap"]["camera_model"]
    if source.has_truth and model not in (None, "PINHOLE", "SIMPLE_PINHOLE"):
        # Undoing a distortion that is not there would move photos off their true flow.
        fault(f"{where}colmap.camera_model", f"courtyard is a PINHOLE, not {model}")
    views, width, height = (scene["courtyard"][k] for k in ("views", "width", "height"))
    if source.has_truth and 3 * views * width * height > MOST_PHOTO_BYTES:
        size = f"{views} photos of {width}x{height} are more than"
        fault(f"{where}courtyard", f"{size} {MOST_PHOTO_BYTES / 2**30:g} GiB")


def check_path(scene, name):
    """The folders of a scene are there, their names without meaning for Snakemake."""
    for key in ("path", "masks"):
        where, path = f"scenes.{name}.{key}", scene[key]
        if path and set(path) & set("{}"):
            fault(where, f"{path}: braces mean wildcards, rename it")
        if path and not is_there(path):
            fault(where, f"{path} does not exist")


def check_published(config):
    """Names that the paper's table has, where one is shown."""
    number = config["published_table"]
    named = {n: m["published"] for n, m in config["methods"].items() if m["published"]}
    if number is None and named:
        name = first(named)
        fault(f"methods.{name}.published", "only with published_table: 2, or 3")
    if number is not None and not named:
        fault("published_table", "no method says what it is called there (`published`)")
    for name, called in named.items():
        known = published_names(number)
        if called not in known:
            fault(
                f"methods.{name}.published", f"{called!r} is none of {', '.join(known)}"
            )


def published_names(number):
    """What the methods of one of the paper's tables are called."""
    with open(rows.published_table(), newline="", encoding="utf-8") as file:
        found = [
            row["method"] for row in csv.DictReader(file) if row["table"] == str(number)
        ]
    return list(dict.fromkeys(found))


def check_flow(flow):
    """The folder of flows made elsewhere, with the names that stand for renders."""
    template = flow["folder"]
    if flow["estimator"] == "files" and not template:
        fault("flow", "'folder' is a required property of estimator 'files'")
    if template is None:
        return
    if flow["estimator"] != "files":
        fault("flow.folder", f"estimator {flow['estimator']!r} reads none")
    # Plain names: format specifications and attributes could ask for anything.
    rest = template
    for name in ("scene", "method", "round", "split"):
        rest = rest.replace(f"{{{name}}}", "")
    if set(rest) & set("{}"):
        fault(
            "flow.folder",
            f"{template}: in braces only scene, method, round and split have a meaning",
        )


def check_weights(config):
    """Files of weights are there."""
    files = {f"lpips.{net}": path for net, path in config["lpips"].items()}
    files["frequency_weights"] = config["frequency_weights"]
    for key, path in files.items():
        if path and not is_there(path, of_kind=Path.is_file):
            fault(key, f"{path} does not exist")


def check_tradeoff(config):
    """The names that a sweep refers to, and each variant's model and training."""
    sweep = config["tradeoff"]
    for key, section in (("scene", "scenes"), ("model", "models")):
        if sweep[key] not in config[section]:
            fault(f"tradeoff.{key}", f"no {key} {sweep[key]!r}")
    kind = config["models"][sweep["model"]]["kind"]
    if kind != "mipnerf360":
        fault("tradeoff.model", f"a sweep varies mipnerf360, not {kind}")
    if "base" in sweep["variants"]:
        fault("tradeoff.variants.base", "the model itself has this name")
    for name in sweep["variants"]:
        found = slices.variant_of(config, name)
        place = ("tradeoff", "variants", name)
        schema.check(settings.Model, found["model"], *place)
        schema.check(settings.Training, found["training"], *place)
        check_model(schema.filled(settings.Model, found["model"]), *place)


def check_names(config):
    """Names become rules and folders: text, and none that is taken."""
    regimes = config.get("regimes", settings.Config.regimes)
    if regimes in TABLES:
        fault("regimes", f"{regimes} has files of its own, choose another name")
    files = {f"{regimes}{suffix}" for suffix in SUFFIXES}
    taken = {
        "scenes": (FILES | files, "a file of the results"),
        "methods": (FOLDERS, "a folder of every scene"),
        "models": (set(), ""),
    }
    variants = config.get("tradeoff")
    if isinstance(variants, dict):
        config = config | {"tradeoff.variants": variants.get("variants")}
        taken["tradeoff.variants"] = (set(), "")
    for section, (names, what) in taken.items():
        entries = config.get(section)
        for name in entries if isinstance(entries, dict) else ():
            if not isinstance(name, str):
                fault(f"{section}.{name}", "a name must be text, quote it")
            if name in names:
                fault(f"{section}.{name}", f"{what} has this name, choose another")


def check_free(scenes, rules):
    """Each scene is a target of its own: no rule may have its name."""
    for name in sorted(set(scenes) & set(rules)):
        fault(f"scenes.{name}", "a rule has this name, choose another")
