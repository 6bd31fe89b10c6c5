"""Grown folders in the suite: a few of each source, and that the oracles can find."""

import json
import shutil
import sys

import pytest

from alignerf.colmap import ingest
from alignerf.scenes import held_out
from tools.torture import generated, grown, running


@pytest.fixture(scope="module", autouse=True)
def watched():
    """Which files are opened: a hook stays until the process ends."""
    sys.addaudithook(generated.note_opened)


@pytest.mark.parametrize("source", grown.SOURCES)
def test_folders_are_taken_as_they_grow(source, tmp_path):
    case = generated.Case(source, 5)
    keys, _ = generated.build(case, tmp_path / "in")
    done = generated.run(case, keys, tmp_path / "out")
    assert done.fault is None
    assert generated.judge(case, done, tmp_path) is None


@pytest.mark.parametrize("source", grown.SOURCES)
def test_spoilt_folders_are_refused_or_right(source, tmp_path):
    for case in generated.cases_of(source, running.SEED, running.CASES or 4):
        found, done = generated.finding_of(case, tmp_path / "place")
        assert found is None, (case, done)


def with_test_photo(folder):
    """Let a frame of a blender scene show a copy of its test photo in training."""
    test = json.loads((folder / "transforms_test.json").read_text())["frames"][0]
    shutil.copy(folder / f"{test['file_path']}.png", folder / "train/copy.png")
    path = folder / "transforms_train.json"
    content = json.loads(path.read_text())
    content["frames"][1]["file_path"] = "./train/copy"
    path.write_text(json.dumps(content))


def test_the_oracle_knows_a_test_photo_in_training(tmp_path, monkeypatch):
    """By what comes out: the check itself is taken away."""
    monkeypatch.setattr(held_out, "check", lambda *arguments: None)
    case = generated.Case("blender", 3)
    keys, _ = generated.build(case, tmp_path / "in")
    assert (
        generated.judge(case, generated.run(case, keys, tmp_path / "out"), tmp_path)
        is None
    )
    shutil.rmtree(tmp_path / "out")
    with_test_photo(tmp_path / "in")
    found = generated.judge(case, generated.run(case, keys, tmp_path / "out"), tmp_path)
    assert "show one photo" in found


def test_the_oracle_knows_a_file_that_is_lost(tmp_path, monkeypatch):
    whole = ingest.photos.find_images
    # What is looked into counts as used.
    monkeypatch.setattr(ingest.photos, "_is_deep_grey", lambda path: False)
    monkeypatch.setattr(
        ingest.photos,
        "find_images",
        lambda folder, others=(): dict([*whole(folder, others).items()][:-1]),
    )
    found, _ = generated.finding_of(generated.Case("photos", 4), tmp_path / "place")
    assert "neither used nor named" in found


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ("x" * 2000, "a message of 2000 letters"),
        ("/place: a\nb", "does not print"),
        ("no pixel", "names nothing"),
    ],
)
def test_the_oracle_knows_a_bad_message(tmp_path, message, reason):
    assert reason in generated.of_refusal(message, tmp_path)
