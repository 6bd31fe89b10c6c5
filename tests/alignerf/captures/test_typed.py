"""What is typed for a folder means a capture, or is refused with what to type."""

import os
import re

import pytest

from alignerf.captures import typed

SPLAT = b"ply\nformat binary_little_endian 1.0\nproperty float f_dc_0\nend_header\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def fill(here, *names, content=b""):
    for name in names:
        path = here / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


PROJECT = ("scan/images/a.jpg", "scan/sparse/0/cameras.bin", "scan/sparse/0/images.bin")
DEEP = ("export/2024-01-01/scan/images/a.jpg", "export/2024-01-01/scan/transforms.json")


@pytest.mark.parametrize(
    ("names", "given", "meant"),
    [
        (PROJECT, "scan/sparse/0", "scan"),
        (PROJECT, "scan/sparse/", "scan"),
        (PROJECT, "scan/sparse/0/cameras.bin", "scan"),
        (PROJECT, "scan", "scan"),
        ((*PROJECT, "scan/database.db"), "scan/database.db", "scan"),
        (("scan/a.jpg", "scan/database.db"), "scan/database.db", "scan"),
        (("scan/transforms.json", "scan/a.jpg"), "scan/transforms.json", "scan"),
        (("my scan/a.jpg",), "my scan/a.jpg", "my scan"),
        ((*PROJECT, "scan/sparse/0/points.ply"), "scan/sparse/0/points.ply", "scan"),
        (("my scan/a.jpg",), "my scan/*.jpg", "my scan"),
        (("scan/walk.mp4",), "scan/walk.mp4", "scan/walk.mp4"),
        (("scan.zip", "scan/a.jpg"), "scan.zip", "scan"),
        (DEEP, "export", "export/2024-01-01/scan"),
        (("__MACOSX/scan/._a.jpg", *DEEP), "export", "export/2024-01-01/scan"),
        # Several, of which a config has a scene each.
        (("all/one/a.jpg", "all/two/a.jpg"), "all", "all"),
        (("my scan/a.jpg",), "'my scan/'", "my scan"),
        (("my scan/a.jpg",), r"my\ scan", "my scan"),
        (("data/scan/a.jpg",), r"data\scan", "data/scan"),
        # A name that begins and ends with quotes is a name.
        (("'scan'/a.jpg", "scan/a.jpg"), "'scan'", "'scan'"),
        # What a project has trained lies in it, and the other way round.
        ((*PROJECT, "scan/point_cloud/x.ply"), "scan", "scan"),
        (("work/ckpts/a.pt", "work/mine/a.jpg"), "work/mine", "work/mine"),
    ],
)
def test_a_path_means_its_capture(here, names, given, meant):
    fill(here, *names)
    assert typed.meant(given) == typed.Path(meant)


def test_a_file_manager_s_address_and_a_home_are_paths(here, monkeypatch):
    fill(here, "my scan/a.jpg")
    monkeypatch.setenv("HOME", str(here))
    addressed = f"file://{here}/my%20scan"
    assert typed.meant(addressed) == typed.meant("~/my scan") == here / "my scan"


MODEL = "out/point_cloud/iteration_{}/point_cloud.ply".format
JUDGE = "make judge PHOTOS=scan SPLAT=out/point_cloud/iteration_30000/point_cloud.ply"


@pytest.mark.parametrize(
    "given",
    ["out", "out/cfg_args", "out/point_cloud", "out/cameras.json", MODEL(30000)],
)
def test_a_trained_splat_is_judged_with_its_own_paths(here, given):
    fill(here, *PROJECT, "out/cameras.json", "out/train/ours_30000/renders/0.png")
    fill(here, MODEL(7000), MODEL(30000), content=SPLAT)
    noted = b"Namespace(eval=True, source_path='scan', images='images')"
    fill(here, "out/cfg_args", content=noted)
    with pytest.raises(ValueError, match=f"`{JUDGE} CAMERAS=out/cameras.json`"):
        typed.meant(given)
    assert str(typed.judged("SPLAT", "out")) == MODEL(30000)


