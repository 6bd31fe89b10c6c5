"""What jobs ask for, and what is said of those that a cluster has ended."""

import json
import types

import pytest

from alignerf.experiment.cluster import needs, slurm_errors

FILE = "{training}/timing.json"
COSTS = {"s": "the work"}


class Wildcards(types.SimpleNamespace):
    """As Snakemake's: attributes, and a mapping."""

    def keys(self):
        return vars(self).keys()

    def __getitem__(self, name):
        return vars(self)[name]


HERE = Wildcards(scene="s", training="m/round0")


@pytest.fixture
def preflight(tmp_path, monkeypatch):
    """A function that writes the scene's preflight."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "results/s/preflight.json"
    path.parent.mkdir(parents=True)
    needs.read.cache_clear()
    return lambda text: path.write_text(
        text if isinstance(text, str) else json.dumps(text)
    )


def of(file="m/round0/timing.json", **task):
    tasks = [{"file": file, "seconds": 600.0, "peak_bytes": 2e9} | task]
    return {"work": "the work", "tasks": tasks}


def test_memory_and_minutes_are_the_preflights_with_room(preflight):
    preflight(of())
    assert needs.memory_mb(COSTS, FILE)(HERE, 1) == 3000
    assert needs.minutes(COSTS, FILE)(HERE, 1) == 30


@pytest.mark.parametrize("attempt", [1, 2, 3])
def test_each_attempt_asks_for_twice_as_much(preflight, attempt):
    preflight(of())
    assert needs.memory_mb(COSTS, FILE)(HERE, attempt) == 3000 * 2 ** (attempt - 1)
    assert needs.minutes(COSTS, FILE)(HERE, attempt) == 30 * 2 ** (attempt - 1)


def test_a_small_task_has_room_for_snakemake(preflight):
    preflight(of(peak_bytes=1, seconds=0.1))
    assert needs.memory_mb(COSTS, FILE)(HERE, 1) == 501
    assert needs.minutes(COSTS, FILE)(HERE, 1) == 11


@pytest.mark.parametrize(
    "text",
    [
        *({}, of("other.json"), of(peak_bytes=0, seconds=0)),
        *("", "[]", "null", '{"tasks": 3}', '{"tasks": [3]}', "{", '{"tasks": [{}]}'),
        of(seconds=None),
        json.dumps(of(peak_bytes=float("nan"))),
        json.dumps(of(seconds=float("inf"))),
        *("9" * 5000, "[" * 100_000, of() | {"work": "other"}, of(seconds=1e308)),
        *(of(seconds=-1), of(peak_bytes=int("9" * 400))),
    ],
)
def test_without_figures_a_job_asks_for_the_usual(preflight, text):
    preflight(text)
    assert needs.memory_mb(COSTS, FILE)(HERE, 1) == needs.MEMORY_MB
    assert needs.minutes(COSTS, FILE)(HERE, 1) == needs.MINUTES


def test_no_file_and_no_such_training_are_the_usual_too(preflight):
    assert needs.memory_mb(COSTS, FILE)(HERE, 1) == needs.MEMORY_MB
    preflight(of())
    point = Wildcards(scene="s", training="other/v")
    assert needs.minutes(COSTS, FILE)(point, 1) == needs.MINUTES


LOST = """
    message: SLURM-job '12' failed, SLURM status is: 'TIMEOUT'. For further
    message: SLURM-job '13' failed, SLURM status is: 'FAILED'.
    message: SLURM-job '14' failed due to a node failure, SLURM status is: 'NODE_FAIL'.
    message: SLURM sbatch failed. The error message was 'sbatch: error: Too much
sbatch: error: Batch job submission failed'.
"""


def test_what_slurm_ended_or_refused_is_said_in_words(tmp_path):
    log = tmp_path / ".snakemake/slurm_logs/rule_train/13.log"
    log.parent.mkdir(parents=True)
    log.write_text("slurmstepd: error: Detected 1 oom-kill event(s) in StepId=13.0.\n")
    said = slurm_errors.lines(LOST, ["results/s/train.log", str(log)])
    assert [line.removeprefix("error: Slurm") for line in said] == [
        "'s job 12 took longer than it had asked for (TIMEOUT)",
        "'s job 13 took more memory than it had asked for (OUT_OF_MEMORY)",
        "'s job 14 lost its node (NODE_FAIL)",
        " refused a job: Too much; Batch job submission failed",
    ]


def test_of_other_runs_nothing_is_said():
    assert slurm_errors.lines("Error in rule train: x", ["results/s/train.log"]) == []
