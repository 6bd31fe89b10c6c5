"""A small workflow, run as a user would: what stands on the terminal."""

import json
import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from alignerf.cli import workflow
from alignerf.experiment import sources

SNAKEFILE = """
rule all:
    input: "results/a/index.html"
rule poses:
    output: "results/{scene}/poses.json"
    log: "results/{scene}/logs/poses.log"
    shell: "(echo warning: 3 photos are dark; echo much more; touch {output:q})"
        " 2>&1 | tee {log:q}"
rule train:
    output: "results/{scene}/model"
    log: "results/{scene}/logs/train it.log"
    shell: "([ -e memory ] || {{ echo error: no more memory; exit 1; }};"
        " touch {output:q}) 2>&1 | tee {log:q}"
rule page:
    input: "results/{scene}/poses.json", "results/{scene}/model"
    output: "results/{scene}/index.html"
    shell: "env; touch {output:q}"
onsuccess:
    print("the verdict, as Snakemake has it")
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A project in the place of ours, and a config."""
    monkeypatch.chdir(tmp_path)
    profile = tmp_path / "profiles" / "default" / "config.yaml"
    profile.parent.mkdir(parents=True)
    profile.write_text("keep-going: true\n")
    (tmp_path / "Snakefile").write_text(SNAKEFILE)
    (tmp_path / "results" / "a").mkdir(parents=True)
    config = tmp_path / "results" / "a.yaml"
    config.write_text("scenes: {a: {source: photos}}\n")
    verdict = {"verdict": ["VERDICT   fine."]}
    (tmp_path / "results" / "a" / "verdict.json").write_text(json.dumps(verdict))
    monkeypatch.setattr(sources, "PIPELINE", tmp_path)
    monkeypatch.delenv("VERBOSE", raising=False)
    return tmp_path


@pytest.mark.parametrize("verbose", ["", pytest.param("1", marks=pytest.mark.whole)])
def test_who_ends_it_ends_its_jobs_and_no_fault_is_claimed(here, root, verbose):
    """Snakemake by itself waits for the jobs that run."""
    slow = 'shell: "echo $$ > job.pid; sleep 120; touch {output:q}"'
    (here / "Snakefile").write_text(
        f'rule all:\n    input: "x"\nrule poses:\n    output: "x"\n    {slow}\n'
    )
    code = "from alignerf.cli import workflow; from alignerf.experiment import sources;"
    code += f"from pathlib import Path; sources.PIPELINE = Path({str(here)!r});"
    code += "raise SystemExit(workflow.run('results/a.yaml', 1, 'all'))"
    one = subprocess.Popen(
        [sys.executable, "-c", code],
        env=os.environ | {"VERBOSE": verbose, "PYTHONPATH": str(root)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    while not (here / "job.pid").is_file() and one.poll() is None:
        time.sleep(0.1)
    assert one.poll() is None, one.communicate()
    job = psutil.Process(int((here / "job.pid").read_text()))
    one.send_signal(signal.SIGTERM)
    said, _ = one.communicate()
    assert one.returncode not in (0, None)
    assert not job.is_running() or job.status() == psutil.STATUS_ZOMBIE
    assert "stopped" in said
    assert verbose or "error: a job" not in said


def test_a_line_a_job_and_the_verdict_once_and_last(here, capfd):
    code = workflow.run("results/a.yaml", 2, "all")
    failed, nothing = capfd.readouterr()
    assert (code, nothing) == (1, "")
    first, *lines, error, log, goes_on, named = failed.splitlines()
    assert first.partition(": ")[2] == named.partition(": ")[2]
    names = {line.strip().split("  ")[0] for line in lines}
    assert names >= {"photos and cameras", "all: training"}
    assert [line for line in lines if line.endswith("FAILED")]
    assert "      warning: 3 photos are dark" in lines
    assert (error, log) == ("error: no more memory", "  in results/a/logs/train it.log")
    assert "goes on" in goes_on
    assert "VERDICT" not in failed

    (here / "memory").touch()
    code = workflow.run("results/a.yaml", 2, "all")
    done, nothing = capfd.readouterr()
    assert (code, nothing) == (0, "")
    assert done.count("VERDICT") == 1
    assert done.splitlines()[-1].endswith(": make export SCENE=a")
    assert "much more" not in done
    # Snakemake's own words are not lost.
    (*_, last) = sorted((here / "results" / "logs").glob("run-*.log"))
    text = last.read_text()
    assert "rule page:" in text
    # Of what it is told by, its jobs know nothing.
    assert str(sources.PLUGINS) not in text
    assert workflow.EVENTS not in text
    assert "the verdict, as Snakemake has it" in text
    assert len(done.splitlines()) < 12


def test_who_asks_for_all_gets_all(here, capfd, monkeypatch):
    (here / "memory").touch()
    monkeypatch.setenv("VERBOSE", "1")
    assert workflow.run("results/a.yaml", 2, "all") == 0
    out, err = capfd.readouterr()
    assert "rule page:" in err
    assert "VERDICT" not in out
    assert not (here / "results" / "logs").exists()


DEAF = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN);"


@pytest.mark.parametrize(
    ("before", "signal_of"), [("import time;", signal.SIGTERM), (DEAF, signal.SIGKILL)]
)
def test_it_is_ended_where_its_reader_fails(monkeypatch, tmp_path, before, signal_of):
    """Who does not end is killed."""
    monkeypatch.setattr(workflow, "STUCK_S", 0.5)
    monkeypatch.setattr(workflow, "AGAIN_S", 0.1)
    begun = tmp_path / "begun"
    code = f"{before} open({str(begun)!r}, 'w'); time.sleep(60)"
    one = subprocess.Popen([sys.executable, "-c", code])

    def look():
        if begun.exists():
            raise OSError("nobody looks")

    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(OSError, match="nobody looks"):
        workflow.ended(one, look)
    assert one.returncode == -signal_of
    assert signal.getsignal(signal.SIGTERM) == before


def test_few_logs_stay(here, monkeypatch):
    workflow.LOGS.mkdir()
    for i in range(workflow.KEPT + 5):
        (workflow.LOGS / f"run-20200101-1200{i:02d}-7.log").touch()
    for name in ("preview.log", "run-1.log", "run-my.log"):
        (workflow.LOGS / name).touch()
    workflow.log_file().touch()
    names = sorted(path.name for path in workflow.LOGS.glob("*"))
    assert len(names) == workflow.KEPT + 3
    assert "run-20200101-120000-7.log" not in names
    assert {"preview.log", "run-1.log", "run-my.log"} < set(names)


def test_commands_are_those_of_the_demo_and_of_a_config():
    demo = workflow.command_of(None, 3, (), (), ())
    assert "--configfile" not in demo
    assert demo[-1] == "--"
    own = workflow.command_of("a b.yaml", 3, ["export"], ["width=3"], ["poses"])
    words = ["--configfile", "a b.yaml", "--config", "width=3", "--forcerun", "poses"]
    assert own[-len(words) - 2 :] == [*words, "--", "export"]
