"""The attack's quick form: some of what `make torture` tries, in the suite.

Files of a finished chain are damaged in tests/workflow/test_chain.py.
"""

import random
import re

import numpy as np
import pytest
import yaml

from alignerf.training import loop
from tools.torture import chains, configs, numbers, running

FUNCTIONS = ("contract_spheres", "alpha_weights", "clip_per_network", "harmonics")


def test_hostile_values_of_a_config_are_refused_or_planned():
    config = configs.complete(yaml.safe_load(chains.CONFIG))
    cases = list(configs.cases_of(config))
    assert len(cases) > 5000
    found = []
    for place, value, changed in random.Random(0).sample(cases, 1000):
        fault, _ = configs.of_config(changed, place)
        if fault:
            found.append((place, value, fault))
    assert found == []


def test_hostile_values_of_a_job_are_refused_or_taken():
    job = configs.job_of(configs.complete(yaml.safe_load(chains.CONFIG)))
    cases = list(configs.cases_of(job))
    found = [
        (place, value, fault)
        for place, value, changed in cases
        if (fault := configs.of_job(changed, place)[0])
    ]
    assert len(cases) > 1000
    assert found == []


@pytest.mark.parametrize("name", FUNCTIONS)
def test_random_and_extreme_numbers(name, rng):
    assert numbers.check(name, rng) == []


def test_the_attack_knows_a_bad_refusal():
    """Each of its rules finds what it is for."""
    good = running.Ended(1, "a line\nerror: a.json: no key\n", 1.0, 100.0)
    assert running.fault_of(good, ["a.json"]) is None
    for changes, reason in (
        ({"code": -9}, "exit -9"),
        ({"code": 0}, "exit 0"),
        ({"time_s": 11.0}, "11 s"),
        ({"peak_mib": 3000.0}, "3000 MiB"),
        ({"output": "Traceback\nerror: a.json"}, "traceback"),
        ({"output": "error: a.json\nerror: a.json"}, "2 lines of error"),
        ({"output": "error: something"}, "names neither"),
    ):
        assert re.match(reason, running.fault_of(good._replace(**changes), ["a.json"]))


def test_the_attack_knows_numbers_that_are_none(monkeypatch, rng):
    def spoilt(x):
        return np.float32(1) / x

    broken = numbers.Function(numbers.points, spoilt, lambda x: x)
    monkeypatch.setitem(numbers.FUNCTIONS, "broken", broken)
    found = numbers.check("broken", rng, 200)
    assert any(line.startswith("value of") for line in found)
    assert any("off the twin" in line for line in found)


def test_no_more_steps_wait_than_several_devices_bear():
    """About 40 end the process; see training/loop.py."""
    assert loop.FETCH_EVERY <= 16
