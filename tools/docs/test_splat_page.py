"""docs/howto/splat.md is followed word by word: its lines are run on small projects.

Of each line that judges, the arguments are taken as they stand on the page, and what
the trainer would have written is put where they say. Trainers themselves are not run.
"""

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from alignerf.cli import judge
from alignerf.judged import camera_files, likeness, splat
from alignerf.splats import ply, rasterize
from tests import judged_cases as cases
from tests import splat_cases

LINE = re.compile(r"^    make judge ((?:.+\\\n)*.+)$", re.MULTILINE)
KINDS = ("ply", "nerfstudio", "3dgs", "again")
SIZE, CAMTOPIX = cases.SIZE, cases.CAMTOPIX


@pytest.fixture
def lines(root):
    """{what judges: its arguments} in the order of the page."""
    page = (root / "docs" / "howto" / "splat.md").read_text()
    found = LINE.findall(page)
    words = [shlex.split(one.replace("\\\n", ""), comments=True) for one in found]
    found = [dict(word.split("=", 1) for word in line) for line in words]
    return dict(zip(KINDS, found, strict=True))


def arguments(words):
    """Those of `judge` that the Makefile makes of a line's words."""
    more = shlex.split(words["OPTIONS"])
    given = {name: value for name, value in words.items() if name != "OPTIONS"}
    return [*(f"--{name.lower()}={value}" for name, value in given.items()), *more]


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder DATA as trainers take it, and a splat that shows its photos."""
    monkeypatch.chdir(tmp_path)
    data = tmp_path / "DATA"
    lens = {"lens": np.zeros(5)}
    cases.transforms(data / "transforms.json", **lens)
    cameras = camera_files.read(data / "transforms.json")
    rng = np.random.default_rng(0)
    table = splat_cases.columns(rng, rest=0, count=3000)
    means = rng.uniform([-3, -3, -6], [4, 3, -4], (3000, 3))
    table |= dict(zip("xyz", means.T, strict=True))
    table |= {f"scale_{i}": np.full(3000, np.log(0.05)) for i in range(3)}
    table["opacity"] = np.full(3000, 4.0)
    gaussians = ply.read(splat_cases.write(tmp_path / "point_cloud.ply", table))
    for own in cameras.shots:
        at = rasterize.Camera(
            splat.world_to_camera(own.pose, np.eye(4)),
            *(CAMTOPIX[0, 0], CAMTOPIX[1, 1], *CAMTOPIX[:2, 2]),
            *SIZE,
        )
        image = likeness.to_bytes(rasterize.render(gaussians, at).colour)
        cases.write_png(data / own.name, image)
    write_model(data / "sparse" / "0", cameras)
    return tmp_path


def write_model(folder, cameras):
    """COLMAP's text model of the same cameras."""
    folder.mkdir(parents=True)
    values = (CAMTOPIX[0, 0], CAMTOPIX[1, 1], *CAMTOPIX[:2, 2])
    words = " ".join(map(str, values))
    (folder / "cameras.txt").write_text(f"1 PINHOLE {SIZE[0]} {SIZE[1]} {words}\n")
    rows = []
    for i, own in enumerate(cameras.shots, 1):
        pose = splat.world_to_camera(own.pose, np.eye(4))
        x, y, z, w = pycolmap.Rotation3d(pose[:, :3]).quat
        rows += [
            f"{i} {w} {x} {y} {z} {' '.join(map(str, pose[:, 3]))} 1 "
            f"{Path(own.name).name}",
            "",
        ]
    (folder / "images.txt").write_text("\n".join(rows) + "\n")
    (folder / "points3D.txt").write_text("")


def renders(kind, folder):
    """What a program writes of all views, below the folder that a line names."""
    for i, name in enumerate(cases.NAMES):
        image, split = cases.picture(i), "train" if i % 8 else "test"
        if kind == "nerfstudio":
            cases.write_png(folder / split / "rgb" / f"{name}.png", image)
        else:
            number = i - 1 if i % 8 else 0
            place = folder / split / "ours_30000" / "renders" / f"{number:05}.png"
            cases.write_png(place, image)


@pytest.mark.parametrize("kind", ["ply", "nerfstudio", "3dgs"])
def test_a_line_of_the_page_is_taken_as_it_stands(here, lines, capsys, kind):
    """Up to the config; the chain behind it is that of other tests."""
    words = lines[kind]
    if kind != "ply":
        renders(kind, here / words["RENDERS"])
    judge.main([*arguments(words), "--only-config"])
    said = capsys.readouterr().out
    assert f"{len(cases.NAMES)} pairs of photo and render" in said
    assert "config: results/first.yaml" in said
    if kind == "ply":
        assert "3,000 Gaussians rendered, their world as the cameras'" in said
    else:
        assert "1 of 8 were held out" in said


def test_a_second_judgement_takes_the_export_of_the_first(here, lines, capsys):
    """Where the page says, and is compared with the first one."""
    first, words = here / "results" / "first", lines["again"]
    export = first / "theirs" / "export" / "cameras"
    assert Path(words["CAMERAS"]) == (export / "transforms.json").relative_to(here)
    export.parent.mkdir(parents=True)
    shutil.copytree(here / "DATA", export)
    (first / ".why-blurry").touch()
    (first / "verdict.json").write_text("{}")
    renders("nerfstudio", here / words["RENDERS"])
    judge.main([*arguments(words), "--only-config"])
    said = capsys.readouterr().out
    assert "compared with results/first" in said
    assert "config: results/second.yaml" in said


PLY = ("--photos=DATA/images", "--cameras=DATA/sparse/0", "--only-config")


def files(folder):
    return {str(p): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_splat_that_is_judged_again_is_not_rendered_again(here, capsys):
    judge.main([*PLY, "--splat=point_cloud.ply"])
    before = files(here / "results")
    judge.main([*PLY, "--splat=point_cloud.ply"])
    assert "renders of the splat are there already" in capsys.readouterr().out
    assert files(here / "results") == before


def test_what_is_refused_leaves_nothing_and_replaces_nothing(here):
    judge.main([*PLY, "--splat=point_cloud.ply", "--name=mine"])
    (here / "results" / "mine").mkdir()
    (here / "results/mine/.why-blurry").touch()
    (here / "results/mine/verdict.json").write_text("{}")
    before = files(here / "results")
    text = (here / "point_cloud.ply").read_bytes()
    (here / "cut.ply").write_bytes(text[: len(text) // 2])
    (here / "other.ply").write_bytes(text)
    for words, says in (
        (["--splat=cut.ply"], "cut.ply"),
        (["--splat=DATA"], "a folder: SPLAT is the .ply itself"),
        (["--splat=other.ply", "--name=mine"], "of another splat"),
    ):
        with pytest.raises(ValueError, match=says):
            judge.main([*PLY, *words])
        assert files(here / "results") == before
        assert sorted(p.name for p in (here / "results").iterdir()) == [
            *("mine", "mine.yaml", "splats"),
        ]
