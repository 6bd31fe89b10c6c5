"""`make judge`: renders of another program in, a config and a run out."""

import json
import os

import numpy as np
import pytest
import yaml

from alignerf.cli import configs, judge, light
from alignerf.experiment import check, plan, targets
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import owned, provenance
from alignerf.judged import camera_files, originals, views
from tests import judged_cases as cases
from tests import step_cases

KINDS = ("cameras", "photos")


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
    """What would be run: (config's path, targets)."""
    made = []

    def run(path, cores, *names):
        made.append((str(path), names))
        return 0

    monkeypatch.setattr(judge.workflow, "run", run)
    return made


def options(**changes):
    chosen = {"photos": "photos", "renders": "renders", "cameras": "transforms.json"}
    return [f"--{key}={value}" for key, value in (chosen | changes).items()]


def test_the_config_can_be_run(here, runs, capsys):
    judge.main(options(name="mine"))
    assert runs == [("results/mine.yaml", ("all",))]
    config = yaml.safe_load((here / "results/mine.yaml").read_text())
    assert config["scenes"]["mine"]["external_renders"]["splits"] == ["train", "test"]
    checked = check.checked(config)
    experiment = plan.Experiment(checked)
    assert experiment.splits("mine", "theirs/round0") == ["train", "test"]
    wanted = targets.of_scene(experiment, "mine")
    assert not any("metrics" in path or "scores" in path for path in wanted)
    assert "results/mine/index.html" in wanted
    what = "results/mine/theirs/export"
    assert targets.exports(experiment) == [f"{what}/cameras", f"{what}/photos"]
    words = {
        what: step_cases.options(
            "export_folder", experiment, "mine", method="theirs", what=what
        )
        for what in KINDS
    }
    # Held-out cameras are fitted by the flow of the renders before these were moved.
    assert "corrected-by" in words["cameras"]
    # Bundle-adjusted ones are taken instead where held-out matches accept them.
    adjusted = "results/mine/images/adjusted/cameras.npz"
    assert words["cameras"]["adjusted"] == adjusted
    assert not {"adjusted", "fit-held-out"} & words["photos"].keys()
    assert (
        "8 pairs of photo and render, named like the photos" in capsys.readouterr().out
    )


def test_splits_are_those_that_there_are(here, runs):
    judge.main(options(name="mine", renders="renders/train"))
    config = yaml.safe_load((here / "results/mine.yaml").read_text())
    assert config["scenes"]["mine"]["external_renders"]["splits"] == ["train"]


def test_without_cameras_there_is_no_export(here, runs):
    judge.main([*options(name="mine")[:2], "--name=mine"])
    config = yaml.safe_load((here / "results/mine.yaml").read_text())
    assert "cameras" not in config["scenes"]["mine"]["external_renders"]
    experiment = plan.Experiment(check.checked(config))
    assert targets.exports(experiment) == []


def test_large_pairs_are_compared_faster(here, runs, monkeypatch):
    monkeypatch.setattr(judge, "MAX_PIXELS", 1000)
    judge.main(options(name="mine"))
    config = yaml.safe_load((here / "results/mine.yaml").read_text())
    assert config["flow"] == {"estimator": "dis_fine", "blur_by": "dis_fast"}


def made(config, results):
    """Results of a config, as far as its files are noted in them; its scene."""
    owned.claim(results)
    (results / "images").mkdir(exist_ok=True)
    (scene,) = yaml.safe_load(config.read_text())["scenes"].values()
    scene = of_scenes.checked(scene)
    found = views.find(scene)
    originals.write(results, views.files_of(found, scene.external_renders))
    return scene


@pytest.fixture
def digest(here, runs):
    """The digest of a judgement's files, whose results are there."""
    (here / "depth").mkdir()
    for name in cases.NAMES:
        np.save(here / "depth" / f"{name}.npy", np.ones((120, 160)))
    judge.main(options(name="mine", depth="depth"))
    results = here / "results/mine"
    scene = made(here / "results/mine.yaml", results)
    return lambda: light.opened(scene, results)


@pytest.mark.parametrize(
    "changed", ["depth/v02.npy", "transforms.json", "renders/train/v02.png"]
)
def test_files_in_folders_are_looked_at(here, digest, changed):
    """Snakemake looks at the time of a folder alone; an equal copy is no change."""
    path, before = here / changed, digest()
    os.utime(path)
    assert digest() == before
    if path.suffix == ".npy":
        np.save(path, np.full((120, 160), 2.0))
    elif path.suffix == ".json":
        path.write_text(path.read_text() + " ")
    else:
        cases.write_png(path, cases.picture(77))
    os.utime(path, (1, 1))
    assert digest() != before


def test_a_render_taken_away_or_added_is_seen(here, digest):
    render, before = here / "renders" / "train" / "v01.png", digest()
    content = render.read_bytes()
    render.unlink()
    assert digest() != before
    render.write_bytes(content)
    assert digest() == before


