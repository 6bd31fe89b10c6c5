"""Jobs with what the facts decided, and the file that says what that is."""

import json
from pathlib import Path

from alignerf.decisions import rules
from alignerf.experiment import jobs


def read_job(text) -> jobs.Job:
    """The job of a JSON object, or its file, with what the facts decided."""
    return jobs.parse(fill(jobs.read(text)))


def fill(values):
    """A job's mapping, the keys that it leaves to facts taken from its decisions.

    A stage that takes a share of the steps takes the same share of those decided.
    Raises ValueError where the file is missing, or does not say what the job needs.
    """
    path = values.get("decisions")
    if not path:
        return values
    found = read(path)
    model, training = dict(values["model"]), dict(values["training"])
    for name in model.pop("decided", []):
        value = one(found, name, path).value
        if name in model:
            model[name] = value
        else:
            model["field"] = model["field"] | {name: value}
    if "steps" in training.pop("decided"):
        steps = one(found, "steps", path)
        share = training["steps"] / steps.default
        training["steps"] = max(1, round(share * steps.value))
    return values | {"model": model, "training": training, "decisions": None}


def one(found, name, path):
    """The decision on a key, whose place its name tells."""
    for key, decision in found.items():
        if key.rpartition(".")[2] == name:
            return decision
    raise ValueError(f"{path}: nothing on {name}")


def read(path):
    """{key: Decision} of a decisions.json; ValueError names a file that is none."""
    try:
        entries = json.loads(Path(path).read_text(encoding="utf-8"))["decisions"]
        return {entry["key"]: rules.Decision(**entry) for entry in entries}
    except FileNotFoundError:
        raise ValueError(f"{path}: not found") from None
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: not a file of decisions: {error}") from None
