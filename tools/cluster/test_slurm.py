"""A tiny chain through a real Slurm, of this host alone (see one_host.py)."""

import re
import shutil
import signal
import subprocess
import sys
import time

import pytest
import yaml

from tools.cluster import one_host
from tools.torture import chains

pytest.importorskip("snakemake_executor_plugin_slurm", reason="make cluster")
if reason := one_host.missing():
    pytest.skip(reason, allow_module_level=True)

CONFIG = yaml.safe_load(chains.CONFIG) | {"preflight": True}
CONFIG["methods"] = {"mipnerf360": {}}
PREFLIGHT = "results/tiny/preflight.json"
TRAINED = "results/tiny/mipnerf360/round0/timing.json"
CHECKPOINTS = "results/tiny/mipnerf360/round0/checkpoints"
LOG = "results/tiny/mipnerf360/round0/logs/train.log"
# A process started in the background ignores SIGINT, and so do those that it starts.
INTERRUPTIBLE = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])
"""
# Of every job, in columns of so many letters.
WIDTH = 200
COLUMNS = ("Comment", "NumCPUs", "MinMemory", "TimeLimit", "tres-per-job", "State")


@pytest.fixture(scope="module")
def slurm():
    with one_host.cluster() as found:
        yield found


@pytest.fixture(scope="module")
def begun(root, slurm, tmp_path_factory):
    """A folder in which the chain has come as far as its preflight, by Slurm."""
    folder = tmp_path_factory.mktemp("chain")
    (folder / "tiny.yaml").write_text(yaml.safe_dump(CONFIG))
    done = run(root, slurm, folder, PREFLIGHT)
    assert done.returncode == 0, done.stdout
    return folder


def command(root, *more):
    return [
        *(sys.executable, "-m", "snakemake", *more, "--configfile", "tiny.yaml"),
        *("--snakefile", str(root / "Snakefile"), "--latency-wait", "5"),
        *("--workflow-profile", str(root / "profiles/slurm")),
        # As there is no accounting database; and soon, since jobs are short.
        *("--slurm-status-command", "squeue"),
        *("--slurm-init-seconds-before-status-checks", "2"),
    ]


def run(root, slurm, folder, *more, **environ):
    return subprocess.run(
        command(root, *more),
        cwd=folder,
        env=slurm.environ | environ,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=500,
    )


def jobs_of(slurm, rule):
    """(cores, memory, minutes, accelerators, state) of each of a rule's jobs."""
    columns = ",".join(f"{name}:{WIDTH}" for name in COLUMNS)
    said = slurm.says(
        *("squeue", "--states=all", "--noheader", "--sort=i", f"--Format={columns}")
    )
    lines = [
        [line[at : at + WIDTH].strip() for at in range(0, len(line), WIDTH)]
        for line in said.splitlines()
    ]
    return [line[1:] for line in lines if re.match(rf"rule_{rule}(_|$)", line[0])]


# Memory and minutes of a training, which would else ask for what this host has not.
SMALL = ["--set-resources", "train:mem_mb=1500", "train:runtime=11"]
TOO_SMALL = ["--set-resources", "train:mem_mb=501*2**(attempt-1)"]


def retrain(folder, *, steps=60):
    """Let the training run again, with another length."""
    (folder / TRAINED).unlink(missing_ok=True)
    shutil.rmtree(folder / CHECKPOINTS, ignore_errors=True)
    config = CONFIG | {"training": CONFIG["training"] | {"steps": steps}}
    (folder / "tiny.yaml").write_text(yaml.safe_dump(config))


def test_jobs_have_what_they_ask_for(root, slurm, begun):
    """Memory and minutes, the profile's cores, accelerators."""
    done = run(root, slurm, begun, TRAINED, *SMALL, "train:gpu=1")
    assert done.returncode == 0, done.stdout
    (job,) = jobs_of(slurm, "train")
    assert job == ["4", "1500M", "11:00", "gres:gpu:1", "COMPLETED"]
    assert jobs_of(slurm, "poses")[0][:2] == ["8", "8000M"]


def test_a_job_of_too_much_memory_gets_more(root, slurm, begun):
    retrain(begun)
    before = len(jobs_of(slurm, "train"))
    done = run(root, slurm, begun, TRAINED, *TOO_SMALL, "--forcerun", "train")
    assert done.returncode == 0, done.stdout
    found = [(memory, state) for _, memory, *_, state in jobs_of(slurm, "train")]
    first, *_, last = found[before:]
    assert first[0] == "501M"
    assert first[1] in ("OUT_OF_MEMORY", "FAILED")
    assert (last[1], int(last[0][:-1]) >= 1002) == ("COMPLETED", True)


def test_a_job_of_too_much_time_gets_more_and_goes_on(root, slurm, begun):
    """The second attempt begins at the first one's checkpoint."""
    retrain(begun, steps=40_000)
    before = len(jobs_of(slurm, "train"))
    limit = [*SMALL, "train:runtime=attempt"]
    done = run(root, slurm, begun, TRAINED, *limit)
    found = [(line[2], line[-1]) for line in jobs_of(slurm, "train")[before:]]
    assert found[0] == ("1:00", "TIMEOUT")
    assert found[1][0] == "2:00"
    assert "resuming at step" in (begun / LOG).read_text()
    assert (done.returncode == 0) == (found[-1][1] == "COMPLETED")


def test_a_dead_node_and_a_cancelled_run_cost_a_minute_of_training(root, slurm, begun):
    """What was trained until the last checkpoint is there for the next node."""
    retrain(begun, steps=1_000_000)
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTIBLE, *command(root, TRAINED, *SMALL)],
        cwd=begun,
        env=slurm.environ,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    manifest = begun / CHECKPOINTS / "manifest.json"
    try:
        first = wait_for_step(manifest, above=0)
        (node,) = slurm.says(
            "squeue", "--noheader", "--states=R", "--format=%N"
        ).split()
        slurm.kill_node(node)
        wait_for_step(manifest, above=first)
        # As Ctrl-C does; SIGTERM would let running jobs end first.
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=90)
    finally:
        process.kill()
    running = ("squeue", "--noheader", "--states=R,CG")
    until = time.monotonic() + 60
    while slurm.says(*running) and time.monotonic() < until:
        time.sleep(1)
    assert not slurm.says(*running)
    slurm.start_node(node)
    words = re.findall(r"resuming at step (\d+)", (begun / LOG).read_text())
    assert int(words[-1]) >= first


def wait_for_step(manifest, *, above, max_s=420):
    """The step of a checkpoint that is younger than another."""
    until = time.monotonic() + max_s
    while time.monotonic() < until:
        time.sleep(1)
        if manifest.exists():
            step = int(re.findall(r"state-(\d+)", manifest.read_text())[0])
            if step > above:
                return step
    raise AssertionError("no checkpoint")


def test_more_accelerators_than_there_are_is_said(root, slurm, begun):
    retrain(begun)
    more = [*SMALL, "train:gpu=64", "--retries", "0"]
    done = run(root, slurm, begun, TRAINED, *more)
    assert done.returncode != 0
    said = "error: Slurm refused a job: Batch job submission failed: Requested node"
    assert said in done.stdout


def test_a_limit_that_ends_a_run_is_said(root, slurm, begun):
    retrain(begun)
    done = run(root, slurm, begun, TRAINED, *TOO_SMALL, "--retries", "0")
    assert done.returncode != 0
    said = re.findall(r"^error: Slurm's job \d+ (.*)", done.stdout, re.MULTILINE)
    assert said == ["took more memory than it had asked for (OUT_OF_MEMORY)"]