def test_a_model_in_a_folder_is_looked_at(tmp_path):
    """Of a folder of cameras those files that are read."""
    model = tmp_path / "sparse" / "0"
    model.mkdir(parents=True)
    for name in ("cameras.bin", "images.bin", "points3D.bin", "project.ini"):
        (model / name).write_text("")
    found = {path.name for path in camera_files.files_of(tmp_path)}
    assert found == {"cameras.bin", "images.bin", "points3D.bin"}
    assert camera_files.files_of(None) == []


def test_a_kept_config_of_other_renders_is_no_answer(here, runs):
    """What was asked is not judged by it, so that is said."""
    judge.main(options(name="mine"))
    path = here / "results" / "mine.yaml"
    path.write_text(path.read_text() + "seed: 3\n")
    judge.main(options(name="mine"))
    (here / "renders").rename(here / "again")
    with pytest.raises(ValueError, match=r"is of renders, not of again.*--name"):
        judge.main(options(name="mine", renders="again"))
    assert len(runs) == 2


@pytest.mark.usefixtures("ten_seconds")
@pytest.mark.parametrize("config", [None, b"seed: \xe4\n"])
def test_a_config_that_is_no_text_is_named(here, runs, config):
    """Nor is a pipe waited for."""
    (here / "results").mkdir()
    path = here / "results" / "mine.yaml"
    os.mkfifo(path) if config is None else path.write_bytes(config)
    says = "not UTF-8" if config else "not a file"
    with pytest.raises(ValueError, match=rf"results/mine\.yaml: {says}"):
        judge.main(options(name="mine"))
    assert not runs


def test_other_photos_of_one_name_are_told_how_to_go_on(here, runs):
    judge.main(options(name="mine"))
    (here / "photos").rename(here / "others")
    with pytest.raises(ValueError, match=r"make judge .*OPTIONS=\"--name other\""):
        judge.main(options(name="mine", photos="others"))


@pytest.mark.parametrize(
    ("before", "says"),
    [("mine", "replace what was there"), ("gone", "gone/verdict.json does not exist")],
)
def test_what_it_is_compared_with_is_another_judgement(here, runs, before, says):
    (here / "results" / "mine").mkdir(parents=True)
    (here / "results" / "mine" / "verdict.json").write_text("{}")
    with pytest.raises(ValueError, match=says):
        judge.main([*options(name="mine"), f"--before={before}"])
    assert not runs
    assert not (here / "results" / "mine.yaml").exists()


def test_a_config_cannot_compare_a_verdict_with_itself(here, runs):
    """Snakemake would take it away first."""
    owned.claim(here / "results" / "mine")
    (here / "results" / "mine" / "verdict.json").write_text("{}")
    judge.main(options(name="mine"))
    config = yaml.safe_load((here / "results/mine.yaml").read_text())
    config["scenes"]["mine"]["external_renders"]["before"] = "results/mine/verdict.json"
    with pytest.raises(
        ValueError, match=r"external_renders\.before: .* lies in results/mine, "
    ):
        check.checked(config)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"photos": ""}, "PHOTOS is missing"),
        ({"renders": ""}, "RENDERS is missing"),
        ({"renders": "render"}, "RENDERS: render does not exist: renders does"),
        ({"cameras": "gone"}, "CAMERAS: gone does not exist$"),
        ({"photos": "foto"}, "PHOTOS: foto does not exist: photos does"),
        ({"depth": "gone"}, "DEPTH: gone does not exist$"),
        ({"renders": "", "splat": "a.spz"}, "SPLAT: a.spz does not exist$"),
        ({"size": "500"}, "--size: goes with SPLAT alone"),
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
        ("judge", ("PHOTOS=p", "OPTIONS=--name x"), ("--photos=p", "'--name', 'x'")),
        ("judge", ("JUDGE=--name x",), ("'--name', 'x'",)),
        ("photos", ("PHOTOS=p", "OPTIONS=--only-config"), ("--only-config", "'p'")),
        ("photos", ("FOLDER=a$(shell touch x)b`touch x`",), ("a$(shell touch x)b`",)),
        (
            "export",
            ("SCENE=my photos", "WIDTH=$(shell touch x)"),
            ("my photos", "--width=$(shell touch x)"),
        ),
        ("table1", ("OPTIONS=-n --config small=false",), ("=false', '--', 'table1']",)),
        (
            "table3",
            ("SCENE=fox small", "CONFIG=my $(shell touch x).yaml"),
            ("'my $(shell touch x).yaml', '--', 'table3', 'fox small']",),
        ),
    ],
)
def test_make_hands_on_values_as_they_are(handed_on, tmp_path, target, names, words):
    """Neither make nor a shell reads what stands in a name."""
    told = handed_on(target, *names)
    for word in words:
        assert word in told
    assert not (tmp_path / "x").exists()


def judged(here, name):
    """The results of a judgement of this name, as far as later ones look at them."""
    config, results = here / "results" / f"{name}.yaml", here / "results" / name
    made(config, results)
    (results / "config.yaml").write_text(config.read_text())
    evidence = {"photo_px": 1.0, "flow_train_px": 0.2, "flow_test_px": None}
    (results / "verdict.json").write_text(json.dumps({"evidence": evidence}))


