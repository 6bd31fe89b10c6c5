"""A tiny scene's cost, measured from end to end."""

import json
import os
import sys

import pytest

from alignerf.costs import __main__ as costs
from alignerf.costs import plan
from alignerf.experiment import jobs
from tests import job_cases as cases


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    # As small as the flow allows.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "HEIGHT", 32)
        return cases.make_scene(tmp_path_factory.mktemp("scene"), height=32)


# Of all models it compiles soonest.
JOB = {
    "seed": 0,
    "stage": "full",
    "model": {"kind": "nerf", "samples": [4, 4], "width": 8, "depth": 1},
    "training": {"steps": 10, "batch_rays": 16},
    "alignerf": None,
}


def work():
    one = {"name": "plain/round0", "job": JOB, "after": [], "external": False}
    one |= {"splits": ["test"], "crop": None}
    found = {"trainings": [one], "judged": one["name"], "scored": 0, "moved": None}
    return found | {"flow": ["--method", "dis_fast"]}


def run(scene, out, found, monkeypatch):
    root = os.path.dirname(os.path.dirname(os.path.dirname(plan.__file__)))
    monkeypatch.setenv("PYTHONPATH", root)
    # Compiled sooner; what is compiled is nothing to the test.
    monkeypatch.setenv("XLA_FLAGS", "--xla_backend_optimization_level=0")
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(out.parent / "compiled"))
    costs.main(
        [
            *("--scene", str(scene), "--work", json.dumps(found)),
            *("--cores", "1", "--threads", "1", "--out", str(out)),
        ]
    )
    return json.loads(out.read_text())


def test_a_tiny_plan_is_measured_and_told(scene, tmp_path, monkeypatch, capsys):
    out = tmp_path / "preflight.json"
    found = run(scene, out, work(), monkeypatch)
    assert found["scene"] == scene.name
    assert (found["cores"], found["parallel_jobs"]) == (1, 1)
    (rates,) = found["rates"].values()
    assert all(value >= 0 for value in rates.values())
    assert 0 < rates["step_s"] < 1
    assert rates["params"] > 100
    assert 5e7 < rates["peak_bytes"] == found["memory_bytes"] < 4e9
    assert min(found["flow"].values()) > 0
    assert found["length"]["epochs"] > 0
    tasks = [plan.Task(**task) for task in found["tasks"]]
    assert found["wall_s"] == pytest.approx(sum(t.seconds for t in tasks), abs=0.1)
    assert found["disk_bytes"] == sum(task.new_bytes for task in tasks) > 0
    assert scene.name in capsys.readouterr().out
    costs.main(["--show", str(out), str(out)])
    assert "all scenes: about" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import os; os.kill(os.getpid(), 9)", "ended by signal 9.*--cores 1"),
        ("import sys; sys.exit('error: config: steps')", "^config: steps"),
    ],
)
def test_a_fault_is_said_and_one_of_memory_with_what_to_do(
    scene, tmp_path, monkeypatch, code, said
):
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{code}"\n')
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))
    with pytest.raises(ValueError, match=said):
        costs.calibrate(scene, 1, jobs.parse(JOB))


def test_nothing_is_asked_for(capsys):
    costs.main(["--show"])
    assert "preflight: false" in capsys.readouterr().out
