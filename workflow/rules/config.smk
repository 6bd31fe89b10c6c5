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
    validator = jsonschema.Draft202012Validator(schema)
    errors = sorted(validator.iter_errors(config), key=lambda e: list(map(str, e.path)))
    if errors:
        error = jsonschema.exceptions.best_match(errors)
        where = ".".join(map(str, error.absolute_path)) or "top level"
        stop(f"config: {where}: {error.message}")
    for name, model in config["models"].items():
        if model["near"] >= model["far"]:
            stop(f"config: models.{name}: near must be smaller than far")
    for name, method in config["methods"].items():
        if method["model"] not in config["models"]:
            stop(f"config: methods.{name}.model: no model {method['model']!r}")
    reference = config["reference"]
    if reference["method"] not in config["methods"]:
        stop(f"config: reference.method: no method {reference['method']!r}")
    if reference["round"] > config["methods"][reference["method"]]["rounds"]:
        stop(f"config: reference.round: {reference['method']} has fewer rounds")
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
    for key in ("frequency_weights", "lpips_alex"):
        config.setdefault(key, None)
        if config[key] and not Path(config[key]).is_file():
            stop(f"config: {key}: {config[key]} does not exist")


def check_names(config):
    """Names become rules and folders: text, and none that is taken."""
    taken = {
        "scenes": (RULES | {"published", "README.md"}, "a rule or file"),
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
}
FOLDERS = {
    *("images", "truth", "pretrain", "testset", "tables", "figures", "logs"),
    *("facts", "poses", "cameras"),
}