@pytest.mark.parametrize(
    ("names", "given", "said"),
    [
        (("a/My Scan.zip",), "a", "`unzip 'a/My Scan.zip' -d 'a/My Scan'`"),
        (("Scan.zip",), "Scan.zip", "`unzip Scan.zip -d Scan`, then `make photos F"),
        (("Scan.tar.gz",), "Scan.tar.gz", "`mkdir Scan && tar -xf Scan.tar.gz -C Sc"),
        (("Scan.7z",), "Scan.7z", "unpack it first: into Scan, then `make photos"),
        (("model/cameras.txt",), "model", "model: COLMAP's model, without its photos"),
        (("x/database.db",), "x/database.db", "neither a photo nor a video"),
        (("notes.txt", "a.jpg"), "notes.txt", "neither a photo nor a video"),
        (
            ("o/x/splatfacto/now/nerfstudio_models/a",),
            "o",
            "RENDERS=o/x/splatfacto/now",
        ),
        (("points.ply",), "points.ply", "neither a photo nor a video"),
        ((), "https://x.org/scan.zip", "an address: download it first"),
        (("s.spz",), "s.spz", "a packed splat: export it as .ply"),
        (("ours/test/ours_7000/gt/0.png",), "ours", "`make judge PHOTOS=photos REND"),
        ((*DEEP, "export/b/c/a.jpg"), "export", "several captures are below, give on"),
        (("my_scan/a.jpg",), "myscan", "myscan does not exist: my_scan does"),
        ((), "C:\\Users\\me\\scan", "a path of Windows, and this system is none"),
        ((), "  ", "does not exist"),
    ],
)
def test_what_is_no_capture_is_refused_with_what_to_type(here, names, given, said):
    fill(here, *names)
    with pytest.raises(ValueError, match=re.escape(said)):
        typed.meant(given)


def test_what_is_neither_file_nor_folder_is_not_read(here):
    os.mkfifo("pipe")
    os.symlink("nowhere", "dead")
    with pytest.raises(ValueError, match="pipe: neither a folder nor a file"):
        typed.meant("pipe")
    with pytest.raises(ValueError, match=r"^dead does not exist$"):
        typed.meant("dead")


def test_a_command_is_that_of_the_user(here, monkeypatch):
    fill(here, "Scan.zip")
    monkeypatch.setenv("ALIGNERF_TYPED", "1")
    with pytest.raises(ValueError, match="then `why-blurry poses Scan`"):
        typed.meant("Scan.zip", "poses")
    with pytest.raises(ValueError, match="then `why-blurry judge --renders Scan "):
        typed.judged("RENDERS", "Scan.zip")


@pytest.mark.parametrize(
    ("key", "given", "meant"),
    [
        ("PHOTOS", "scan/images/a.jpg", "scan/images"),
        ("PHOTOS", "scan/sparse/0", "scan"),
        ("PHOTOS", "scan/sparse/0/images.bin", "scan"),
        ("PHOTOS", "deep", "deep/scan/input"),
        ("PHOTOS", "scan", "scan"),
        ("RENDERS", "renders/a.png", "renders"),
        ("CAMERAS", "scan/sparse/0", "scan/sparse/0"),
    ],
)
def test_paths_of_a_judgement_mean_folders(here, key, given, meant):
    fill(here, *PROJECT, "renders/a.png", "deep/scan/input/a.jpg")
    assert typed.judged(key, given) == typed.Path(meant)


def test_a_splat_is_no_folder_of_renders(here):
    fill(here, "splat.ply", content=SPLAT)
    with pytest.raises(ValueError, match=r"splat\.ply: a splat, .*give it as SPLAT"):
        typed.judged("RENDERS", "splat.ply")
