"""A tiny scene's cost, measured from end to end."""

import json
import os
import sys
import types

import jax
import pytest

from alignerf.costs import __main__ as costs
from alignerf.costs import calibrate, estimate
from alignerf.experiment import jobs, sources
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
    one = {"name": "plain/round0", "job": JOB, "after": []}
    one |= {"splits": ["test"], "crop": None}
    return {"trainings": [one], "judged": one["name"]}


def run(scene, out, found, monkeypatch):
    root = os.path.dirname(os.path.dirname(os.path.dirname(estimate.__file__)))
    monkeypatch.setenv("PYTHONPATH", root)
    costs.main(
        [
            *("--scene", str(scene), "--work", json.dumps(found)),
            *("--cores", "1", "--threads", "1", "--out", str(out)),
        ]
    )
    return json.loads(out.read_text())


@pytest.mark.whole
def test_a_tiny_plan_is_measured_and_told(scene, tmp_path, monkeypatch, capsys):
    out = tmp_path / "preflight.json"
    found = run(scene, out, work(), monkeypatch)
    (rates,) = found["rates"].values()
    assert all(value >= 0 for value in rates.values())
    assert 0 < rates["step_s"] < found["wall_s"]
    assert 5e7 < rates["peak_bytes"] == found["memory_bytes"] < 4e9
    assert found["length"]["epochs"] > 0
    said = capsys.readouterr().out
    assert said.startswith(f"{scene.name}: trainings and renders take about ")
    costs.main(["--show", str(out), str(out)])
    assert capsys.readouterr().out == 2 * said


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
        costs.calibrate(
            types.SimpleNamespace(scene=scene, threads=1, gpus=1), jobs.parse(JOB)
        )


def test_a_config_is_compiled_ahead_once_a_program(tmp_path, monkeypatch, capsys):
    """Whatever its scenes' cameras are; other lengths compile nothing."""
    compiled = []
    monkeypatch.setattr(costs, "calibrate", lambda args, job: compiled.append(job))
    monkeypatch.setattr(sources, "set_environment", lambda: None)
    scenes = {name: {"source": "courtyard", "seed": n} for n, name in enumerate("ab")}
    config = {"scenes": scenes, "decide": True, "methods": {"plain": {"rounds": 1}}}
    (tmp_path / "my.yaml").write_text(json.dumps(config))
    costs.main(["--compile", str(tmp_path / "my.yaml")])
    assert [job.stage for job in compiled] == ["full"]
    assert capsys.readouterr().out == "compiled 1 of 1\n"


@pytest.mark.whole
def test_a_step_and_a_renderer_are_compiled_ahead(monkeypatch, caplog):
    monkeypatch.setattr(calibrate, "SIDE_PX", 80)
    with jax.log_compiles():
        calibrate.compile_ahead(jobs.parse(JOB))
    for name in ("learn", "render_pixels"):
        assert f"Finished XLA compilation of jit({name})" in caplog.text


def test_nothing_is_asked_for(capsys):
    costs.main(["--show"])
    assert "preflight: false" in capsys.readouterr().out


@pytest.mark.parametrize("damaged", ["", "[1]", '{"a": 1}', '{"said": 3}'])
def test_a_file_that_is_no_preflight_is_named(tmp_path, damaged):
    path = tmp_path / "preflight.json"
    path.write_text(damaged)
    with pytest.raises(ValueError, match=r"preflight\.json: "):
        costs.main(["--show", str(path)])
