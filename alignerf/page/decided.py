"""What stands on the page of decisions: which there are, and which are in force."""

from alignerf.experiment.decisions import read
from alignerf.files import json_files, yaml_files


def decisions(folder):
    """(rows of key, default, value, reason, in force; whether any is in force).

    None where nothing was trained.
    """
    if not (folder / "decisions.json").is_file():
        return [], False
    open_keys = left_open(folder / "config.yaml")
    if json_files.read(folder / "poses.json").get("downscale_decided"):
        open_keys.add("downscale")
    rows = [
        decision._asdict() | {"taken": key.rpartition(".")[2] in open_keys}
        for key, decision in read(folder / "decisions.json").items()
    ]
    return rows, any(row["taken"] for row in rows)


def left_open(path):
    """Keys that a complete config leaves to facts; ValueError where it is none."""
    config = yaml_files.read(path)
    try:
        models = config["models"].values()
        lists = [model.get("decided", []) for model in models]
        lists.append(config["training"]["decided"])
        keys = [key for one in lists for key in one]
    except (AttributeError, KeyError, TypeError):
        keys = [None]
    if not all(isinstance(key, str) for key in keys):
        raise ValueError(f"{path}: not a complete config: models, training, decided")
    return set(keys)
