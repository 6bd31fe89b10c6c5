"""`make clean` deletes what this program wrote, and nothing else."""

import contextlib
import os

import filelock
import numpy as np
import pytest

from alignerf.cli import clean
from alignerf.experiment import layout
from alignerf.experiment.checks import results
from alignerf.io import atomic, owned

AT = layout.training("{scene}", "plain/round0")
SCENE = layout.Scene("{scene}")
# Folders that jobs write as a whole, and single files.
SEALED = (f"{AT.renders}/test", f"{AT.flow}/train", AT.learnt, SCENE.images)
SEALED += (SCENE.export("plain", "cameras"), f"{layout.SPLATS}/{{scene}}")
SINGLE = (SCENE.config, SCENE.cameras, SCENE.verdict, SCENE.page, SCENE.views)
SINGLE += (SCENE.table("controls", "tex"), SCENE.figure("rounds"), SCENE.scores())
SINGLE += (SCENE.trainings("comparison/"), AT.timing, f"{AT}/metrics_aligned_pose.csv")
SINGLE += (AT.log("train"), AT.benchmark("decompose_photos_test"), AT.corrected)
SINGLE += (f"{AT}/checkpoints/state-2000.msgpack", f"{AT}/checkpoints/lock")
SHARED = (
    "table1.csv",
    "table1.provenance.json",
    "table1_effects.csv",
    "arm.provenance.json",
    "logs/table1.tsv",
)
SHARED += ("logs/run-20260101-000000-12.log", ".jax_cache/x/jit_step-1-cache")
# What people, and programs that they run on an export, put beside it.
THEIRS = ("notes.txt", "mine.blend", "outputs/model.pt", "view_999.png", "a b\nc.csv")
THEIRS += ("logs/mine.log", "tables/prices.csv", "checkpoints/mine.msgpack")
THEIRS += ("prices.csv", "prices.provenance.json", "logs/run-1-mine.log")
THEIRS += ("gs/metrics.csv", "old/checkpoints/lock", "backup/learnt/model.msgpack")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(path, content="ours"):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as file:
        file.write(content)


def made(scene):
    """What jobs leave of a scene."""
    owned.claim(f"results/{scene}")
    for folder in SEALED:
        with atomic.replace_folder(folder.format(scene=scene)) as fresh:
            write(fresh / "deep/view_000.png")
            write(fresh / "view_000.png")
    for path in SINGLE:
        write(path.format(scene=scene))
    for path in SHARED:
        write(f"results/{path}")


def files():
    """All but marks."""
    found = {}
    for root, inner, names in os.walk("."):
        links = [name for name in inner if os.path.islink(f"{root}/{name}")]
        for name in {*names, *links} - owned.JUNK:
            path = os.path.normpath(f"{root}/{name}")
            found[path] = os.readlink(path) if os.path.islink(path) else None
    return found


@pytest.mark.parametrize("seed", range(12))
def test_all_of_ours_goes_and_all_of_a_user_s_stays(here, seed):
    rng = np.random.default_rng(seed)
    made("yard")
    made("b")
    folders = sorted({root for root, *_ in os.walk("results")} - {"results"})
    mine = {f"{rng.choice(folders)}/{name}" for name in rng.permutation(THEIRS)[:6]}
    mine |= {"results/own/deep/verdict.json", "site/IMG_1.JPG", ".snakemake/mine.txt"}
    mine |= {"results/prices.csv", "results/prices.provenance.json", "results/b.yaml"}
    mine |= {"results/README.md", "results/published/tables.csv"}
    mine = {path for path in mine if not path.endswith("yard/tables/views.csv")}
    for path in mine:
        write(path, "mine")
    # Links of a user's, and in the place of a file of ours.
    write("disk/cameras.npz", "mine")
    write(f"disk/{owned.MARK}", '["cameras.npz"]')
    os.symlink(here / "disk", "results/lin")
    os.symlink(here / "disk", "results/yard/disk")
    os.remove("results/b/cameras.npz")
    os.symlink(here / "disk/cameras.npz", "results/b/cameras.npz")
    if seed % 3 == 0:
        # Marks that nothing can be told by: then all in that folder is a user's.
        broken = "results/yard/images"
        write(f"{broken}/{owned.MARK}", "" if seed % 2 else '["../../x')
        mine |= {f"{broken}/view_000.png", f"{broken}/deep/view_000.png"}
    clean.main([])
    links = {"results/lin", "results/yard/disk", "results/b/cameras.npz"}
    assert files().keys() == mine | links | {"disk/cameras.npz"}
    clean.main([])
    assert files().keys() == mine | links | {"disk/cameras.npz"}


def test_where_nobody_put_anything_nothing_stays(here):
    made("yard")
    half = here / "results/yard" / atomic.temporary_prefix("images")
    dead = half.with_name(half.name.replace(f"~{os.getpid()}~", "~999999999~"))
    write(dead / "photo.jpg")
    clean.main([])
    assert os.listdir("results") == []


def test_what_a_run_holds_stays(here, capsys):
    made("yard")
    made("b")
    before = {one for one in files() if one.startswith("results/yard")}
    with filelock.FileLock(results.lock_of("yard")):
        clean.main([])
        left = files().keys() - {str(results.lock_of("yard"))}
    assert "results/yard: another run is at work" in capsys.readouterr().out
    assert {one for one in left if one.startswith("results/yard")} == before
    assert not os.path.exists("results/b")
    # Tables and logs may be that run's.
    assert os.path.exists("results/table1.csv")


def test_what_is_left_is_said(here, capsys):
    made("yard")
    write("results/yard/plain/export/cameras/mine.blend")
    clean.main([])
    said = capsys.readouterr().out
    assert said == "left: results/yard/plain/export/cameras/mine.blend\n"
    with contextlib.suppress(SystemExit):
        clean.main(["--help"])
    assert "no other files" in capsys.readouterr().out
