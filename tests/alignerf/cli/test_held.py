"""One name, one kind of run: what is refused has changed nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from alignerf.cli import __main__ as photos
from alignerf.cli import export, judge, poses, workflow
from alignerf.experiment.checks import results
from alignerf.io import owned
from tests import judged_cases as cases

PHOTOS = ["photos", "--name", "mine"]
JUDGE = ["--photos=photos", "--renders=renders", "--name=mine"]


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with photos and renders; what would run is told."""
    monkeypatch.chdir(tmp_path)
    cases.project(tmp_path)
    monkeypatch.setattr(workflow, "run", lambda *_, **__: 0)
    return tmp_path


def files(folder):
    found = (p for p in folder.rglob("*") if p.is_file() and p.suffix != ".held")
    return {path: path.read_bytes() for path in found}


@pytest.mark.parametrize("first", ["photos", "judge"])
def test_neither_command_takes_the_other_s_name(here, first):
    kinds = {"photos": (photos, PHOTOS), "judge": (judge, JUDGE)}
    (main, words), (other, others) = kinds.pop(first), *kinds.values()
    main.main(words)
    before = files(here / "results")
    with pytest.raises(ValueError, match=r"mine\.yaml: scene mine is of .*--name"):
        other.main(others)
    assert files(here / "results") == before
    main.main(words)


def test_a_config_of_snakemake_s_own_run_counts_too(here):
    """Its results would be replaced, though there is no config beside them."""
    owned.claim(here / "results/mine")
    scene = {
        "source": "external_renders",
        "path": "photos",
        "external_renders": {"renders": "renders"},
    }
    path = here / "results/mine/config.yaml"
    path.write_text(yaml.safe_dump({"scenes": {"mine": scene}}))
    with pytest.raises(
        ValueError, match=r"mine/config\.yaml: scene mine is of renders"
    ):
        photos.main(PHOTOS)
    judge.main(JUDGE)


def test_other_cameras_are_other_inputs_and_more_are_not(here):
    judge.main(JUDGE)
    judge.main([*JUDGE, "--cameras=transforms.json"])
    (here / "other.json").write_bytes((here / "transforms.json").read_bytes())
    with pytest.raises(ValueError, match=r"is of transforms\.json, not of other\.json"):
        judge.main([*JUDGE, "--cameras=other.json"])


def test_inputs_that_are_dropped_are_others(here):
    judge.main([*JUDGE, "--cameras=transforms.json"])
    with pytest.raises(ValueError, match=r"is of transforms\.json, not of no cameras"):
        judge.main(JUDGE)


def test_adjusted_cameras_of_another_folder_stay(here):
    owned.claim(here / "results/mine")
    (here / "results/mine/adjusted").mkdir()
    (here / "results/mine/adjusted/report.json").write_text('{"of": "other"}')
    cases.transforms(here / "photos/transforms.json")
    with pytest.raises(
        ValueError, match=r"report\.json: scene mine is of other, .*--name"
    ):
        poses.main(PHOTOS)


def test_results_of_two_configs_are_not_mixed(here):
    """Of several scenes one may have the name of another config's."""
    (here / "both/mine").mkdir(parents=True)
    for name in ("mine", "more"):
        cases.photos(here / "both" / name)
    photos.main(["both"])
    owned.claim(here / "results/mine")
    scene = {"source": "photos", "path": "photos"}
    (here / "results/mine/config.yaml").write_text(
        yaml.safe_dump({"scenes": {"mine": scene}})
    )
    with pytest.raises(ValueError, match=r"mine/config\.yaml: scene mine is of photos"):
        photos.main(["both"])
    with results.held("mine"), pytest.raises(ValueError, match="results/mine: another"):
        photos.main(["both"])


@pytest.mark.parametrize(
    ("main", "words"),
    [(photos, PHOTOS), (judge, JUDGE), (export, ["mine"]), (poses, PHOTOS)],
)
def test_a_run_beside_another_changes_nothing(here, main, words):
    photos.main(PHOTOS)
    (here / "results/mine.yaml").write_text("scenes: {mine: {path: photos}}\n")
    before = files(here / "results")
    code = "import sys\nfrom alignerf.experiment.checks import results\n"
    code += "with results.held('mine'):\n    print(flush=True)\n    sys.stdin.read()\n"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    (here / "photos/transforms.json").write_bytes(
        (here / "transforms.json").read_bytes()
    )
    root = str(Path(results.__file__).resolve().parents[3])
    environment = os.environ | {"PYTHONPATH": root}
    with subprocess.Popen(
        [sys.executable, "-c", code], env=environment, **pipes
    ) as run:
        run.stdout.readline()
        with pytest.raises(ValueError, match="results/mine: another run is at work"):
            main.main(words)
        # A lock ends with its process, also where that is killed.
        run.kill()
        run.wait()
    assert files(here / "results") == before
    with results.held("mine"), results.held("other"):
        pass


def test_a_child_holds_results_when_its_parent_is_gone(here, monkeypatch):
    """As Snakemake goes on where `make photos` was killed."""
    (here / "results").mkdir()
    monkeypatch.setenv(results.HELD, "999999999:mine")
    with results.held("mine"):
        monkeypatch.delenv(results.HELD)
        with (
            pytest.raises(ValueError, match="results/mine: another run is at work"),
            results.held("mine"),
        ):
            pass
    with results.held("mine"):
        pass
    assert not list((here / "results").iterdir())


def test_checkouts_that_share_results_share_their_locks(here, monkeypatch):
    (here / "other").mkdir()
    (here / "results").mkdir()
    (here / "other/results").symlink_to(here / "results")
    with results.held("mine"):
        monkeypatch.chdir(here / "other")
        with (
            pytest.raises(ValueError, match="results/mine: another run is at work"),
            results.held("mine"),
        ):
            pass


@pytest.mark.parametrize("main", [photos, judge, poses])
def test_a_user_s_folder_in_results_is_left_alone(here, main):
    """Photos there, or others' files under the name of the results."""
    (here / "results").mkdir()
    (here / "photos").rename(here / "results/mine")
    cases.transforms(here / "results/mine/transforms.json")
    words = ["--photos=results/mine", "--renders=renders"]
    words += ["--name=mine"]
    before = files(here)
    says = r"results/mine lies in results/mine|has files, and none is"
    with pytest.raises(ValueError, match=says):
        main.main(words if main is judge else ["results/mine"])
    assert files(here) == before


def test_results_of_crops_have_names_too(here):
    """`make photos` cuts crops: their folders are looked at as well."""
    (here / "results/mine_crops").mkdir(parents=True)
    (here / "results/mine_crops/notes.txt").touch()
    with pytest.raises(ValueError, match="results/mine_crops: has files, and none"):
        photos.main(PHOTOS)
    assert not (here / "results/mine.yaml").exists()
