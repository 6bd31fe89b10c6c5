"""Lines and the bar, on a terminal and in a log."""

import io
import re

import pytest

from alignerf.start.terminal import screen


class Terminal(io.StringIO):
    def isatty(self):
        return True


def shown(text):
    """The lines that a terminal shows in the end; of each what was written last."""
    found = []
    for line in text.split("\n"):
        whole = ""
        for part in re.split(r"\r", line):
            whole = part.replace("\x1b[2K", "") or ("" if "\x1b[2K" in part else whole)
        found.append(whole)
    return found


def test_the_bar_stays_beneath_the_lines_and_goes_in_the_end(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "60")
    stream = Terminal()
    one = screen.Screen(stream)
    one.state(0.5, "3 of 6 jobs; " + "x" * 200)
    bar = shown(stream.getvalue())[-1]
    assert bar.startswith("[############............] 3 of 6 jobs; ")
    # As long as the terminal is wide it would begin another line.
    assert len(bar) == 59
    one.line("photos and cameras  0:05")
    one.state(1.5, "6 of 6 jobs")
    one.close()
    assert shown(stream.getvalue()) == ["photos and cameras  0:05", ""]


@pytest.mark.parametrize("stream", [io.StringIO, Terminal])
def test_a_log_has_no_codes_of_terminals(monkeypatch, stream):
    """An editor's shell says that it is dumb."""
    monkeypatch.setenv("TERM", "dumb")
    stream = stream()
    one = screen.Screen(stream)
    assert one.every_s == screen.LOG_EVERY_S
    one.line("a")
    one.state(0.5, "3 of 6 jobs")
    one.close()
    assert stream.getvalue() == "a\n  ... 3 of 6 jobs\n"


def test_a_state_is_due_after_a_while(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(screen.time, "monotonic", lambda: now[0])
    one = screen.Screen(io.StringIO())
    assert not one.due()
    now[0] = screen.LOG_EVERY_S
    assert one.due()
    one.state(0.1, "")
    assert not one.due()


def test_letters_that_a_terminal_lacks_end_no_run():
    raw = io.BytesIO()
    one = screen.Screen(io.TextIOWrapper(raw, encoding="ascii"))
    one.line("größe")
    assert raw.getvalue() == b"gr\\xf6\\xdfe\n"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0:00"), (59.7, "1:00"), (750, "12:30"), (3723, "1:02:03")],
)
def test_the_clock(seconds, text):
    assert screen.clock(seconds) == text