def keys_of(here, name):
    config = yaml.safe_load((here / "results" / f"{name}.yaml").read_text())
    return config["scenes"][name]["external_renders"]


def test_a_second_model_of_the_same_photos_is_set_beside_the_first(here, runs, capsys):
    """Every program calls its folder `renders`: names are of photos and model."""
    name = judge.folders.name_of(here)
    judge.main(options())
    assert runs.pop()[0] == f"results/{name}.yaml"
    judged(here, name)
    # The same once more goes on.
    judge.main(options())
    assert runs.pop()[0] == f"results/{name}.yaml"
    (here / "sharper").mkdir()
    (here / "renders").rename(here / "sharper" / "renders")
    judge.main(options(renders="sharper/renders"))
    assert runs.pop()[0] == f"results/{name}_sharper.yaml"
    assert keys_of(here, f"{name}_sharper")["before"] == f"results/{name}/verdict.json"
    assert f"compared with results/{name} " in capsys.readouterr().out
    judged(here, f"{name}_sharper")
    # Rendered anew in the same place.
    cases.write_png(here / "sharper/renders/train/v02.png", cases.picture(77))
    judge.main(options(renders="sharper/renders"))
    assert runs.pop()[0] == f"results/{name}_sharper_2.yaml"
    before = f"results/{name}_sharper/verdict.json"
    assert keys_of(here, f"{name}_sharper_2")["before"] == before
    judge.main([*options(renders="sharper/renders", name="alone"), "--before=none"])
    assert "before" not in keys_of(here, "alone")


def test_what_is_judged_again_is_compared_with_what_it_was(here, runs):
    """Not with those after it."""
    name = judge.folders.name_of(here)
    judge.main(options())
    judged(here, name)
    judge.main([*options(name="later")])
    judged(here, "later")
    judge.main(options())
    assert "before" not in keys_of(here, name)


def test_held_out_views_are_said_in_words(here, runs, capsys):
    for file in sorted((here / "renders").rglob("*.png")):
        file.rename(here / "renders" / file.name)
    judge.main(options(name="mine"))
    assert keys_of(here, "mine")["splits"] == ["train"]
    assert "no file says which photos were held out" in capsys.readouterr().out
    judge.main([*options(name="said"), "--held-out=every=4"])
    assert keys_of(here, "said")["splits"] == ["train", "test"]
    assert "2 of 8 were held out: one in 4 by name" in capsys.readouterr().out
    scene = yaml.safe_load((here / "results/said.yaml").read_text())["scenes"]["said"]
    found = views.splits_of(views.find(of_scenes.checked(scene)))
    assert [name for name, split in found.items() if split == "test"] == ["v00", "v04"]


@pytest.mark.parametrize("text", ["8", "every=1", "each=8", "every=x"])
def test_held_out_views_in_other_words_are_refused(here, text):
    with pytest.raises(SystemExit):
        judge.main([*options(name="mine"), f"--held-out={text}"])


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("config.yaml", "x: ["),
        ("config.yaml", "scenes: {old: {external_renders: x}}"),
        ("config.yaml", "scenes: {old: {path: 5, source: external_renders}}"),
        ("verdict.json", '{"evi'),
        ("verdict.json", '{"evidence": {}}'),
    ],
)
def test_broken_results_of_before_stop_nothing(here, runs, file, content):
    judge.main(options(name="old"))
    judged(here, "old")
    (here / "results/old" / file).write_text(content)
    judge.main(options(name="new"))
    assert "before" not in keys_of(here, "new")


def test_what_it_was_compared_with_may_be_gone(here, runs):
    judge.main(options(name="old"))
    judged(here, "old")
    judge.main(options(name="new"))
    assert keys_of(here, "new")["before"] == "results/old/verdict.json"
    for path in ("verdict.json", "config.yaml"):
        (here / "results/old" / path).unlink()
    judge.main(options(name="new"))
    assert "before" not in keys_of(here, "new")


def test_held_out_views_that_a_users_config_has_otherwise_are_refused(here, runs):
    judge.main(options(name="mine"))
    path = here / "results" / "mine.yaml"
    path.write_text(path.read_text() + "seed: 3\n")
    with pytest.raises(ValueError, match=r"--held-out: you edited results/mine\.yaml"):
        judge.main([*options(name="mine"), "--held-out=every=4"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["--photos=a b", "--splat=x.ply", "--held-out=every=8"],
            "make judge PHOTOS='a b' SPLAT=x.ply OPTIONS=\"--held-out every=8\"",
        ),
        (["--photos=/home/me/a", "--renders=r"], "make judge PHOTOS=a RENDERS=r"),
        (
            ["--photos=a", "--renders=r", "--before=none"],
            'make judge PHOTOS=a RENDERS=r OPTIONS="--before none"',
        ),
    ],
)
def test_the_command_is_kept_as_it_was_typed_without_a_user_s_folders(
    monkeypatch, words, said
):
    monkeypatch.setenv(provenance.COMMAND, "")
    monkeypatch.delenv(provenance.TYPED, raising=False)
    configs.remember("judge", judge.parse(words))
    assert os.environ[provenance.COMMAND] == said
