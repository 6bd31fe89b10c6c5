"""What a run writes into is looked at before the workflow engine meets it."""

import os

import pytest

from alignerf.experiment.checks import results

NAMES = ({"yard": {}}, {"base": {}})


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "path", ["results", "results/yard", "results/yard/base", "results/yard/logs"]
)
@pytest.mark.parametrize("kind", ["file", "lost link", "pipe"])
def test_what_is_no_folder_is_named(here, path, kind):
    results.check_folders(*NAMES)
    place = here / path
    place.parent.mkdir(parents=True, exist_ok=True)
    if kind == "lost link":
        place.symlink_to("nowhere")
    else:
        place.touch() if kind == "file" else os.mkfifo(place)
    with pytest.raises(ValueError, match=f"^{path}: a folder was expected"):
        results.check_folders(*NAMES)


def test_a_link_to_a_folder_is_one(here):
    (here / "elsewhere/yard").mkdir(parents=True)
    (here / "results").symlink_to("elsewhere")
    results.check_folders(*NAMES)
    results.check_writable(*NAMES)


@pytest.mark.parametrize("path", ["results", "results/yard", "results/yard/base"])
def test_what_cannot_be_written_to_is_named(here, path, monkeypatch):
    """Nothing is closed to root, as whom tests may run: here the answer is put in."""
    (here / "results/yard/base").mkdir(parents=True)
    results.check_writable(*NAMES)
    monkeypatch.setattr(os, "access", lambda folder, mode: str(folder) != path)
    with pytest.raises(ValueError, match=f"^{path}: cannot be written to"):
        results.check_writable(*NAMES)
