# Functions only: the config's check, before anything is planned.
import sys
from pathlib import Path

import jsonschema
import yaml

ROOT = Path(workflow.basedir)


def stop(message):
    """End before planning with one line: a WorkflowError would print its origin too."""
    print(f"error: {message}", file=sys.stderr)
    sys.exit(1)


def check_config(config):
    """Check against the schema, then what a schema cannot say."""
    for path in workflow.configfiles:
        check_keys_once(yaml.compose(Path(path).read_text()), path)
    check_names(config)
    schema = yaml.safe_load((ROOT / "workflow/schemas/config.schema.yaml").read_text())
    check_against(schema, config)
    for name, model in config["models"].items():
        if model["near"] >= model["far"]:
            stop(f"config: models.{name}: near must be smaller than far")
    for name, method in config["methods"].items():
        if method["model"] not in config["models"]:
            stop(f"config: methods.{name}.model: no model {method['model']!r}")
        if "warm_start" in method:
            check_warm_start(config, name)
        if method.get("alignerf", {}).get("radius_px") == "auto":
            check_radius(config, name)
        if "most_rounds" in method and method["rounds"] != "auto":
            stop(f"config: methods.{name}.most_rounds: only with `rounds: auto`")
    check_reference(config)
    for name, scene in config["scenes"].items():
        path = scene.get("path")
        if scene["source"] != "courtyard" and not path:
            stop(f"config: scenes.{name}.path: source {scene['source']!r} needs one")
        if path and set(path) & set("{}"):
            stop(
                f"config: scenes.{name}.path: {path}: braces mean wildcards, rename it"
            )
        if path and not Path(path).exists():
            stop(f"config: scenes.{name}.path: {path} does not exist")
    check_flow_folder(config["flow"])
    check_weights(config)
    if "tradeoff" in config:
        check_tradeoff(schema, config)


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
            stop(f"config: {key}: {path} does not exist")


