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
    schema = yaml.safe_load((ROOT / "workflow/schemas/config.schema.yaml").read_text())
    validator = jsonschema.Draft202012Validator(schema)
    errors = sorted(validator.iter_errors(config), key=lambda e: list(map(str, e.path)))
    if errors:
        error = jsonschema.exceptions.best_match(errors)
        where = ".".join(map(str, error.absolute_path)) or "top level"
        stop(f"config: {where}: {error.message}")
    for name, method in config["methods"].items():
        if method["model"] not in config["models"]:
            stop(f"config: methods.{name}.model: no model {method['model']!r}")
    reference = config["reference"]
    if reference["method"] not in config["methods"]:
        stop(f"config: reference.method: no method {reference['method']!r}")
    if reference["round"] > config["methods"][reference["method"]]["rounds"]:
        stop(f"config: reference.round: {reference['method']} has fewer rounds")
    for name, scene in config["scenes"].items():
        if name in RESERVED:
            stop(f"config: scenes.{name}: a rule has this name, choose another")
        path = scene.get("path")
        if scene["source"] != "courtyard" and not path:
            stop(f"config: scenes.{name}.path: source {scene['source']!r} needs one")
        if path and not Path(path).exists():
            stop(f"config: scenes.{name}.path: {path} does not exist")
    for key in ("frequency_weights", "lpips_alex"):
        config.setdefault(key, None)
        if config[key] and not Path(config[key]).is_file():
            stop(f"config: {key}: {config[key]} does not exist")


RESERVED = {
    *("all", "poses", "poses_courtyard", "facts", "train", "pretrain", "finetune"),
    *("render_views", "align", "testset", "evaluate", "misalignment_table", "figures"),
}
