"""Every key of a config, and of a training's job, with values that it cannot have.

The check has to refuse the value and to name the key; what it accepts it has to plan.
"""

import copy
import random
import time

import yaml

from alignerf.experiment import check, jobs, plan, targets
from tests import damaged_cases
from tools.torture import chains, running

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
    for place in filter(None, damaged_cases.places(config)):
        for value in HOSTILE:
            yield place, value, damaged_cases.changed
        if len(place) > 1 and place[-2] in NAMED:
            for value in (*HOSTILE[17:], 1, None, True, 1.5):
                if value.__hash__:
                    yield place, value, with_name
        if isinstance(place[-1], str):
            yield (*place[:-1], "no_such_key"), 1, damaged_cases.changed


def planned(config):
    """Check a config, and plan all that it asks for, as the Snakefile does."""
    experiment = plan.Experiment(check.checked(config))
    for scene in experiment.scenes:
        targets.of_scene(experiment, scene)
        for training in experiment.trainings(scene).values():
            training.job.model_dump()


def parsed(values):
    """The same of a job, as `alignerf.train --config` reads it."""
    jobs.parse(values)


def fault_of(function, values, place):
    """What is wrong with a check, which may refuse with a ValueError; or None."""
    started = time.perf_counter()
    try:
        function(values)
        fault = None
    except ValueError as error:
        fault = line_fault(str(error), place)
    # Whatever else comes out would be a traceback to the user.
    except BaseException as error:
        return f"{type(error).__name__}: {error}"[:120]
    time_s = time.perf_counter() - started
    return f"{time_s:.0f} s" if time_s > MAX_S else fault


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
    experiment = plan.Experiment(check.checked(config))
    (staged, *_) = experiment.names("key", "alignerf")
    return experiment.at(next(iter(experiment.scenes)), staged, 0).job.model_dump()


def complete(config):
    """A config with every section that it can have, and models of every kind."""
    systems = ("nerf", "mipnerf", "nerfpp", "ngp")
    config = copy.deepcopy(config)
    config["models"] |= {kind: {"kind": kind} for kind in systems}
    config["methods"] |= {f"{kind}_": {"model": kind} for kind in systems}
    return check.checked(config).model_dump()


def tried(function, config, count):
    """Findings of so many changes of a config or a job, by the seed."""
    cases = list(changes_of(config))
    chosen = random.Random(running.SEED).sample(cases, min(count, len(cases)))
    found = [
        (place, value, fault)
        for place, value, change in chosen
        if (fault := fault_of(function, change(config, place, value), place))
    ]
    return found, len(cases)


def test_hostile_values_of_a_config_are_refused_or_planned():
    config = complete(yaml.safe_load(chains.CONFIG))
    found, count = tried(planned, config, 100 * running.CASES or 1000)
    assert count > 5000
    assert found == []


def test_hostile_values_of_a_job_are_refused_or_taken():
    job = job_of(complete(yaml.safe_load(chains.CONFIG)))
    found, count = tried(parsed, job, 10_000)
    assert count > 1000
    assert found == []
