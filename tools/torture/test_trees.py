"""Nothing of a user's is touched: trees of folders and links, and every command."""

import os
import subprocess
import sys

import pytest

from alignerf.io import images, provenance
from tests import judged_cases as cases
from tools.torture import running, trees


@pytest.mark.parametrize("first", range(0, running.CASES or 300, 50))
def test_nothing_of_a_user_changes(first, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    seed = running.SEED or 20261126
    found = [trees.attack(number, seed) for number in range(first, first + 50)]
    assert [one for one in found if one] == []


def test_an_export_keeps_what_is_a_user_s(tmp_path):
    """Of renders that are judged."""
    cases.project(tmp_path)
    run(tmp_path, "judge", *JUDGE, "--name=mine")
    run(tmp_path, "export", "mine")
    scene = tmp_path / "results/mine"
    place = scene / "theirs/export/cameras"
    for name in ("outputs/splat.ply", "images/notes.txt", "images_2/v00.png"):
        (place / name).parent.mkdir(exist_ok=True)
        (place / name).write_text(name)
    photo = tmp_path / "photos/v03.png"
    cases.write_png(photo, cases.picture(60))
    # What was made of the photo before is made anew.
    run(tmp_path, "export", "mine", "--width=100")
    for name in ("outputs/splat.ply", "images/notes.txt", "images_2/v00.png"):
        assert (place / name).read_text() == name
    assert images.read(place / "images/v03.png").shape[1] == 100
    # Nor is a file among outputs that are made anew.
    (scene / "images/notes.txt").write_text("mine")
    cases.write_png(photo, cases.picture(61))
    run(tmp_path, "judge", *JUDGE, "--name=mine")
    assert (scene / "images/notes.txt").read_text() == "mine"


JUDGE = ("--photos=photos", "--renders=renders", "--cameras=transforms.json")


def run(folder, command, *words):
    """A command, in a process of its own."""
    module = f"alignerf.cli.{command}"
    done = subprocess.run(
        [sys.executable, "-m", module, "--cores=2", *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(provenance.ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
