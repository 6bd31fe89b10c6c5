"""Arguments as an input: which cases there are, and what the oracle finds."""

import os
import random
import shutil
import sys

import pytest

from alignerf.cli import configs, folders
from tools.torture import arguments, running, stages

CASES = 40


def stage_of(*words, outputs=("out/a.txt",)):
    return stages.Stage([sys.executable, "-m", "some", *words], list(outputs))


@pytest.fixture
def base(tmp_path):
    (tmp_path / "base/out").mkdir(parents=True)
    (tmp_path / "base/out/a.txt").write_text("made")
    (tmp_path / "base/kept.txt").write_text("of a user")
    return tmp_path / "base"


def tried(base, tmp_path, monkeypatch, do, words, code=0, said="", **more):
    """What the oracle says of a command that does something and ends so."""

    def run(command, folder, environment):
        do(folder)
        return running.Ended(code, said, 1.0, 100.0)

    monkeypatch.setattr(running, "run", run)
    command = arguments.Command(stage_of("--out", "out/a.txt", "--n", "3"), base)
    case = arguments.Case(command, "what", words, **more)
    return arguments.attack(case, tmp_path / "place")


def make(text, path="out/a.txt"):
    return lambda folder: (folder / path).write_text(text)


def nothing(folder):
    pass


def test_arguments_are_left_out_doubled_and_replaced(base):
    command = arguments.Command(stage_of("x", "--a", "1", "2", "--b"), base)
    cases = {case.what: case.words for case in arguments.cases_of(command)}
    assert arguments.groups_of(["x", "--a", "1", "2", "--b"]) == [
        ["x"],
        ["--a", "1", "2"],
        ["--b"],
    ]
    assert cases["without --a"] == ["x", "--b"]
    assert cases["--a without a value"] == ["x", "--a", "--b"]
    assert cases["--a by ="] == ["x", "--a=1", "2", "--b"]
    assert cases["--b twice"] == ["x", "--a", "1", "2", "--b", "--b"]
    assert cases["argument 1 'nan'"] == ["nan", "--a", "1", "2", "--b"]
    assert cases["--a '..'"][-2] == ".."
    assert cases["and ['--', 'x']"][-2:] == ["--", "x"]
    assert {"--a 'a loop'", "--a 'a pipe'", "--a ''"} <= cases.keys()


def test_no_case_gives_a_path_outside_its_own_folder():
    for text in (*arguments.TEXTS, *arguments.PATHS):
        assert not os.path.isabs(text)
        assert os.path.normpath(text).split("/").count("..") <= 1


def test_the_oracle_knows_a_good_end(base, tmp_path, monkeypatch):
    words = ["--out", "out/a.txt"]
    one = tried(base, tmp_path, monkeypatch, make("made"), words)
    refused = tried(base, tmp_path, monkeypatch, nothing, words, 1, "error: --n: no\n")
    usage = "usage: x\n  more\nx: error: unrecognized arguments\n"
    assert one is refused is None
    assert tried(base, tmp_path, monkeypatch, nothing, words, 2, usage) is None


def test_the_oracle_knows_a_bad_end(base, tmp_path, monkeypatch):
    for code, said, reason in (
        (1, "Traceback\nKeyError: 3\n", "traceback: KeyError: 3"),
        (1, "", "0 lines of error"),
        (2, "error: a\nerror: b\n", "2 lines of error"),
        (-9, "", "exit -9"),
        (1, f"error: {'x' * 2000}\n", "a line that nobody can read"),
        (1, "error: \x1b[2J\n", "a line that nobody can read"),
    ):
        found = tried(base, tmp_path, monkeypatch, nothing, ["x"], code, said)
        assert found.startswith(reason)


def test_the_oracle_knows_what_happened_to_files(base, tmp_path, monkeypatch):
    def gone(folder):
        (folder / "a folder" / "of a user.txt").unlink()

    for do, reason in (
        (make("other"), "taken, with another out/a.txt"),
        (make("x", "kept.txt"), "inner/kept.txt is changed"),
        (make("x", "out/.a.txt.123"), "left inner/out/.a.txt.123 behind"),
        (gone, "inner/a folder/of a user.txt is gone"),
    ):
        shutil.rmtree(tmp_path / "place", ignore_errors=True)
        base.joinpath("kept.txt").unlink()
        base.joinpath("kept.txt").write_text("of a user")
        assert tried(base, tmp_path, monkeypatch, do, ["x"]) == reason


def test_another_value_may_make_another_output(base, tmp_path, monkeypatch):
    def found(*words, **more):
        return tried(base, tmp_path, monkeypatch, make("other"), [*words], **more)

    assert found("--n", "7", option="--n") is None
    assert found("--n", "nan", option="--n") == "taken, with another out/a.txt"
    assert found("--n", "x", option="--n") == "taken, with another out/a.txt"
    assert found("--out", "out/a.txt", is_less=True) is None
    # A file that the command was told to write.
    do = make("other", "kept.txt")
    words = ["--out", "kept.txt"]
    assert tried(base, tmp_path, monkeypatch, do, words, option="--out") is None


def test_what_users_type_is_refused_or_right(tmp_path, monkeypatch):
    """Some of all cases, in this process."""

    def run(command, folder, environment=None):
        return running.in_process(["python", *command[1:]], folder)

    monkeypatch.setattr(running, "run", run)
    commands = arguments.commands_of_start(tmp_path / "start")
    found = []
    for case in random.Random(0).sample(
        [
            case
            for command in commands
            for case in arguments.cases_of(command)
            if arguments.is_short(case)
        ],
        CASES,
    ):
        if fault := arguments.attack(case, tmp_path / "place"):
            found.append(f"{case}: {fault}")
    assert found == []


@pytest.mark.parametrize("name", ["loop", "link"])
def test_a_name_is_a_text_and_no_path(name, tmp_path, monkeypatch):
    """Found once: a link of the name in the working folder was followed."""
    (tmp_path / "photos").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "link").symlink_to("photos")
    monkeypatch.chdir(tmp_path)
    assert configs.name(name) == name
    assert folders.name_of("loop") == "loop"
