"""Minutes instead of steps: how many they come to is timed once, and then kept."""

import json
import time

import pytest

from alignerf.training import loop, program
from tests import job_cases as cases

STEP_TIME_S = 0.1
BUDGET_MIN = cases.STEPS * STEP_TIME_S / 60


def with_budget(budget_min=BUDGET_MIN):
    training = {k: v for k, v in cases.TRAINING.items() if k != "steps"}
    return cases.JOB | {"training": training | {"budget_min": budget_min}}


def timing_of(folder):
    return json.loads((folder / "timing.json").read_text())


@pytest.fixture
def seconds(monkeypatch):
    """Seconds a step that are said to be measured, one after the other.

    The steps are timed all the same, to see that they leave no trace.
    """
    found = []
    measure = program.step_time_s

    def say(step, state, *, max_s, at_once):
        measure(step, state, max_s=0.01, at_once=at_once)
        return found.pop(0)

    monkeypatch.setattr(program, "step_time_s", say)
    return found


def test_a_budget_trains_as_its_steps_do(
    folder, uninterrupted, tmp_path, seconds, caplog
):
    """Bit for bit: the steps that are timed leave no trace."""
    caplog.set_level("INFO", "alignerf")
    seconds[:] = [STEP_TIME_S]
    found = cases.run(folder, tmp_path, with_budget())
    assert found == (uninterrupted / "learnt" / "model.msgpack").read_bytes()
    timing = timing_of(tmp_path)
    assert timing["steps"] == cases.STEPS == timing_of(uninterrupted)["steps"]
    assert timing["rays_seen"] == timing_of(uninterrupted)["rays_seen"]
    assert timing["budget_min"] == BUDGET_MIN
    assert timing["steps_per_s"] == 10.0
    assert "budget 0.0233333 min: 14 steps at 10 steps/s" in caplog.text
    assert "budget_min" not in timing_of(uninterrupted)


def test_pretraining_is_the_beginning_of_its_budget(folder, tmp_path, seconds):
    seconds[:] = [STEP_TIME_S]
    job = cases.in_stage("pretrain", with_budget(20 * STEP_TIME_S / 60))
    found = cases.run(folder, tmp_path / "minutes", job)
    steps = cases.JOB | {"training": cases.TRAINING | {"steps": 20}}
    wanted = cases.run(folder, tmp_path / "steps", cases.in_stage("pretrain", steps))
    assert found == wanted
    timing = timing_of(tmp_path / "minutes")
    assert (timing["steps"], timing["budget_min"]) == (12, pytest.approx(0.02))


@pytest.mark.parametrize("at_step", cases.one_of([0, 4, 12], 4))
def test_it_resumes_bit_for_bit_at_any_speed(
    folder, uninterrupted, tmp_path, seconds, monkeypatch, at_step
):
    """The steps are written down before the first of them, and are not timed again."""
    seconds[:] = [STEP_TIME_S]
    with monkeypatch.context() as patched:
        if at_step:
            cases.kill_after_save(patched, at_step)
        else:
            patched.setattr(loop, "run_steps", killed)
        with pytest.raises(cases.Killed):
            cases.run(folder, tmp_path, with_budget())
    assert not seconds
    found = cases.run(folder, tmp_path, with_budget())
    assert found == (uninterrupted / "learnt" / "model.msgpack").read_bytes()


def killed(*arguments, **options):
    raise cases.Killed


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 4},
        {"training": with_budget(2 * BUDGET_MIN)["training"]},
        {"stage": "pretrain", "pretrain_fraction": 0.6},
    ],
    ids=["seed", "budget", "stage"],
)
def test_another_job_is_timed_anew(folder, tmp_path, seconds, monkeypatch, other):
    seconds[:] = [STEP_TIME_S, STEP_TIME_S / 3]
    monkeypatch.setattr(loop, "run_steps", killed)
    steps = []
    for job in (with_budget(), with_budget() | other):
        with pytest.raises(cases.Killed):
            cases.run(folder, tmp_path, job)
        record = tmp_path / "checkpoints" / "budget.json"
        steps.append(json.loads(record.read_text())["steps"])
    doubled = 1 + ("training" in other)
    assert steps == [cases.STEPS, doubled * 3 * cases.STEPS]
    assert not seconds


@pytest.mark.parametrize("sources", ["", "other"])
def test_a_state_of_other_steps_is_not_taken(
    folder, tmp_path, seconds, monkeypatch, caplog, sources
):
    """The record is lost, or the code another, and faster: another learning rate."""
    seconds[:] = [STEP_TIME_S, STEP_TIME_S / 2, STEP_TIME_S / 2]
    with monkeypatch.context() as patched:
        cases.kill_after_save(patched, 4)
        with pytest.raises(cases.Killed):
            cases.run(folder, tmp_path / "lost", with_budget())
    if not sources:
        (tmp_path / "lost" / "checkpoints" / "budget.json").unlink()
    caplog.set_level("INFO", "alignerf")
    more = "--sources", sources
    found = cases.run(folder, tmp_path / "lost", with_budget(), *more)
    said = "state-4.msgpack is of this configuration by other code, or in other steps"
    assert said in caplog.text
    assert found == cases.run(folder, tmp_path / "fresh", with_budget())


@pytest.mark.whole
def test_it_ends_in_time(folder, tmp_path, monkeypatch):
    """Within a fifth and a second, where steps take what a larger model's would."""

    def slowed(step):
        def run(*arguments):
            time.sleep(0.02)
            return step(*arguments)

        return run

    measure, run_steps = program.step_time_s, loop.run_steps
    monkeypatch.setattr(
        program, "step_time_s", lambda step, *a, **o: measure(slowed(step), *a, **o)
    )

    def run_slowed(run):
        run.program = run.program._replace(step=slowed(run.program.step))
        run_steps(run)

    monkeypatch.setattr(loop, "run_steps", run_slowed)
    cases.run(folder, tmp_path, with_budget(0.1))
    timing = timing_of(tmp_path)
    assert timing["train_time_s"] == pytest.approx(6.0, rel=0.2, abs=1.0)
    assert timing["steps"] == pytest.approx(6.0 * timing["steps_per_s"], abs=1)
