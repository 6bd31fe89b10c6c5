"""`make judge`: renders of another program in, a config and a run out."""

import os

import pytest
import yaml

from alignerf.experiment import check, plan, targets
from alignerf.start import judge
from tests import judged_cases as cases


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty place with photos, cameras and renders of both splits."""
    monkeypatch.chdir(tmp_path)
    cases.project(tmp_path)
    for i, name in enumerate(cases.NAMES):
        split = "test" if i % 4 == 0 else "train"
        (tmp_path / "renders" / split).mkdir(exist_ok=True)
        file = tmp_path / "renders" / f"{name}.png"
        file.rename(tmp_path / "renders" / split / f"{name}.png")
    return tmp_path


@pytest.fixture
def runs(monkeypatch):
    """What would be run: (config's path, targets, forced rules)."""
    made = []

    def run(path, cores, *names, overrides=(), forced=()):
        made.append((str(path), names, forced))
        return 0

    monkeypatch.setattr(judge.workflow, "run", run)
    return made


def options(**changes):
    chosen = {"photos": "photos", "renders": "renders", "cameras": "transforms.json"}
    return [f"--{key}={value}" for key, value in (chosen | changes).items()]


def test_the_config_can_be_run(here, runs, capsys):
    judge.main(options(name="mine"))
    assert runs == [("results/mine.yaml", ("all",), ())]
    config = yaml.safe_load((here / "results/mine.yaml").read_text())
    assert config["scenes"]["mine"]["judged"]["splits"] == ["train", "test"]
    checked = check.checked(config)
    experiment = plan.Experiment(checked, lambda **place: False)
    assert experiment.splits("mine", "theirs/round0") == ["train", "test"]
    wanted = targets.of_scene(experiment, "mine")
    assert not any("metrics" in path or "scores" in path for path in wanted)
    assert "results/mine/index.html" in wanted
    what = "results/mine/theirs/export"
    assert targets.exports(experiment) == [f"{what}/cameras", f"{what}/photos"]
    assert (
        "8 pairs of photo and render, named like the photos" in capsys.readouterr().out
    )


def test_splits_are_those_that_there_are(here, runs):
    judge.main(options(name="mine", renders="renders/train"))
    config = yaml.safe_load((here / "results/mine.yaml").read_text())
    assert config["scenes"]["mine"]["judged"]["splits"] == ["train"]


def test_without_cameras_there_is_no_export(here, runs):
    judge.main([*options(name="mine")[:2], "--name=mine"])
    config = yaml.safe_load((here / "results/mine.yaml").read_text())
    assert "cameras" not in config["scenes"]["mine"]["judged"]
    experiment = plan.Experiment(check.checked(config), lambda **place: False)
    assert targets.exports(experiment) == []


def test_large_pairs_are_compared_faster(here, runs, monkeypatch):
    monkeypatch.setattr(judge, "MOST_PIXELS", 1000)
    judge.main(options(name="mine"))
    config = yaml.safe_load((here / "results/mine.yaml").read_text())
    assert config["flow"] == {"estimator": "dis_fine", "blur_by": "dis_fast"}


def test_newer_renders_are_judged_anew(here, runs):
    """In the same folder, as after another training."""
    made = here / "results" / "mine" / "poses.json"
    made.parent.mkdir(parents=True)
    made.write_text("{}")
    judge.main(options(name="mine"))
    assert runs[-1][2] == ()
    render = here / "renders" / "train" / "v01.png"
    cases.write_png(render, cases.picture(77))
    os.utime(made, (1, 1))
    judge.main(options(name="mine"))
    assert runs[-1][2] == ("poses",)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"photos": ""}, "PHOTOS is missing"),
        ({"renders": ""}, "RENDERS is missing"),
        ({"renders": "gone"}, "gone: no folder of renders"),
        ({"cameras": "gone"}, "gone: no such file or folder of cameras"),
        ({"photos": "gone"}, "gone: no folder of photos"),
    ],
)
def test_what_is_missing_is_named(here, runs, changes, says):
    with pytest.raises(ValueError, match=says):
        judge.main(options(**changes))
    assert not runs
    assert not (here / "results").exists()


@pytest.mark.parametrize(
    ("target", "names", "words"),
    [
        (
            "judge",
            ("PHOTOS=my photos", "RENDERS=a$(shell touch x)b", "CAMERAS=c;touch x"),
            ("--photos=my photos", "--renders=a$(shell touch x)b", "c;touch x"),
        ),
        ("photos", ("FOLDER=a$(shell touch x)b`touch x`",), ("a$(shell touch x)b`",)),
        (
            "export",
            ("SCENE=my photos", "WIDTH=$(shell touch x)"),
            ("my photos", "--width=$(shell touch x)"),
        ),
    ],
)
def test_make_hands_on_values_as_they_are(handed_on, tmp_path, target, names, words):
    """Neither make nor a shell reads what stands in a name."""
    told = handed_on(target, *names)
    for word in words:
        assert word in told
    assert not (tmp_path / "x").exists()
