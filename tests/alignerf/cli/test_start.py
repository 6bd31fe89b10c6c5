"""From a folder to a config that runs, whatever lies in the folder."""

import os

import pytest
import yaml

from alignerf.cli import __main__ as start
from alignerf.cli import folders, workflow
from alignerf.experiment import check
from alignerf.io import owned


def fill(folder, *names):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")
    return folder


@pytest.mark.parametrize(
    ("names", "source", "below"),
    [
        (["a.JPG", "b.heic", "notes.txt"], "photos", "."),
        (["walk.mov"], "photos", "."),
        (["images/a.png", "masks/a.png.png"], "photos", "images"),
        (["images/a.png", "transforms.json"], "transforms", "."),
        (["transforms_train.json", "transforms_test.json"], "blender", "."),
        (["images/a.png", "sparse/0/cameras.bin"], "mipnerf360", "."),
        # 360_v2 has both.
        (["sparse/0/cameras.bin", "poses_bounds.npy"], "mipnerf360", "."),
        (["images/a.png", "poses_bounds.npy"], "llff", "."),
    ],
)
def test_names_tell_what_a_folder_is(tmp_path, names, source, below):
    folder = fill(tmp_path / "my scene", *names)
    (name, scene), *rest = folders.scenes_of(folder).items()
    assert (name, rest) == ("my_scene", [])
    masks = {"masks": str(folder / "masks")} if "masks/a.png.png" in names else {}
    assert scene == {"source": source, "path": str(folder / below), **masks}


def test_a_film_alone_and_a_folder_of_scenes(tmp_path):
    fill(
        tmp_path,
        "a/1.jpg",
        "b c/2.jpg",
        "films/walk.mp4",
        "empty/notes.txt",
        ".d/1.jpg",
    )
    found = folders.scenes_of(tmp_path)
    assert list(found) == ["a", "b_c", "films"]
    film = folders.scenes_of(tmp_path / "films/walk.mp4")
    assert film == {
        "walk": {"source": "photos", "path": str(tmp_path / "films/walk.mp4")}
    }


def test_two_scenes_of_one_name_are_refused(tmp_path):
    fill(tmp_path, "a b/1.jpg", "a_b/2.jpg")
    with pytest.raises(ValueError, match="another scene is called a_b"):
        folders.scenes_of(tmp_path)


@pytest.mark.parametrize("names", [[], ["notes.txt"], ["deep/deeper/a.jpg"]])
def test_a_folder_without_photos_says_what_was_looked_for(tmp_path, names):
    fill(tmp_path, *names)
    with pytest.raises(ValueError, match=r"no photos \(.*\.heic.*videos \(.*\.mp4"):
        folders.scenes_of(tmp_path)
    with pytest.raises(ValueError, match="nowhere does not exist"):
        folders.scenes_of(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("train", "train_photos"),
        ("all", "all_photos"),
        ("published", "published_photos"),
        ("torture", "torture_photos"),
        ("--x", "x"),
        ("Größe 3", "Gr_e_3"),
        ("é", "photos"),
        ("ab" + "a" * 200, "ab" + "a" * 58 + "_photos"),
        ("a" * 21, "a" * 21 + "_photos"),
        ("abc" * 40, "abc" * 20 + "_photos"),
        ("abcdefgh" * 9, "abcdefgh" * 7 + "abcd"),
    ],
)
def test_a_name_is_one_that_files_and_rules_can_have(tmp_path, name, expected):
    assert folders.name_of(tmp_path / name) == expected


@pytest.mark.parametrize(
    "name",
    ["007", "1e3", "null", "true", "on", "0x1f", "1_000", "NaN", "a" * 40, "torture"],
)
def test_a_name_that_is_offered_is_taken_and_read_back(here, name):
    fill(here, f"{name}/a.jpg")
    offered = folders.name_of(here / name)
    start.main([name, "--only-config"])
    assert next(iter(config_at(here / f"results/{offered}.yaml").scenes)) == offered


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def config_at(path):
    return check.checked(yaml.safe_load(path.read_text()))


