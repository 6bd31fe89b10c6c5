"""Bad input to the whole workflow: one line that names it, nothing half-made."""

import re
from pathlib import Path

import filelock
import pytest
import skimage.data
import yaml
from PIL import Image

from alignerf.experiment.checks import results
from alignerf.io import owned
from tests import forks

NOWHERE = {"source": "photos", "path": "no where"}
TRAIN = {"scenes": {"train": {"source": "courtyard"}}}


def write(folder, config):
    path = folder / "config.yaml"
    path.write_text(yaml.safe_dump(config, sort_keys=False))
    return path


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"training": {"stpes": 5}}, "'stpes'"),
        (TRAIN, "a rule has"),
        (
            {"scenes": {"mine": {"source": "photos", "path": "no where"}}},
            "no where does",
        ),
        ({"scenes": None}, "scenes: None should be a mapping"),
    ],
)
def test_planning_stops_with_one_line(tmp_path, demo, dry_run, change, reason):
    path = write(tmp_path, demo | change)
    code, output = dry_run(tmp_path, "--configfile", path, "-n")
    assert code == 1
    assert output.startswith(f"error: {path.name}: ")
    assert reason in output
    assert len(output.splitlines()) == 1
    assert not (tmp_path / "results").exists()


def test_a_key_that_stands_twice_is_named(tmp_path, demo, dry_run):
    path = write(tmp_path, demo)
    with open(path, "a") as file:
        file.write("seed: 3\nseed: 4\n")
    code, output = dry_run(tmp_path, "--configfile", path, "-n")
    assert code == 1
    assert "key 'seed' stands twice" in output
    assert len(output.splitlines()) == 1


def test_a_target_that_the_config_has_not_is_named(tmp_path, demo, dry_run):
    demo["scenes"]["courtyard"]["budget_min"] = 3
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-n")
    code, output = dry_run(*options, "comparison")
    assert code == 1
    said = "error: config: scenes.courtyard: training has steps, the scene not"
    assert output.splitlines()[-1] == said


def test_a_typo_among_targets_names_the_scenes(tmp_path, dry_run):
    code, output = dry_run(tmp_path, "curtyard", "-n")
    assert code == 1
    assert output.splitlines()[-1] == (
        "error: curtyard: no such scene or target; perhaps 'courtyard'. Scenes of this "
        "config: courtyard. Other targets: snakemake --list-target-rules"
    )
    # A path is a file's.
    assert dry_run(tmp_path, "results/courtyard/poses.json", "-n")[0] == 0


def test_the_list_of_rules_says_what_each_makes(tmp_path, photos_of_tables, dry_run):
    code, output = dry_run(tmp_path, "--list", "-n")
    assert code == 0
    lines = output.splitlines()
    assert [one for one in lines if not re.fullmatch(r"\w+ \([A-Z].*\)", one)] == []
    assert len({one.split("(", 1)[1] for one in lines}) == len(lines) > 25


def test_the_default_profile_loads_by_itself(tmp_path, root, dry_run, monkeypatch):
    """From wherever it is called: it is found beside the Snakefile."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(forks, "PLAIN", ())
    code, output = dry_run(tmp_path, "config", "-n", root=root)
    assert code == 1
    said = f"workflow specific profile {root / 'profiles' / 'default'} for"
    assert said in output.splitlines()[0]


def no_photos(folder):
    """An empty folder of photos."""


def broken_photo(folder):
    three_apart(folder)
    (folder / "b.jpg").write_bytes((folder / "b.jpg").read_bytes()[:2000])


def three_apart(folder):
    """Three photos of different things."""
    for name, image in {
        "a": skimage.data.astronaut(),
        "b": skimage.data.coffee(),
        "c": skimage.data.chelsea(),
    }.items():
        Image.fromarray(image[:240, :320]).save(folder / f"{name}.jpg", quality=90)


@pytest.mark.parametrize(
    ("fill", "reason"),
    [
        (no_photos, "no images in my photos"),
        (broken_photo, "cannot decode my photos/b.jpg"),
        (three_apart, "my photos"),
    ],
)
def test_bad_photos_end_in_one_line(tmp_path, forked, fill, reason):
    (tmp_path / "my photos").mkdir()
    fill(tmp_path / "my photos")
    config = {"scenes": {"mine": {"source": "photos", "path": "my photos"}}}
    options = ("--configfile", write(tmp_path, config), "--cores", "2")
    code, output = forked.snakemake(tmp_path, *options)
    assert code == 1
    assert "Traceback" not in output
    (line,) = {line for line in output.splitlines() if line.startswith("error: ")}
    assert re.search(reason, line)
    # The cause comes last, after all that Snakemake says.
    assert output.splitlines()[-3:-1] == [line, "  in results/mine/logs/poses.log"]
    made = [path for path in (tmp_path / "results").rglob("*") if path.is_file()]
    names = {path.relative_to(tmp_path / "results") for path in made}
    known = {
        owned.MARK,
        "config.yaml",
        "logs/config.log",
        "logs/config.tsv",
        "logs/poses.log",
    }
    assert names <= {Path("mine") / name for name in known}


def test_a_run_waits_for_nobody_who_holds_its_results(tmp_path, forked):
    """As `make judge` does, from this checkout or from another."""
    (tmp_path / "my photos").mkdir()
    config = {"scenes": {"mine": {"source": "photos", "path": "my photos"}}}
    options = ("--configfile", write(tmp_path, config), "--cores", "1")
    (tmp_path / "results").mkdir()
    with filelock.FileLock(tmp_path / results.lock_of("mine")):
        code, output = forked.snakemake(tmp_path, *options)
    assert code == 1
    assert "error: results/mine: another run is at work there" in output
    assert not (tmp_path / "results/mine").exists()


def test_a_file_in_the_place_of_a_folder_is_named(tmp_path, demo, dry_run):
    (tmp_path / "results").touch()
    code, output = dry_run(tmp_path, "--configfile", write(tmp_path, demo), "-n")
    assert (code, len(output.splitlines())) == (1, 1)
    assert output.startswith("error: results: a folder was expected there")
