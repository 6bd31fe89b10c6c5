"""Commands of other programs: words without a shell, faults in a line, no orphans."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest

from alignerf.external import commands
from alignerf.io import provenance

PYTHON = sys.executable
# JAX, which the tests have imported, forbids to fork: a process of its own runs it.
RUNNER = """
import sys
from alignerf.io import faults
from alignerf.external import commands
commands.GRACE_S = 0.5
faults.run(lambda: print(commands.run(sys.argv[1:])))
"""
OURS = os.environ | {"PYTHONPATH": str(provenance.ROOT)}
# Starts a child of its own, says both numbers, and waits.
PARENT = """
import os, subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
print(os.getpid(), child.pid, flush=True)
time.sleep(60)
"""


def ran(*words, cwd=None):
    """(what a run command prints, the fault that ends it)."""
    done = subprocess.run(
        [PYTHON, "-c", RUNNER, *words],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=OURS,
    )
    assert (done.returncode != 0) == ("error: " in done.stderr)
    return done.stdout, done.stderr


def started(*words):
    """(a process that runs a command, numbers of processes that this prints)."""
    child = subprocess.Popen(
        [PYTHON, "-c", RUNNER, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=OURS,
    )
    for line in child.stdout:
        if re.fullmatch(r"[\d ]+\n", line):
            child.stdout.close()
            return child, list(map(int, line.split()))
    raise AssertionError("it has not started")


def gone(pid, within_s=60.0):
    """Whether a process has ended, or does so soon; a zombie has."""
    end = time.monotonic() + within_s
    while time.monotonic() < end:
        try:
            with open(f"/proc/{pid}/stat") as file:
                if file.read().rpartition(")")[2].split()[0] == "Z":
                    return True
        except OSError:
            return True
        time.sleep(0.02)
    return False


def test_a_value_is_a_part_of_its_word_whatever_is_in_it(tmp_path):
    nasty = "a b; touch stolen $(touch stolen) `touch stolen` \"'{data}*"
    script = "import sys; print(sys.argv[1:])"
    template = f"'{PYTHON}' -c '{script}' --data={{data}} {{{{x}}}}"
    words = commands.words_of(template, {"data": nasty})
    assert words[-2:] == [f"--data={nasty}", "{x}"]
    said, _ = ran(*words, cwd=tmp_path)
    assert said.splitlines()[-2] == repr([f"--data={nasty}", "{x}"])
    assert not (tmp_path / "stolen").exists()


def test_a_home_is_written_out(monkeypatch):
    monkeypatch.setenv("HOME", "/home/me")
    words = commands.words_of("~/bin/train {data}", {"data": "~"})
    assert words == ["/home/me/bin/train", "~"]


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("print('one'); print('two\\n\\n'); raise SystemExit(3)", "code 3; .*: two"),
        ("print('1 %\\r20 %\\x1b[0m', end=''); raise SystemExit(1)", "line: 20 %"),
        ("raise SystemExit(2)", "exit code 2; it said nothing"),
        ("raise KeyError('why')", "exit code 1; its last line: KeyError: 'why'"),
        ("import os; os.kill(os.getpid(), 9)", "ended by SIGKILL, as where memory"),
    ],
)
def test_a_failure_is_one_line(code, message):
    _, fault = ran(PYTHON, "-c", code)
    assert fault.startswith(f"error: {PYTHON} ")
    assert re.search(message, fault)
    assert fault.count("\n") == 1


def test_a_program_that_cannot_be_started(tmp_path):
    _, fault = ran("ns-trian", "nerfacto")
    assert fault.startswith("error: ns-trian: there is no such program; ")
    file = tmp_path / "script"
    file.write_text("#!/bin/sh\n")
    assert ran(str(file))[1] == f"error: {file}: Permission denied\n"


def test_seconds_are_those_of_the_command():
    said, _ = ran(PYTHON, "-c", "import time; time.sleep(0.3)")
    assert 0.3 <= float(said.split()[-1]) < 5


def test_its_environment_has_not_our_modules(monkeypatch):
    other = os.pathsep.join([str(provenance.ROOT), "/theirs"])
    monkeypatch.setenv("PYTHONPATH", other)
    assert commands.environment(1)["PYTHONPATH"] == "/theirs"
    monkeypatch.setenv("PYTHONPATH", str(provenance.ROOT))
    assert "PYTHONPATH" not in commands.environment(1)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    assert commands.environment(3)["OMP_NUM_THREADS"] == "3"
    monkeypatch.setenv("OMP_NUM_THREADS", "5")
    assert commands.environment(3)["OMP_NUM_THREADS"] == "5"


def test_what_it_leaves_in_the_background_is_ended():
    code = "import subprocess, sys; print(subprocess.Popen(['sleep', '60']).pid)"
    said, _ = ran(PYTHON, "-c", code)
    assert gone(int(said.split()[-2]))


LINUX = pytest.mark.skipif(sys.platform != "linux", reason="orphans are not found")


@pytest.mark.parametrize("is_stopped", [False, True])
@pytest.mark.parametrize(
    "left",
    [
        "sh -c 'trap \"\" TERM; echo $$; while :; do sleep 1; done'",
        pytest.param("setsid sh -c 'echo $$; exec sleep 300'", marks=LINUX),
        pytest.param(
            "setsid sh -c 'trap \"\" TERM; echo $$; while :; do sleep 1; done'",
            marks=LINUX,
        ),
    ],
)
def test_what_is_deaf_or_of_another_session_is_ended_too(left, is_stopped):
    command = f"({left} &); sleep {60 if is_stopped else 0.5}"
    child, (pid,) = started("sh", "-c", command)
    if is_stopped:
        child.send_signal(signal.SIGTERM)
    assert (child.wait(10) == -signal.SIGTERM) == is_stopped
    assert gone(pid, 0.5)


def test_what_was_there_before_the_command_stays():
    code = "import subprocess; own = subprocess.Popen(['sleep', '60'])"
    code += f"{RUNNER}\nprint('own', own.poll()); own.kill()"
    done = subprocess.run(
        [PYTHON, "-c", code, "true"], capture_output=True, text=True, env=OURS
    )
    assert done.stdout.splitlines()[-1] == "own None"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_all_of_it(number):
    child, pids = started(PYTHON, "-c", PARENT)
    child.send_signal(number)
    assert child.wait(10) == -number
    assert all(map(gone, pids))


def test_it_ends_where_we_are_killed():
    child, pids = started(PYTHON, "-c", PARENT)
    child.kill()
    child.wait(10)
    assert gone(pids[0])
    os.kill(pids[1], signal.SIGKILL)