def test_the_config_is_one_that_can_be_run(here, capsys):
    fill(here, "my\nph\x01otos/a.jpg")
    start.main(["my\nph\x01otos", "--only-config", "--background", "white"])
    config = config_at(here / "results/my_ph_otos.yaml")
    assert config.decide
    # Plain, and with cameras corrected; rounds and AligNeRF where a user asks for them.
    methods = config.methods
    found = [(m.rounds, m.auto) for m in methods.values()]
    assert found == [(0, False), (0, True)]
    assert not any(method.alignerf for method in methods.values())
    assert config.scenes["my_ph_otos"].background == "white"
    assert "results/my_ph_otos/index.html" in capsys.readouterr().out


def test_too_few_photos_are_said_where_only_the_config_is_written(here, caplog):
    fill(here, "p/a.png")
    start.main(["p", "--only-config"])
    assert "p: 1 photo is too few: take 20 or more" in caplog.text
    assert (here / "results/p.yaml").is_file()


def test_what_was_forgotten_is_said_the_next_time(here):
    fill(here, "p/a.png")
    start.main(["p", "--only-config"])
    start.main(["p", "--only-config", "--background", "black", "--budget-min", "5"])
    config = config_at(here / "results/p.yaml")
    assert config.scenes["p"].background == "black"
    assert config.training.budget_min == 5


def test_what_a_user_changed_stays_and_is_said(here, caplog):
    fill(here, "p/a.png")
    start.main(["p", "--only-config"])
    path = here / "results/p.yaml"
    path.write_text(path.read_text() + "training: {steps: 7}\n")
    start.main(["p", "--only-config", "--budget-min", "5"])
    assert yaml.safe_load(path.read_text())["training"] == {"steps": 7}
    assert "you edited it: its training.budget_min is kept" in caplog.text


def test_results_of_two_folders_of_one_name_are_not_mixed(here):
    fill(here, "a/photos/1.jpg", "b/photos/1.jpg")
    start.main(["a/photos", "--only-config"])
    with pytest.raises(ValueError, match=r"scene photos is of a/photos.*--name other"):
        start.main(["b/photos", "--only-config"])
    start.main(["b/photos", "--only-config", "--name", "other"])
    config = config_at(here / "results/other.yaml")
    assert config.scenes["other"].path == "b/photos"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", ""),
        ("", ": not a config"),
        ("[1, 2]\n", ": not a config"),
        ("scenes: [p]\n", ": no scenes"),
        ("decide: true\n", ": no scenes"),
        ("scenes: {p: {path: 3}}\n", r": scenes\.p\.path: 3 is no path"),
        ('scenes: {p: {path: "a\\0"}}\n', r": scenes\.p\.path: .* is no path"),
        ("scenes: {p: {path: loop}}\n", ": scene p is of loop"),
        (b"scenes: \xe4\n", ""),
    ],
)
def test_a_config_that_cannot_be_read_is_named(here, text, reason):
    fill(here, "p/a.png", "results/p.yaml")
    (here / "loop").symlink_to("loop")
    text = text if isinstance(text, bytes) else text.encode()
    (here / "results/p.yaml").write_bytes(text)
    with pytest.raises(ValueError, match=rf"results/p\.yaml{reason}"):
        start.main(["p", "--only-config"])
    assert (here / "results/p.yaml").read_bytes() == text


def test_a_pipe_in_the_config_s_place_is_not_waited_for(here):
    fill(here, "p/a.png", "results/.there")
    os.mkfifo(here / "results/p.yaml")
    with pytest.raises(ValueError, match=r"results/p\.yaml: not a file"):
        start.main(["p", "--only-config"])


@pytest.mark.parametrize("minutes", ["0", "-1", "nan", "inf", "x"])
def test_a_budget_that_is_none_is_refused(here, minutes, capsys):
    fill(here, "p/a.png")
    with pytest.raises(SystemExit):
        start.main(["p", "--only-config", f"--budget-min={minutes}"])
    assert "--budget-min" in capsys.readouterr().err
    assert not (here / "results").exists()


def test_a_home_that_nobody_has_is_a_folder_that_is_not_there(here):
    with pytest.raises(ValueError, match="~nobody_here/a does not exist"):
        start.main(["~nobody_here/a"])


