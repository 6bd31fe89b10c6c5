"""Jobs with their decided settings filled in, and the reader of decisions.json."""

from alignerf.decisions import rules
from alignerf.experiment import jobs
from alignerf.experiment.keys import training as training_keys
from alignerf.files import json_files


def read_job(text) -> jobs.Job:
    """The job of a JSON object, or of its file, with the decided settings."""
    return jobs.parse(fill(jobs.read(text)))


def fill(values):
    """A job's mapping whose open keys are filled from its decisions.json.

    A stage that takes a share of the steps takes the same share of those decided, and
    a warm-up of its own keeps its share. Raises ValueError where the file is missing,
    or does not say what the job needs.
    """
    path = values.get("decisions")
    if not path:
        return values
    decisions = read(path)
    model, training = dict(values["model"]), dict(values["training"])
    for name in model.pop("decided", []):
        value = one(decisions, name, path).value
        if name == "near":
            # A config may say how far it sees.
            value = min(value, model["far"] / 2)
        if name in model:
            model[name] = value
        else:
            model["field"] = model["field"] | {name: int(value)}
    if "steps" in training.pop("decided"):
        times = one(decisions, "steps", path).value / training_keys.Training.steps
        training["steps"] = max(1, round(times * training["steps"]))
        if training["warmup_steps"] is not None:
            training["warmup_steps"] = round(times * training["warmup_steps"])
    return values | {"model": model, "training": training, "decisions": None}


def one(decisions, name, path):
    """The decision on a key, given by the last part of its name."""
    for key, decision in decisions.items():
        if key.rpartition(".")[2] == name:
            return decision
    raise ValueError(f"{path}: nothing on {name}")


def read(path):
    """{key: Decision} of a decisions.json; ValueError names a damaged file."""
    entries = json_files.read(path, {"decisions": list})["decisions"]
    try:
        decisions = {entry["key"]: rules.Decision(**entry) for entry in entries}
        for key, decision in decisions.items():
            numbers = (decision.default, decision.value)
            if not isinstance(key, str) or not all(map(rules.known, numbers)):
                raise ValueError(f"{key}: {decision.value} is no value")
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: not a file of decisions: {error}") from None
    return decisions
