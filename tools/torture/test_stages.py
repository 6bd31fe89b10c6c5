"""Files of a judgement, damaged in every way, and the oracle's own teeth.

Those of a chain are damaged in tests/workflow/test_chain.py.
"""

import random
import re

import numpy as np
import pytest

from tools.torture import chains, damage, running, stages


def test_a_stage_refuses_what_is_damaged_or_does_not_read_it(
    root, tmp_path, monkeypatch
):
    if not running.CASES:
        pytest.skip("make torture")
    monkeypatch.setenv("PYTHONPATH", str(root))
    base = chains.judged(root, tmp_path / "judged").folder
    config = f"results/{chains.JUDGED}.yaml"
    cases = [
        (stage, path, way)
        for stage in stages.plan(root, base, config)
        for path in stages.inputs_of(stage, base)
        for way in damage.ways_of(base / path)
    ]
    rng, found = np.random.default_rng(running.SEED), []
    chosen = random.Random(running.SEED)
    for stage, path, way in chosen.sample(cases, min(running.CASES, len(cases))):
        fault, _ = stages.attack(stage, path, way, base, tmp_path / "place", rng)
        found += [f"{stage.module}, {path}, {way}: {fault}"] * bool(fault)
    assert found == []


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