def test_its_exit_code_is_that_of_the_run(here, monkeypatch):
    fill(here, "p/a.jpg", "p/b.jpg", "p/c.jpg")
    asked = {}

    def run(path, cores, *wanted, **more):
        asked.update(more, wanted=wanted)
        return 3 * ("all" in wanted)

    monkeypatch.setattr(workflow, "run", run)
    with pytest.raises(SystemExit) as stopped:
        start.main(["p"])
    assert stopped.value.code == 3
    assert asked.pop("forced") == []
    # Files for other programs take long: nobody waits for them to see the page.
    assert asked == {"wanted": ("all", "export"), "first": ["results/p/index.html"]}
    command = workflow.command_of("p.yaml", 2, asked["wanted"], (), (), asked["first"])
    assert command[command.index("--prioritize") + 1 :] == [
        *asked["first"],
        "--",
        "all",
        "export",
    ]


def test_nothing_is_trained_before_its_plan_is_there(here, monkeypatch):
    """A scene that cannot be planned is left out; who stops a run stops it whole."""
    fill(here, *(f"p/{one}/{i}.jpg" for one in "ab" for i in range(3)))
    runs, codes = [], []

    def run(path, cores, *wanted, **more):
        runs.append(wanted)
        if len(runs) == 1:
            fill(here, "results/a/preflight.json", "results/a/.why-blurry")
        return codes.pop(0)

    monkeypatch.setattr(workflow, "run", run)
    plans = tuple(f"results/{one}/preflight.json" for one in "ab")
    codes[:] = [0, 0]
    start.main(["p"])
    assert runs == [plans, ("all", "export")]
    for code, more in ((1, [("a", "results/a/auto/export/cameras")]), (130, [])):
        runs[:], codes[:] = [], [code, 0]
        with pytest.raises(SystemExit):
            start.main(["p"])
        assert runs == [plans, *more]
    config = here / "results/p.yaml"
    config.write_text(config.read_text() + "preflight: false\n")
    runs[:], codes[:] = [], [0]
    start.main(["p"])
    assert runs == [("all", "export")]


def test_too_few_photos_are_said_before_anything_runs_or_is_written(here, monkeypatch):
    fill(here, "p/a.jpg", "p/b.JPG", "p/notes.txt", "films/a.jpg", "films/walk.mov")
    with pytest.raises(ValueError, match=r"^p: 2 photos are too few: take 20 or more"):
        start.main(["p"])
    # A film gives as many as it is long; others go on beside what has too few.
    monkeypatch.setattr(workflow, "run", lambda *_, **__: 0)
    start.main(["films"])
    start.main([".", "--name", "both"])
    # Cameras that a user's config takes from elsewhere need no COLMAP.
    config = here / "results/p.yaml"
    config.write_text(config.read_text().replace("source: photos", "source: llff"))
    start.main(["p"])


def test_a_live_photo_is_no_film_and_a_folder_no_photo(here):
    fill(here, "p/a.heic", "p/a.mov", "p/b.heic", "p/b.mov", "p/c.jpg/x.txt")
    with pytest.raises(ValueError, match=r"^p: 2 photos are too few"):
        start.main(["p"])


def test_how_long_colmap_takes_is_said_first(here, capsys):
    fill(here, *(f"p/{i}.jpg" for i in range(50)), "q/a.jpg", "q/transforms.json")
    start.main([".", "--name", "both", "--only-config"])
    said = capsys.readouterr().out
    assert "p: COLMAP finds the cameras of 50 photos first, in about 3 min on" in said
    assert "q: COLMAP" not in said
    owned.claim(here / "results/p")
    (here / "results/p/poses.json").write_text("{}")
    start.main([".", "--name", "both", "--only-config"])
    assert "COLMAP" not in capsys.readouterr().out
    minutes = [folders.colmap_min(count) for count in (3, 24, 100, 300, 600)]
    assert minutes == sorted(minutes)
    assert (minutes[0], minutes[-1]) == pytest.approx((2, 2 * 84))


def test_a_missing_folder_is_said():
    with pytest.raises(ValueError, match="make photos FOLDER=my_photos"):
        start.main([""])
