"""Captures are fetched as they are listed, and those held out stay apart."""

import re
import subprocess

import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image

from tools.bench import captures

EVIDENCE = "workflow/config/evidence"


@pytest.fixture
def mirror(tmp_path):
    """(A mirror with one repository, its first commit); a second one changes all."""
    repository = tmp_path / "mirror" / "somebody+a-capture" / "repo"
    folder = repository / "of [it]"
    folder.mkdir(parents=True)
    for i in range(5):
        photo = Image.fromarray(np.full((30, 2000, 3), 40 * i, np.uint8))
        exif = photo.getexif()
        exif[0x0112] = 6  # taken with the camera turned
        photo.save(folder / f"IMG {i}.JPG", exif=exif)
    (folder / "notes.txt").write_text("no photo")

    def run(*command):
        who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
        done = ["git", "-C", str(repository), *who, *command]
        return subprocess.run(done, check=True, capture_output=True, text=True).stdout

    run("init", "--quiet")
    run("config", "uploadpack.allowAnySHA1InWant", "true")
    run("add", ".")
    run("commit", "--quiet", "-m", "photos")
    commit = run("rev-parse", "HEAD").strip()
    run("rm", "--quiet", "-r", ".")
    run("commit", "--quiet", "-m", "gone")
    return tmp_path / "mirror", commit


@pytest.mark.parametrize(
    ("photos", "of"), [(":", range(5)), ("::2", (0, 2, 4)), ("3:", (3, 4)), (":1", [0])]
)
def test_photos_of_a_commit_are_upright_and_small(photos, of, mirror, tmp_path):
    folder, commit = mirror
    listed = {"from": f"somebody/a-capture@{commit}", "folder": "of [it]"}
    captures.fetch(listed | {"photos": photos}, tmp_path / "out", folder)
    found = sorted((tmp_path / "out" / "images").iterdir())
    assert [path.name for path in found] == [f"IMG {i}.jpg" for i in of]
    for i, path in zip(of, found, strict=True):
        image = np.asarray(Image.open(path))
        assert image.shape[:2] == (1024, 15)
        assert abs(int(image.mean()) - 40 * i) <= 2


def test_what_git_has_not_is_named_and_nothing_is_left(mirror, tmp_path):
    folder, commit = mirror
    listed = {"from": f"somebody/a-capture@{commit}", "folder": "of [it]"}
    for wrong, said in (
        ({"photos": "DSC_1"}, r"of \[it\]: no photo DSC_1"),
        ({"photos": ":", "from": "somebody/else@" + commit}, "fetch"),
        ({"photos": ":", "from": "somebody/a-capture@" + 40 * "0"}, "fetch"),
    ):
        with pytest.raises(ValueError, match=said) as error:
            captures.fetch(listed | wrong, tmp_path / "out", folder)
        assert "\n" not in str(error.value)
        assert not (tmp_path / "out").exists()


def test_captures_are_pinned_and_say_their_terms():
    assert len(captures.of(captures.HELD_OUT)) >= 8
    assert len(captures.EVERY) >= 14
    for name, own in captures.EVERY.items():
        assert own["role"] in captures.ROLES, name
        assert own["terms"], name
        pinned = re.fullmatch(r"[\w.-]+/[\w.-]+@[0-9a-f]{40}", own["from"])
        assert bool(pinned) == ("folder" in own), name
        assert pinned or own["role"] == captures.DEVELOPMENT, name


@pytest.mark.parametrize(
    ("config", "role"),
    [("planted", captures.DEVELOPMENT), ("heldout", captures.HELD_OUT)],
)
def test_configs_of_evidence_keep_roles_apart(config, role, root):
    scenes = yaml.safe_load((root / EVIDENCE / f"{config}.yaml").read_text())["scenes"]
    assert {*scenes} == captures.of(role)


def test_rules_are_made_with_captures_for_development_alone(root):
    path = root / "tests/alignerf/causes/planted.csv"
    found = {*pd.read_csv(path, comment="#")["capture"]}
    assert found <= captures.of(captures.DEVELOPMENT)
