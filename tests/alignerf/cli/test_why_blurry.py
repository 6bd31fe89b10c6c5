"""The installed command: the same modules, and words that its user can type."""

import sys
import tomllib

import pytest

import alignerf
from alignerf.cli import configs, demo, why_blurry, workflow
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


def test_a_config_says_how_it_was_made(typed, capsys, tmp_path):
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "a.jpg").touch()
    assert typed("photos", "p", "--only-config") == 0
    head = (tmp_path / "results" / "p.yaml").read_text().splitlines()[0]
    assert head == "# Written by `why-blurry photos`, of 'p'"
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
