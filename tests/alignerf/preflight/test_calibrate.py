"""A tiny scene's cost, measured from end to end."""

import json
import os
import sys

import pytest

from alignerf.preflight import __main__ as preflight
from alignerf.preflight import calibrate, simulate
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


def work(**changes):
    one = {
        "name": "plain/round0",
        "job": JOB,
        "after": [],
        "corrects": False,
        "renders": ["test"],
        "scored": True,
    }
    return {
        "reference": "plain/round0",
        "verdict": "plain/round0",
        "trainings": [one | changes],
        "given": 0,
        "aligned_pose": None,
        "truth": False,
        "flow": ["--method", "dis_fast"],
    }


def run(scene, out, found, monkeypatch):
    root = os.path.dirname(os.path.dirname(os.path.dirname(calibrate.__file__)))
    monkeypatch.setenv("PYTHONPATH", root)
    # Compiled sooner; what is compiled is nothing to the test.
    monkeypatch.setenv("XLA_FLAGS", "--xla_backend_optimization_level=0")
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(out.parent / "compiled"))
    preflight.main(
        [
            *("--scene", str(scene), "--work", json.dumps(found)),
            *("--cores", "1", "--threads", "1", "--out", str(out)),
        ]
    )
    return json.loads(out.read_text())


def test_a_tiny_plan_is_measured_and_told(scene, tmp_path, monkeypatch, capsys):
    out = tmp_path / "preflight.json"
    plan = run(scene, out, work(), monkeypatch)
    assert plan["scene"] == scene.name
    assert (plan["cores"], plan["lanes"]) == (1, 1)
    (rates,) = plan["measured"]["trainings"].values()
    assert all(value >= 0 for value in rates.values())
    assert 0 < rates["step_s"] < 1
    assert rates["params"] > 100
    assert 5e7 < rates["peak_bytes"] < 4e9
    assert plan["memory_bytes"] == max(rates["peak_bytes"], rates["render_peak_bytes"])
    tasks = [simulate.Task(**task) for task in plan["tasks"]]
    assert plan["wall_s"] == pytest.approx(simulate.wall_s(tasks, 1), abs=0.2)
    assert plan["disk_bytes"] == sum(task.new_bytes for task in tasks) > 0
    assert scene.name in capsys.readouterr().out
    preflight.main(["--show", str(out), str(out)])
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
        preflight.calibrate(scene, 1, {}, "train")


def test_nothing_is_asked_for(scene, tmp_path, capsys):
    out = tmp_path / "preflight.json"
    arguments = ("--scene", str(scene), "--work", "null", "--out", str(out))
    preflight.main(arguments)
    assert json.loads(out.read_text()) == {}
    preflight.main(["--show", str(out)])
    assert "preflight: false" in capsys.readouterr().out


def test_a_cost_measured_anew_keeps_its_time(tmp_path, monkeypatch):
    """A newer input would have its scene's trainings made again."""
    out, config = tmp_path / "s/preflight.json", tmp_path / "s/config.yaml"
    out.parent.mkdir()
    out.write_text("{}")
    os.utime(out, (1e9, 1e9))
    monkeypatch.setattr(preflight, "work_of", lambda path, scene: {"trainings": []})
    monkeypatch.setattr(preflight, "plan_of", lambda *_: {"scene": "s"})
    monkeypatch.setattr(preflight.fit, "lines", lambda *_: ["about an hour"])
    monkeypatch.setattr(preflight.fit, "check", lambda _: None)
    preflight.main(["--show", str(out), "--configs", str(config)])
    assert json.loads(out.read_text())["work"] == preflight.work.digest(
        {"trainings": []}
    )
    assert out.stat().st_mtime == 1e9
