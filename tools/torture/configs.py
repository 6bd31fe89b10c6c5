"""Every key of a config, and of a training's job, with values that it cannot have.

The check has to refuse the value and to name the key; what it accepts it has to plan.
"""

import copy
import json
import time

from alignerf.experiment import check, jobs, plan, targets
from tools.torture import damage

HOSTILE = (
    *(float("nan"), float("inf"), -float("inf"), 10**400, -(10**400), 1e308, 5e-324),
    *(10**30, 2**63, 2**32, 10**12, 10**9, 0, -1, 0.5, True, None),
    *("", "x", "1e-3", "../x", "/", "~nobody/x", "a" * 300, "\0", "\n", "{scene}"),
    *("{scene.__class__}", "{scene:>999999999}", "\ud800", "é", "a b", "-rf", "$(x)"),
    *([], [0], [4] * 2000, [float("nan")] * 2, ["x"], [[]], {}, {"x": 1}, {1: 2}),
)
# Seconds that a check may take: it is asked before every plan.
MAX_S = 5.0
# Sections whose names are the user's.
NAMED = ("scenes", "models", "methods", "variants")


def places_of(config):
    """Places of all values of a complete config, names of its sections among them."""
    return [place for place in damage.json_places(config) if place]


def with_value(config, place, value):
    """A copy with another value at a place."""
    found = copy.deepcopy(config)
    inner = found
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return found


def with_name(config, place, name):
    """A copy in which the last key of a place has another name."""
    found = copy.deepcopy(config)
    inner = found
    for key in place[:-1]:
        inner = inner[key]
    inner[name] = inner.pop(place[-1])
    return found


def changes_of(config):
    """(place, value, function that makes a copy so) of every key, value and name."""
    for place in places_of(config):
        for value in HOSTILE:
            yield place, value, with_value
        if len(place) > 1 and place[-2] in NAMED:
            for value in (*HOSTILE[17:], 1, None, True, 1.5):
                if value.__hash__:
                    yield place, value, with_name
        if isinstance(place[-1], str):
            yield (*place[:-1], "no_such_key"), 1, with_value


def cases_of(config):
    """(place, value, the changed config) of every change."""
    for place, value, change in changes_of(config):
        yield place, value, change(config, place, value)


def of_config(config, place):
    """What is wrong with how a config is taken; None, and whether it was accepted."""
    return taken(lambda: planned(check.checked(config)), place)


def planned(config):
    """Plan all that a config asks for, as the Snakefile does."""
    experiment = plan.Experiment(config)
    for scene in experiment.scenes:
        targets.of_scene(experiment, scene)
        for training in experiment.trainings(scene).values():
            training.job.model_dump()


def of_job(values, place):
    """The same of a job, as `alignerf.train --config` reads it."""
    return taken(lambda: jobs.parse(jobs.read(json.dumps(values))), place)


def taken(function, place):
    """(finding or None, accepted) of a check that may refuse with a ValueError."""
    started = time.perf_counter()
    try:
        function()
    except ValueError as error:
        fault, accepted = line_fault(str(error), place), False
    # Whatever else comes out would be a traceback to the user.
    except BaseException as error:
        return f"{type(error).__name__}: {error}"[:120], False
    else:
        fault, accepted = None, True
    time_s = time.perf_counter() - started
    return (f"{time_s:.0f} s" if time_s > MAX_S else fault), accepted


def line_fault(text, place):
    """A refusal is one line of a readable length that names a key of the place."""
    # Commands join what is on several lines, see `faults.say`.
    text = " ".join(text.split())
    if len(text) > 600:
        return f"{len(text)} letters"
    keys = [str(key) for key in place if not isinstance(key, int)]
    return None if any(key in text for key in keys) else f"names no key: {text[:80]}"


def job_of(config):
    """A fine-tuning's job of a complete config, as its rule would be given it."""
    experiment = plan.Experiment(config)
    (staged, *_) = experiment.names("in_crops")
    return experiment.at(next(iter(experiment.scenes)), staged, 0).job.model_dump()


def complete(config):
    """A config with every section that it can have, and models of every kind."""
    systems = ("nerf", "mipnerf", "nerfpp", "ngp")
    config = copy.deepcopy(config)
    config["models"] |= {kind: {"kind": kind} for kind in systems}
    config["methods"] |= {f"{kind}_": {"model": kind} for kind in systems}
    return check.checked(config)
