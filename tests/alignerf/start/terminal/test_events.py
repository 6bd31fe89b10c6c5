"""A child that tells what it does, through a pipe."""

import os
import signal
import sys
import time

import pytest

from alignerf.start.terminal import events

TELL = "import os; tell = lambda t: os.write(int(os.environ['ALIGNERF_EVENTS_FD']), t);"


@pytest.fixture
def child(tmp_path):
    def start(code):
        command = [sys.executable, "-c", TELL + code]
        return events.Child(command, tmp_path / "run.log")

    return start


def test_events_come_out_and_all_else_goes_to_the_file(child, tmp_path):
    code = "tell(b'{\"a\": 1}\\nno JSON\\n'); print('said', flush=True);"
    code += "os.write(2, b'faults'); tell(b'{\"a\": 2}\\n'); os._exit(3)"
    one, found = child(code), []
    while not one.ended():
        if (event := one.next(0.1)) is not None:
            found.append(event)
    assert found == [{"a": 1}, {"a": 2}]
    assert one.code() == 3
    assert (tmp_path / "run.log").read_text() == "said\nfaults"


def test_it_is_ended_with_its_parent(child):
    one = child("import time; tell(b'{}\\n'); time.sleep(60)")
    assert one.next(30) == {}
    with one.handed_on():
        os.kill(os.getpid(), signal.SIGTERM)
        begun = time.monotonic()
        assert one.code() == 128 + signal.SIGTERM
    assert time.monotonic() - begun < 30
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_it_is_ended_where_its_reader_fails(child):
    one = child("import time; tell(b'{}\\n'); time.sleep(60)")
    assert one.next(30) == {}
    with pytest.raises(OSError, match="nobody looks"), one.handed_on():
        raise OSError("nobody looks")
    assert one.code() == 128 + signal.SIGTERM


def test_who_does_not_end_is_killed(child, monkeypatch):
    monkeypatch.setattr(events, "STUCK_S", 0.5)
    deaf = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN);"
    one = child(f"{deaf} tell(b'{{}}\\n'); time.sleep(60)")
    assert one.next(30) == {}
    with pytest.raises(OSError, match="nobody looks"), one.handed_on():
        raise OSError("nobody looks")
    assert one.code() == 128 + signal.SIGKILL


def test_jobs_do_not_hold_the_pipe_open(child):
    """What a job leaves running does not keep a run from ending."""
    left = "[sys.executable, '-c', 'import time; time.sleep(20)']"
    one = child(f"import subprocess, sys; subprocess.Popen({left}); tell(b'{{}}\\n')")
    begun = time.monotonic()
    assert one.next(30) == {}
    one.process.wait()
    assert one.ended()
    assert time.monotonic() - begun < events.LAST_S
