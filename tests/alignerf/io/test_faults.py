"""What a command prints is one line, whatever the names in it hold."""

import logging
import sys

import pytest

from alignerf import evaluate
from alignerf.io import faults


@pytest.fixture
def said(capsys, monkeypatch):
    """A function of what fails or logs: the lines that come on stderr."""
    monkeypatch.delenv("ALIGNERF_DEBUG", raising=False)

    def run(main):
        # Not those that the tests put there.
        monkeypatch.setattr(logging.root, "handlers", [])
        assert faults.exit_code(main) in (0, 1)
        return capsys.readouterr().err.splitlines()

    return run


HOSTILE = [
    "a\nerror: forged",
    "a\r\x1b[2Jb",
    "a\x85b\u2028c",
    "right to left \u202egnp.exe",
    "half a pair \udc80",
    "z\0",
    "n" * 10**6,
    "\x01" * 10**6,
    "\U000e0001" * 900,
]


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
@pytest.mark.parametrize("way", ["fault", "log"])
def test_a_name_forges_no_line(said, name, way):
    def main():
        if way == "fault":
            raise ValueError(f"{name}: not found, rename it")
        logging.getLogger("alignerf").warning("%s: not found, rename it", name)

    (line,) = said(main)
    assert line.isprintable()
    assert line.endswith("not found, rename it")
    assert len(line) <= faults.MAX_CHARACTERS + len("error: ")


def test_what_prints_stays_as_it_is(said):
    def main():
        raise ValueError("Größe 3/写真.jpg:  not\n  found")

    assert said(main) == ["error: Größe 3/写真.jpg: not found"]


def test_a_log_has_its_traceback_on_lines_of_its_own(said):
    def main():
        try:
            raise KeyError("a")
        except KeyError:
            logging.getLogger("alignerf").warning("b\nc", exc_info=sys.exc_info())

    first, *rest = said(main)
    assert first == "warning: b\\nc"
    assert rest[-1] == "KeyError: 'a'"


def test_an_empty_path_is_no_option_left_out(capsys):
    with pytest.raises(SystemExit) as ended:
        evaluate.main(["--scene", "x", "--out", "y", "--renders", "z", "--truth", ""])
    assert ended.value.code == 2
    assert "argument --truth: nothing stands there" in capsys.readouterr().err
