"""The config's check, before anything is planned: a fault is one line with its key."""

import sys
from pathlib import Path

import jsonschema
import yaml

from alignerf.experiment import slices, sources

SCHEMA = sources.ROOT / "workflow/schemas/config.schema.yaml"


def fault(message):
    raise ValueError(message)


def checked(config, files=()):
    """Check against the schema, then what a schema cannot say."""
    for path in files:
        check_keys_once(yaml.compose(Path(path).read_text()), path)
    check_names(config)
    schema = yaml.safe_load(SCHEMA.read_text())
    check_against(schema, config)
    for name, model in config["models"].items():
        if model["near"] >= model["far"]:
            fault(f"config: models.{name}: near must be smaller than far")
    for name, method in config["methods"].items():
        if method["model"] not in config["models"]:
            fault(f"config: methods.{name}.model: no model {method['model']!r}")
        if "warm_start" in method:
            check_warm_start(config, name)
        if method.get("alignerf", {}).get("radius_px") == "auto":
            check_radius(config, name)
        if "most_rounds" in method and method["rounds"] != "auto":
            fault(f"config: methods.{name}.most_rounds: only with `rounds: auto`")
    check_reference(config)
    for name, scene in config["scenes"].items():
        path = scene.get("path")
        if scene["source"] != "courtyard" and not path:
            fault(f"config: scenes.{name}.path: source {scene['source']!r} needs one")
        if path and set(path) & set("{}"):
            fault(
                f"config: scenes.{name}.path: {path}: braces mean wildcards, rename it"
            )
        if path and not Path(path).exists():
            fault(f"config: scenes.{name}.path: {path} does not exist")
    check_flow_folder(config["flow"])
    check_weights(config)
    if "tradeoff" in config:
        check_tradeoff(schema, config)
    return config


def check_weights(config):
    """Files of weights; of LPIPS, only the networks that have one are kept."""
    config.setdefault("frequency_weights", None)
    given = config.get("lpips") or {}
    config["lpips"] = {net: path for net, path in given.items() if path}
    files = {f"lpips.{net}": path for net, path in config["lpips"].items()}
    for key, path in {
        "frequency_weights": config["frequency_weights"],
        **files,
    }.items():
        if path and not Path(path).is_file():
            fault(f"config: {key}: {path} does not exist")


def check_flow_folder(flow):
    """The folder of flows made elsewhere, with the names that stand for renders."""
    if "folder" not in flow:
        return
    if flow["method"] != "files":
        fault(f"config: flow.folder: method {flow['method']!r} reads none")
    template = flow["folder"]
    try:
        template.format(scene="", method="", round="0", split="")
    except (KeyError, IndexError, ValueError, AttributeError):
        fault(
            f"config: flow.folder: {template}: in braces only scene, method, round "
            "and split have a meaning"
        )


def check_against(schema, value, *place):
    """Stop at the key that breaks the schema; `place` are the keys above `value`."""
    validator = jsonschema.Draft202012Validator(schema)
    errors = sorted(validator.iter_errors(value), key=lambda e: list(map(str, e.path)))
    if errors:
        error = jsonschema.exceptions.best_match(errors)
        where = ".".join(map(str, (*place, *error.absolute_path))) or "top level"
        fault(f"config: {where}: {error.message}")


def check_warm_start(config, name):
    """It goes on from round 0 of a method that trains the same model from scratch."""
    method = config["methods"][name]
    source = config["methods"].get(method["warm_start"]["from"], {})
    if "alignerf" in method:
        fault(f"config: methods.{name}.warm_start: not for a staged training")
    where = f"config: methods.{name}.warm_start.from: "
    if not source or {"warm_start", "alignerf"} & set(source):
        fault(f"{where}no method {method['warm_start']['from']!r} from scratch")
    if source["model"] != method["model"]:
        fault(f"{where}model {source['model']!r} instead of {method['model']!r}")
    if method["rounds"] == 0:
        fault(f"config: methods.{name}.rounds: a warm start needs a round to start")


def check_radius(config, name):
    """`auto` measures the misalignment by a method that trains the model in one go."""
    model = config["methods"][name]["model"]
    for other in config["methods"].values():
        if other["model"] == model and not {"warm_start", "alignerf"} & set(other):
            return
    fault(
        f"config: methods.{name}.alignerf.radius_px: auto needs a method of model "
        f"{model!r} without alignerf"
    )


def check_reference(config):
    """The reference's round is one that is trained, whatever the flow does."""
    reference = config["reference"]
    if reference["method"] not in config["methods"]:
        fault(f"config: reference.method: no method {reference['method']!r}")
    rounds = config["methods"][reference["method"]]["rounds"]
    if reference["round"] == "last":
        return
    if rounds == "auto" and reference["round"] > 1:
        fault("config: reference.round: with rounds: auto it must be 0, 1 or last")
    if rounds != "auto" and reference["round"] > rounds:
        fault(f"config: reference.round: {reference['method']} has fewer rounds")


def check_tradeoff(schema, config):
    """The names that a sweep refers to, and each variant's model and training."""
    sweep = config["tradeoff"]
    for key, section in (("scene", "scenes"), ("model", "models")):
        if sweep[key] not in config[section]:
            fault(f"config: tradeoff.{key}: no {key} {sweep[key]!r}")
    if "base" in sweep["variants"]:
        fault("config: tradeoff.variants.base: the model itself has this name")
    for name in sweep["variants"]:
        for part, values in slices.variant_of(config, name).items():
            if part in schema["$defs"]:
                whole = {"$defs": schema["$defs"], "$ref": f"#/$defs/{part}"}
                check_against(whole, values, "tradeoff", "variants", name)


def check_names(config):
    """Names become rules and folders: text, and none that is taken."""
    taken = {
        "scenes": (FILES, "a file of the results"),
        "methods": (FOLDERS, "a folder of every scene"),
        "models": (set(), ""),
    }
    for section, (names, what) in taken.items():
        entries = config.get(section)
        for name in entries if isinstance(entries, dict) else ():
            if not isinstance(name, str):
                fault(f"config: {section}.{name}: a name must be text, quote it")
            if name in names:
                fault(f"config: {section}.{name}: {what} has this name, choose another")


def check_keys_once(node, path):
    """YAML takes the last of two equal keys without a word."""
    if isinstance(node, yaml.MappingNode):
        keys = [key.value for key, _ in node.value]
        for (key, value), name in zip(node.value, keys):
            if keys.count(name) > 1:
                line = key.start_mark.line + 1
                fault(f"{path}: key {name!r} stands twice, see line {line}")
            check_keys_once(value, path)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            check_keys_once(value, path)


FILES = {
    *("published", "logs", "bench", "README.md"),
    *("tradeoff.csv", "tradeoff.tex", "tradeoff.png"),
    *("flow_benchmark.csv", "flow_benchmark.tex", "flow_benchmark.png"),
}
FOLDERS = {
    *("images", "truth", "pretrain", "testset", "tables", "figures", "logs"),
    *("facts", "poses", "cameras", "tradeoff"),
}


def check_free(scenes, rules):
    """Each scene is a target of its own: no rule may have its name."""
    for name in set(scenes) & set(rules):
        raise ValueError(f"config: scenes.{name}: a rule has this name, choose another")


def or_exit(function, *arguments):
    """function(*arguments); a fault of the config ends the process with one line.

    A Snakefile that raises would end with a traceback of the workflow engine.
    """
    try:
        return function(*arguments)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
