"""What is shown of a run, by the events that Snakemake tells."""

import io
import json

import pytest

from alignerf.costs import summary
from alignerf.start.terminal import report, screen


@pytest.fixture
def stream():
    return io.StringIO()


@pytest.fixture
def told(tmp_path, monkeypatch, stream):
    """A report of a run of one scene, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    log = tmp_path / "run.log"
    log.write_text("")
    return report.Report(screen.Screen(stream), ["chair"], log)


def begin(told, key, rule, *outputs, log="none.log", **wildcards):
    told.take(
        {"event": "job_info", "jobid": key, "rule_name": rule, "log": [log]}
        | {"output": list(outputs), "wildcards": {"scene": "chair"} | wildcards}
    )


def test_a_job_is_a_line_when_it_ends_and_a_target_is_none(told, stream):
    begin(told, 1, "train", "model", training="plain/round0")
    begin(told, 2, "all")
    assert stream.getvalue() == ""
    told.take({"event": "job_finished", "job_id": 1})
    told.take({"event": "job_finished", "job_id": 2})
    told.take({"event": "job_finished", "job_id": 3})
    told.take({"event": "text"})
    told.take({})
    told.close(0)
    first, last = stream.getvalue().splitlines()
    assert first.split() == ["plain:", "training", "0:00"]
    assert last.startswith("1 job in ")


def test_a_run_without_jobs_says_so(told, stream):
    told.close(0)
    assert stream.getvalue() == "all of it is there already\n"


def test_warnings_are_shown_once_in_a_run_and_are_not_too_many(told, stream, tmp_path):
    for name, count in (("a", 3), ("b", 9)):
        lines = [f"warning: photo {i} is dark" for i in range(count)]
        (tmp_path / f"{name}.log").write_text("\n".join([*lines, "fine\x1b[2J"]))
        begin(told, name, "poses", "images", log=f"{name}.log")
        told.take({"event": "job_finished", "job_id": name})
    lines = stream.getvalue().splitlines()
    assert sum("photo 0" in line for line in lines) == 1
    assert lines[-1].strip() == "and 1 more in b.log"
    assert "fine" not in stream.getvalue()


def test_what_a_run_costs_is_shown(told, stream, tmp_path):
    (tmp_path / "p.log").write_text("chair: about 12 min on 2 cores\n")
    begin(told, 1, "preflight", "preflight.json", log="p.log")
    told.take({"event": "job_finished", "job_id": 1})
    assert "      chair: about 12 min on 2 cores\n" in stream.getvalue()


def plan(folder, *tasks):
    """preflight.json of tasks (seconds, file), one after the other."""
    folder.mkdir(parents=True, exist_ok=True)
    every = [{"kind": "rest", "seconds": s, "file": file} for s, file in tasks]
    content = dict.fromkeys(summary.NUMBERS, 1) | {"tasks": every, "external": []}
    content |= {"scene": folder.name, "wall_s": sum(seconds for seconds, _ in tasks)}
    (folder / "preflight.json").write_text(json.dumps(content))


def test_the_time_left_is_that_of_the_plan(told, tmp_path):
    scene = tmp_path / "results" / "chair"
    plan(
        scene,
        (300, "a/round0/timing.json"),
        (300, "b/round0/timing.json"),
        (600, "b/round0/render"),
        # Of windows, beside the scene.
        (600, "../chair_windows/a/round0/timing.json"),
    )
    (scene / "a/round0").mkdir(parents=True)
    (scene / "a/round0/timing.json").touch()
    (tmp_path / "b.log").write_text("t: step 50/100    eta 0:10\n")
    told.take({"event": "run_info", "total": 9, "scenes": "chair"})
    told.take({"event": "progress", "done": 3, "total": 8})
    file = "results/chair/b/round0/timing.json"
    begin(told, 1, "train", file, log="b.log", training="b/round0")
    share, text = told.state()
    assert text == "3 of 8 jobs, about 22 min left; b: training, step 50/100"
    assert share == pytest.approx(1 - 1350 / 1800, abs=1e-3)
    # Jobs without a log of their own go by the clock; a folder holds its file.
    told.running.clear()
    begin(told, 2, "render", "results/chair/b/round0/render", training="b/round0")
    begin(told, 3, "train", "results/chair_windows/a/round0/timing.json")
    (scene / "b/round0/render").mkdir(parents=True)
    (tmp_path / file).touch()
    told.ask_s, told.running[2] = 0.0, told.running[2]._replace(begun_s=-1e9)
    assert "about 10 min left" in told.state()[1]


@pytest.mark.parametrize("content", ["{", "{}", '{"tasks": 3}', "[]"])
def test_without_a_plan_jobs_are_counted(told, tmp_path, content):
    scene = tmp_path / "results" / "chair"
    scene.mkdir(parents=True)
    told.take({"event": "run_info", "total": 4, "scenes": "chair"})
    (tmp_path / "p.log").write_text("images: view 3/12    eta 0:45\n")
    begin(told, 1, "poses", "results/chair/images", log="p.log")
    said = "0 of 4 jobs, 0:45 left of this one; photos and cameras, view 3/12"
    assert told.state() == (0, said)
    (scene / "preflight.json").write_text(content)
    told.ask_s = 0.0
    assert told.state() == (0, said)


def test_what_failed_is_said_last_with_its_log(told, stream, tmp_path):
    (tmp_path / "t.log").write_text("learning\nerror: no more memory\n")
    told.log.write_text("    log: t.log (check log file(s) for error details)\n")
    begin(told, 1, "train", "model", log="t.log", training="plain/round0")
    told.take({"event": "job_error", "jobid": 1, "log": ["t.log"]})
    told.take({"event": "error", "text": "WorkflowError", "level": "ERROR"})
    told.close(1)
    first, *rest = stream.getvalue().splitlines()
    assert first.split() == ["plain:", "training", "0:00", "FAILED"]
    assert rest[:2] == ["error: no more memory", "  in t.log"]
    assert rest[-1] == f"all that the run said: {told.log}"


@pytest.mark.parametrize(
    ("log", "errors", "said"),
    [
        ("Using profile x.\nerror: config: no\n", [], ["error: config: no"]),
        ("banner\nbanner\n", ["A:\nb is missing"], ["A:", "b is missing"]),
        ("usage: snakemake\nunknown option\n", [], ["usage: snakemake"]),
        ("LockException:\nError: Directory", ["x"], [f"error: {report.LOCKED}"]),
    ],
)
def test_without_a_failed_job_the_fault_is_said(told, stream, log, errors, said):
    told.log.write_text(log)
    for text in errors:
        told.take({"event": "error", "text": text, "level": "ERROR"})
    told.close(1)
    lines = stream.getvalue().splitlines()
    assert lines[: len(said)] == said
    assert lines[-1].endswith("run.log")


def test_a_stopped_run_has_not_failed(told, stream):
    begin(told, 1, "poses", "images")
    told.stopping = True
    told.take({"event": "job_error", "jobid": 1})
    told.log.write_text("Terminating processes on user request")
    told.close(1)
    first, *rest = stream.getvalue().splitlines()
    assert first.endswith("stopped")
    assert rest[0] == "stopped, as asked."
