"""What is shown of a run, by the events that Snakemake tells."""

import io
import json
import re

import pytest

from alignerf.cli import configs, report


@pytest.fixture
def stream():
    return io.StringIO()


@pytest.fixture
def told(tmp_path, monkeypatch, stream):
    """A report of a run of one scene, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    log = tmp_path / "run.log"
    log.write_text("")
    return report.Report(["chair"], log, stream)


def begin(told, key, rule, *outputs, log="none.log", **wildcards):
    told.take(
        {"event": "job_info", "jobid": key, "rule_name": rule, "log": [log]}
        | {"output": list(outputs), "wildcards": {"scene": "chair"} | wildcards}
    )


def test_a_job_is_a_line_when_it_ends_and_a_target_is_none(told, stream):
    begin(told, 1, "train", "model", training="plain/round0")
    begin(told, 2, "all")
    assert stream.getvalue() == ""
    told.take({"event": "job_finished", "jobid": 1})
    told.take({"event": "job_finished", "jobid": 2})
    told.take({"event": "job_finished", "jobid": 3})
    told.take({"event": "text"})
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
        told.take({"event": "job_finished", "jobid": name})
    lines = stream.getvalue().splitlines()
    assert sum("photo 0" in line for line in lines) == 1
    assert lines[-1].strip() == "and 1 more in b.log"
    assert "fine" not in stream.getvalue()


def test_what_a_run_costs_is_shown(told, stream, tmp_path):
    (tmp_path / "p.log").write_text("chair: about 12 min on 2 cores\n")
    begin(told, 1, "preflight", "preflight.json", log="p.log")
    told.take({"event": "job_finished", "jobid": 1})
    assert "      chair: about 12 min on 2 cores\n" in stream.getvalue()


def test_jobs_are_counted(told, tmp_path):
    told.take({"event": "run_info", "total": 4})
    (tmp_path / "p.log").write_text("images: view 3/12    eta 0:45\n")
    begin(told, 1, "poses", "results/chair/images", log="p.log")
    said = "0 of 4 jobs, 0:45 left of this one; photos and cameras, view 3/12"
    assert told.state() == (0, said)


def test_what_failed_is_said_last_with_its_log(told, stream, tmp_path):
    (tmp_path / "t.log").write_text("learning\nerror: no more memory\n")
    told.log.write_text("    log: t.log (check log file(s) for error details)\n")
    begin(told, 1, "train", "model", log="t.log", training="plain/round0")
    told.take({"event": "job_error", "jobid": 1, "log": ["t.log"]})
    told.take({"event": "error", "text": "WorkflowError"})
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
        ("LockException:\nError: Directory", ["x"], [f"error: {configs.LOCKED}"]),
    ],
)
def test_without_a_failed_job_the_fault_is_said(told, stream, log, errors, said):
    told.log.write_text(log)
    for text in errors:
        told.take({"event": "error", "text": text})
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


class Terminal(io.StringIO):
    def isatty(self):
        return True


def run_info(told, tmp_path, *more):
    """Let it look at the events of a run that has begun, now."""
    events = [{"event": "run_info", "total": 6}, *more]
    path = tmp_path / "events"
    path.write_text("".join(json.dumps(event) + "\n" for event in events))
    told.due_s = 0.0
    with open(path) as file:
        told.look(file)


def test_the_bar_stays_beneath_the_lines_and_goes_in_the_end(tmp_path, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "60")
    stream = Terminal()
    told = report.Report(["chair"], tmp_path / "run.log", stream)
    run_info(told, tmp_path, {"event": "progress", "done": 3, "total": 6})
    assert "3 of 6 jobs" in stream.getvalue()
    told.line("photos and cameras  0:05")
    told.close(0)
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", stream.getvalue())
    lines = [line.split("\r")[-1].strip() for line in shown.splitlines()]
    assert "photos and cameras  0:05" in lines
    assert lines[-1] == "all of it is there already"
    # As long as the terminal is wide it would begin another line.
    assert max(map(len, lines)) <= 60


@pytest.mark.parametrize(
    ("stream", "term"), [(io.StringIO, "xterm"), (Terminal, "dumb")]
)
def test_a_log_has_no_codes_of_terminals(tmp_path, monkeypatch, stream, term):
    """An editor's shell says that it is dumb."""
    monkeypatch.setenv("TERM", term)
    monkeypatch.setenv("FORCE_COLOR", "1")
    stream = stream()
    told = report.Report(["chair"], tmp_path / "run.log", stream)
    told.line("a [bold]" + "x" * 200)
    run_info(told, tmp_path)
    told.close(0)
    first, second, _ = stream.getvalue().splitlines()
    assert (first, second) == ("a [bold]" + "x" * 200, "  ... 0 of 6 jobs")


def test_half_a_line_is_no_event_yet(told, stream, tmp_path):
    line = json.dumps({"event": "progress", "done": 3, "total": 6}) + "\n"
    path = tmp_path / "events"
    with open(path, "w") as writing, open(path) as reading:
        for part in (line[:9], line[9:] + line[:20]):
            writing.write(part)
            writing.flush()
            told.look(reading)
            assert told.done == (0 if part == line[:9] else 3)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0:00"), (59.7, "1:00"), (750, "12:30"), (3723, "1:02:03")],
)
def test_the_clock(seconds, text):
    assert report.clock(seconds) == text
