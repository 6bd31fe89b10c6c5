"""The installed command: the same modules, and words that its user can type."""

import re
import subprocess
import sys
import tomllib

import pytest

import alignerf
from alignerf.cli import configs, demo, judge, why_blurry, workflow
from alignerf.experiment import targets
from alignerf.io import provenance


@pytest.fixture
def typed(monkeypatch, tmp_path):
    """As a user has typed it, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    # What it sets for its process ends with the test.
    monkeypatch.setenv(provenance.TYPED, "")
    monkeypatch.setattr(sys, "argv", ["pytest"])

    def run(*words):
        try:
            why_blurry.main(words)
        except SystemExit as end:
            return end.code
        return 0

    return run


@pytest.mark.parametrize("command", why_blurry.COMMANDS)
def test_each_command_has_its_help(typed, capsys, command):
    assert typed(command, "--help") == 0
    assert capsys.readouterr().out.startswith("usage: ")
    assert f"why-blurry {command}" in why_blurry.HELP


@pytest.mark.parametrize("words", [(), ("--help",)])
def test_without_words_it_says_what_there_is(typed, capsys, words):
    assert typed(*words) == 0
    assert "why-blurry photos my_photos" in capsys.readouterr().out


def test_it_says_its_version(typed, capsys):
    assert typed("--version") == 0
    assert capsys.readouterr().out == f"why-blurry {alignerf.__version__}\n"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("fotos",), "why-blurry fotos: no such command; there are demo, photos,"),
        (("photos", ""), "FOLDER is missing: why-blurry photos my_photos"),
        (("photos", "gone"), "gone does not exist"),
        (("judge",), "PHOTOS is missing: why-blurry judge --photos photos"),
        (("export", "x"), "run `why-blurry photos x` first"),
        (("show",), "results: no misalignment table in it yet"),
    ],
)
def test_faults_are_one_line_in_words_of_the_command(typed, capsys, words, said):
    assert typed(*words) == 1
    out, err = capsys.readouterr()
    assert said in err
    assert (out, err.count("\n")) == ("", 1)


def test_make_and_the_command_each_have_their_usage(typed, capsys):
    with pytest.raises(SystemExit) as end:
        judge.main(["--nme", "x"])
    assert end.value.code == 2
    usage, fault = capsys.readouterr().err.splitlines()
    assert usage.startswith("usage: make judge PHOTOS=images RENDERS=renders|SPLAT=")
    assert usage.endswith('[OPTIONS="--name x"]')
    assert fault == "make judge: error: unrecognized arguments: --nme x"
    assert typed("judge", "--nme", "x") == 2
    assert capsys.readouterr().err.startswith("usage: why-blurry judge [-h] [--name")


def test_the_package_itself_says_what_to_type(root):
    words = [sys.executable, "-m", "alignerf"]
    done = subprocess.run(words, cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout == why_blurry.HELP


def test_a_package_that_is_missing_is_one_line(typed, capsys, monkeypatch):
    monkeypatch.setitem(why_blurry.COMMANDS, "photos", "alignerf.not_there")
    assert typed("photos") == 1
    said = "error: alignerf.not_there is not installed here. Type `. .venv/bin/activate"
    assert capsys.readouterr().err.startswith(said)


def test_make_help_is_short_and_names_what_users_type(root):
    def said(target):
        words = ["make", "-C", root, "--no-print-directory", target]
        return subprocess.run(words, capture_output=True, text=True).stdout.rstrip()

    short, whole = said("help").splitlines(), said("help-all")
    users = {"run", "photos", "poses", "judge", "export"}
    commands = (re.match(r"make (\w+)", line) for line in short)
    assert {one[1] for one in commands if one} == users
    assert len(short) <= 12
    assert set(short) < set(whole.splitlines())
    named = set(re.findall(r"^make ([\w-]+)", whole, re.MULTILINE))
    text = (root / "Makefile").read_text()
    rules = re.findall(r"^([\w-]+):", text, re.MULTILINE)
    rules += re.search(r"^TARGETS := (.+)", text, re.MULTILINE)[1].split()
    assert named == set(rules)


def test_a_config_says_how_it_was_made(typed, capsys, tmp_path):
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "a.jpg").touch()
    assert typed("photos", "p", "--only-config") == 0
    head = (tmp_path / "results" / "p.yaml").read_text().splitlines()[0]
    assert head == "# Written by `why-blurry photos` for 'p'"
    found = targets.export_command([str(tmp_path / "results" / "p.yaml")])
    assert found == "why-blurry export p"
    assert configs.program("judge") == "why-blurry judge"


def test_the_demo_runs_the_default_config(monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(workflow, "run", lambda *words: asked.append(words) or 3)
    with pytest.raises(SystemExit) as end:
        demo.main(["--cores", "2"])
    assert (end.value.code, asked) == (3, [(None, 2)])
    assert "results/courtyard/index.html" in capsys.readouterr().out


def test_it_is_the_command_of_the_package(root):
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"why-blurry": "alignerf.cli.why_blurry:main"}
    assert callable(why_blurry.main)
