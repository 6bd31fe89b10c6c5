"""`make export` finds the config of a capture, and runs its exports alone."""

import shlex
import shutil

import pytest

from alignerf.cli import export, workflow
from alignerf.experiment import targets
from alignerf.experiment.tables import shipped
from alignerf.io import faults, machine, provenance


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results").mkdir()
    text = "scenes: {my_photos: {source: photos, path: my photos}}\n"
    (tmp_path / "results" / "my_photos.yaml").write_text(text)
    return tmp_path


@pytest.fixture
def runs(monkeypatch):
    """What the workflow is asked for."""
    asked = []

    def run(path, cores, *targets, overrides=(), forced=()):
        asked.append((str(path), targets, list(overrides)))
        return 0

    monkeypatch.setattr(workflow, "run", run)
    return asked


@pytest.mark.parametrize("name", ["my_photos", "my photos", "elsewhere/my photos/"])
def test_a_name_or_a_folder_is_enough(here, runs, capsys, name):
    made = here / "results/my_photos/auto/export/cameras"
    made.mkdir(parents=True)
    (made / "README.txt").touch()
    export.main([name])
    assert runs == [("results/my_photos.yaml", ("export",), [])]
    told = capsys.readouterr().out
    assert "export: results/my_photos/auto/export/cameras/README.txt" in told
    assert shlex.join(["ns-train", "splatfacto", "--data", str(made)]) in told


def test_the_demo_has_no_config_in_results(here, runs, capsys):
    """Another config may have a scene of that name, and nothing may be there yet."""
    assert faults.exit_code(export.main, ["courtyard"]) == 1
    (here / "results/courtyard").mkdir()
    made = here / "results/courtyard/config.yaml"
    shutil.copy(shipped.DEMO, made)
    export.main(["courtyard"])
    assert runs == [("None", ("export",), [])]
    made.write_text("scenes: {courtyard: {source: external_renders}}\nmethods: {}\n")
    assert faults.exit_code(export.main, ["courtyard"]) == 1
    assert len(runs) == 1


def test_a_width_overrules_the_config(here, runs):
    export.main(["my_photos", "--width", "1600"])
    assert runs[0][2] == ["export_width_px=1600"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        (
            "other",
            "results/other.yaml does not exist; there is my_photos: run",
        ),
        ("", "SCENE is missing: make export SCENE=my_photos"),
    ],
)
def test_without_a_config_it_says_so_in_one_line(here, runs, capsys, name, reason):
    assert faults.exit_code(export.main, [name]) == 1
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1
    assert not runs


def test_make_hands_on_name_and_width(handed_on):
    told = handed_on("export", "SCENE=my photos", "WIDTH=1600")
    assert "'--width=1600', '--', 'my photos']" in told
    assert "alignerf.cli.export" in told


def test_the_command_is_that_of_the_run(here, monkeypatch):
    cores = machine.cores()
    found = targets.export_command([str(here / "results/my_photos.yaml")])
    assert found == "make export SCENE=my_photos"
    found = targets.export_command(["own.yaml"])
    assert found == f"snakemake --cores {cores} export --configfile own.yaml"
    assert targets.export_command([]) == "make export SCENE=courtyard"
    monkeypatch.setenv(provenance.EXPORT, "make export SCENE=a")
    assert provenance.export_command() == "make export SCENE=a"


def test_a_run_ends_with_the_command(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a/verdict.json").write_text('{"verdict": ["Verdict: aligned."]}')
    lines = targets.verdicts(["a"], results=tmp_path, export="make export SCENE=a")
    assert lines[-1].endswith(": make export SCENE=a")
    assert targets.verdicts([], results=tmp_path, export="make export SCENE=a") == []


@pytest.mark.parametrize(
    ("keys", "can"),
    [
        ("renders: r, cameras: c", True),
        ("renders: r, cameras: c, splits: [train]", True),
        ("renders: r, cameras: c, splits: [test]", False),
        ("renders: r", False),
    ],
)
def test_of_judged_renders_only_some_are_put_right(here, runs, capsys, keys, can):
    """Snakemake would make nothing, and call that done."""
    scene = f"source: external_renders, path: p, external_renders: {{{keys}}}"
    text = f"scenes: {{a: {{{scene}}}}}\n"
    (here / "results" / "a.yaml").write_text(text)
    assert faults.exit_code(export.main, ["a"]) == (0 if can else 1)
    assert bool(runs) == can
    assert can or "nothing to export" in capsys.readouterr().err


@pytest.mark.parametrize("source", ["[a]", "{a: 1}", "5"])
def test_what_is_wrong_with_a_source_is_said_by_the_run(here, runs, source):
    (here / "results" / "a.yaml").write_text(f"scenes: {{a: {{source: {source}}}}}\n")
    export.main(["a"])
    assert runs
