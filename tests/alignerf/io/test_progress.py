"""The one progress bar: a bar on a terminal, lines in a log, closed in any case."""

import io
import re
import sys
import threading
import time

import pytest

from alignerf.io import progress


class Terminal(io.StringIO):
    """A stream that says it is one."""

    def isatty(self):
        return True


@pytest.fixture
def opened(monkeypatch):
    """Each Progress that is made, with how often it was closed."""
    found = []

    class Noted(progress.Progress):
        closed = 0

        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            found.append(self)

        def close(self):
            self.closed += 1
            super().close()

    monkeypatch.setattr(progress, "Progress", Noted)
    return found


@pytest.mark.parametrize("terminal", [True, False])
def test_over_yields_all_and_counts_what_is_done(opened, monkeypatch, terminal):
    stream = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    counts = []
    for item in progress.over(iter("abc"), "letters", unit="letter"):
        counts.append((item, opened[0].done))
    assert counts == [("a", 0), ("b", 1), ("c", 2)]
    (shown,) = opened
    assert (shown.done, shown.total, shown.closed) == (3, 3, 1)
    assert (shown.bar is not None) == terminal
    assert "letters" in stream.getvalue()
    assert "3/3" in stream.getvalue()


@pytest.mark.parametrize("terminal", [True, False])
def test_over_closes_where_its_loop_fails(opened, monkeypatch, terminal):
    monkeypatch.setattr(sys, "stderr", Terminal() if terminal else io.StringIO())

    def fail():
        items = progress.over(range(5), "numbers")
        for item in items:
            if item == 2:
                items.throw(RuntimeError("in the loop"))

    with pytest.raises(RuntimeError, match="in the loop"):
        fail()
    (shown,) = opened
    assert (shown.done, shown.closed) == (2, 1)
    assert shown.bar is None or shown.bar.disable


def test_over_nothing_shows_nothing(opened, capsys):
    assert list(progress.over([], "numbers")) == []
    assert opened[0].closed == 1
    assert not capsys.readouterr().err


def test_a_log_gets_a_line_now_and_then(capsys):
    shown = progress.Progress("train", 8, done=2)
    shown.log_every_s = 0.0
    for _ in range(3):
        shown.advance(2, loss=0.25)
    lines = capsys.readouterr().err.splitlines()
    assert [
        re.search(r"step (\d)/8  loss 0.25  eta \d", line)[1] for line in lines
    ] == [*"468"]
    seldom = progress.Progress("train", 3)
    for _ in range(3):
        seldom.advance()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("train: step 3/3")


def test_nothing_else_draws_bars(root):
    found = {
        path.relative_to(root).as_posix()
        for package in ("alignerf", "flow")
        for path in (root / package).rglob("*.py")
        if "tqdm" in path.read_text()
    }
    assert found == {"alignerf/io/progress.py"}


def test_what_another_library_does_is_watched(capsys):
    counts = iter([0, 2, 1, 9])
    seen = threading.Event()

    def count():
        """So many of 4; then all that could be asked was."""
        found = next(counts, 4)
        if found == 9:
            seen.set()
        return found

    with progress.watched("COLMAP: features", 4, count, unit="photo", every_s=0.01):
        assert seen.wait(10)
    first, *others = capsys.readouterr().err.splitlines()
    # Without one that is done there is no time left to tell.
    assert first == "COLMAP: features: for 0:00"
    told = [progress.read(line) for line in others]
    # It does not go back, nor beyond the last.
    assert [one.text for one in told][:3] == ["photo 2/4", "photo 2/4", "photo 4/4"]
    assert all(one.left_s is not None for one in told)


def test_a_watch_ends_with_its_block(capsys):
    def fail():
        with progress.watched("COLMAP", 4, lambda: 1, unit="photo", every_s=0.01):
            raise RuntimeError("in the block")

    with pytest.raises(RuntimeError, match="in the block"):
        fail()
    capsys.readouterr()
    time.sleep(0.05)
    assert capsys.readouterr().err == ""