def check_flow_folder(flow):
    """The folder of flows made elsewhere, with the names that stand for renders."""
    if "folder" not in flow:
        return
    if flow["method"] != "files":
        stop(f"config: flow.folder: method {flow['method']!r} reads none")
    template = flow["folder"]
    try:
        template.format(scene="", method="", round="0", split="")
    except (KeyError, IndexError, ValueError, AttributeError):
        stop(
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
        stop(f"config: {where}: {error.message}")


def check_warm_start(config, name):
    """It goes on from round 0 of a method that trains the same model from scratch."""
    method = config["methods"][name]
    source = config["methods"].get(method["warm_start"]["from"], {})
    if "alignerf" in method:
        stop(f"config: methods.{name}.warm_start: not for a staged training")
    where = f"config: methods.{name}.warm_start.from: "
    if not source or {"warm_start", "alignerf"} & set(source):
        stop(f"{where}no method {method['warm_start']['from']!r} from scratch")
    if source["model"] != method["model"]:
        stop(f"{where}model {source['model']!r} instead of {method['model']!r}")
    if method["rounds"] == 0:
        stop(f"config: methods.{name}.rounds: a warm start needs a round to start")


def check_radius(config, name):
    """`auto` measures the misalignment by a method that trains the model in one go."""
    model = config["methods"][name]["model"]
    for other in config["methods"].values():
        if other["model"] == model and not {"warm_start", "alignerf"} & set(other):
            return
    stop(
        f"config: methods.{name}.alignerf.radius_px: auto needs a method of model "
        f"{model!r} without alignerf"
    )


def check_reference(config):
    """The reference's round is one that is trained, whatever the flow does."""
    reference = config["reference"]
    if reference["method"] not in config["methods"]:
        stop(f"config: reference.method: no method {reference['method']!r}")
    rounds = config["methods"][reference["method"]]["rounds"]
    if reference["round"] == "last":
        return
    if rounds == "auto" and reference["round"] > 1:
        stop("config: reference.round: with rounds: auto it must be 0, 1 or last")
    if rounds != "auto" and reference["round"] > rounds:
        stop(f"config: reference.round: {reference['method']} has fewer rounds")


def check_tradeoff(schema, config):
    """The names that a sweep refers to, and each variant's model and training."""
    sweep = config["tradeoff"]
    for key, section in (("scene", "scenes"), ("model", "models")):
        if sweep[key] not in config[section]:
            stop(f"config: tradeoff.{key}: no {key} {sweep[key]!r}")
    if "base" in sweep["variants"]:
        stop("config: tradeoff.variants.base: the model itself has this name")
    for name in sweep["variants"]:
        for part, values in variant_of(config, name).items():
            if part in schema["$defs"]:
                whole = {"$defs": schema["$defs"], "$ref": f"#/$defs/{part}"}
                check_against(whole, values, "tradeoff", "variants", name)


def variant_of(config, name):
    """A point of the sweep: seed, downscale, model and training.

    `base` or a variant. A field of a kind is whole, one without changes keys of the
    base's field; the warm-up keeps its share of the steps where it is not given.
    """
    sweep = config["tradeoff"]
    change = {} if name == "base" else dict(sweep["variants"][name])
    model, training = config["models"][sweep["model"]], training_of(
        config, sweep["scene"]
    )
    for key in ("proposal", "field"):
        if key in change and "kind" not in change[key]:
            change[key] = model[key] | change[key]
    if "steps" in change:
        change = rescaled(training, change["steps"]) | change
    seed = config["scenes"][sweep["scene"]].get("seed", config["seed"])
    found = {"seed": seed, "downscale": 1}
    found = {key: change.pop(key, value) for key, value in found.items()}
    of_training = {key: change.pop(key) for key in set(change) & set(training)}
    return found | {"model": model | change, "training": training | of_training}


def training_of(config, scene):
    """The config's training, as long as the scene asks for."""
    found = config["training"]
    return found | rescaled(found, config["scenes"][scene].get("steps", found["steps"]))


def rescaled(training, steps):
    """Steps, and the warm-up that keeps its share of them."""
    share = training["warmup_steps"] / training["steps"]
    return {"steps": steps, "warmup_steps": round(share * steps)}


def check_names(config):
    """Names become rules and folders: text, and none that is taken."""
    taken = {
        "scenes": (RULES | FILES, "a rule or file"),
        "methods": (FOLDERS, "a folder of every scene"),
        "models": (set(), ""),
    }
    for section, (names, what) in taken.items():
        entries = config.get(section)
        for name in entries if isinstance(entries, dict) else ():
            if not isinstance(name, str):
                stop(f"config: {section}.{name}: a name must be text, quote it")
            if name in names:
                stop(f"config: {section}.{name}: {what} has this name, choose another")


def check_keys_once(node, path):
    """YAML takes the last of two equal keys without a word."""
    if isinstance(node, yaml.MappingNode):
        keys = [key.value for key, _ in node.value]
        for (key, value), name in zip(node.value, keys):
            if keys.count(name) > 1:
                line = key.start_mark.line + 1
                stop(f"{path}: key {name!r} stands twice, see line {line}")
            check_keys_once(value, path)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            check_keys_once(value, path)


RULES = {
    *("all", "poses", "poses_courtyard", "facts", "train", "pretrain", "finetune"),
    *("render_views", "align", "testset", "evaluate", "misalignment_table", "figures"),
    *("train_warm", "decide", "round_times", "crops"),
    *("control_sets", "controls_table", "ranking_table"),
    *("align_oracle", "decompose", "displacement_table"),
    *("tradeoff", "shrink", "train_variant", "render_variant", "evaluate_variant"),
    *("flow_benchmark", "regimes"),
}
FILES = {
    *("published", "logs", "bench", "README.md"),
    *("tradeoff.csv", "tradeoff.tex", "tradeoff.png"),
    *("flow_benchmark.csv", "flow_benchmark.tex", "flow_benchmark.png"),
}
FOLDERS = {
    *("images", "truth", "pretrain", "testset", "tables", "figures", "logs"),
    *("facts", "poses", "cameras", "tradeoff"),
}
