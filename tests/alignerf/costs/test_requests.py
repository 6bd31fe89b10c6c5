"""What jobs ask for of a cluster."""

import json
import types

import pytest

from alignerf.costs import requests, summary

FILE = "{training}/timing.json"


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
    requests.read.cache_clear()
    return lambda text: path.write_text(
        text if isinstance(text, str) else json.dumps(text)
    )


def of(file="m/round0/timing.json", **task):
    one = {"kind": "train", "file": file, "seconds": 600.0, "peak_bytes": 2e9}
    numbers = dict.fromkeys(summary.NUMBERS, 1)
    return numbers | {"scene": "s", "external": [], "tasks": [one | task]}


def test_memory_and_minutes_are_the_preflights_with_room(preflight):
    preflight(of())
    assert requests.memory_mb(FILE)(HERE, 1) == 3000
    assert requests.minutes(FILE)(HERE, 1) == 30


@pytest.mark.parametrize("attempt", [1, 2, 3])
def test_each_attempt_asks_for_twice_as_much(preflight, attempt):
    preflight(of())
    assert requests.memory_mb(FILE)(HERE, attempt) == 3000 * 2 ** (attempt - 1)
    assert requests.minutes(FILE)(HERE, attempt) == 30 * 2 ** (attempt - 1)


def test_a_small_task_has_room_for_snakemake(preflight):
    preflight(of(peak_bytes=1, seconds=0.1))
    assert requests.memory_mb(FILE)(HERE, 1) == 501
    assert requests.minutes(FILE)(HERE, 1) == 11


@pytest.mark.parametrize(
    "text",
    [
        *({}, of("other.json"), of(peak_bytes=0, seconds=0)),
        *("", "[]", "null", '{"tasks": 3}', '{"tasks": [3]}', "{", '{"tasks": [{}]}'),
        of(seconds=None),
        json.dumps(of(peak_bytes=float("nan"))),
        json.dumps(of(seconds=float("inf"))),
        *("9" * 5000, "[" * 100_000, of(seconds=1e308)),
        *(of(seconds=-1), of(peak_bytes=int("9" * 400))),
    ],
)
def test_without_figures_a_job_asks_for_the_usual(preflight, text):
    preflight(text)
    assert requests.memory_mb(FILE)(HERE, 1) == requests.MEMORY_MB
    assert requests.minutes(FILE)(HERE, 1) == requests.MINUTES


def test_no_file_and_no_such_training_are_the_usual_too(preflight):
    assert requests.memory_mb(FILE)(HERE, 1) == requests.MEMORY_MB
    preflight(of())
    point = Wildcards(scene="s", training="other/v")
    assert requests.minutes(FILE)(point, 1) == requests.MINUTES
