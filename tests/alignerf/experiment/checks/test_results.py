"""What a run writes into is looked at before the workflow engine meets it."""

import os

import pytest

from alignerf.experiment import schema
from alignerf.experiment.checks import results
from alignerf.experiment.keys import config as config_keys
from alignerf.io import owned

NAMES = ({"yard": {}}, {"base": {}})


def judged(**paths):
    """Keys of a scene with paths of renders that are judged."""
    paths = {"renders": "photos"} | paths
    return {"source": "external_renders", "external_renders": paths}


def check_apart(config):
    """The same of a config as it is written."""
    results.check_apart(schema.check(config_keys.Config, config))


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


def test_a_user_s_folder_in_the_place_of_ours_is_named(here):
    owned.claim(here / "results/yard")
    # What lies in a folder of ours stays, beside what a run writes.
    (here / "results/yard/base").mkdir()
    (here / "results/yard/base/photo.jpg").touch()
    results.check_folders(*NAMES)
    (here / "results/yard" / owned.MARK).unlink()
    with pytest.raises(ValueError, match=r"^results/yard: has files, and none is"):
        results.check_folders(*NAMES)


@pytest.mark.parametrize("path", ["results/yard", "results/yard/base"])
def test_a_link_in_the_place_of_a_folder_is_named(here, path):
    (here / "mine").mkdir()
    (here / path).parent.mkdir(parents=True)
    (here / path).symlink_to(here / "mine")
    with pytest.raises(ValueError, match=f"{path}: a link"):
        results.check_folders(*NAMES)


# How a folder is said: itself, and by a link, and what lies in it and above it.
INSIDE = {
    "it": "results/yard",
    "in it": "results/yard/deep/er",
    "a link to it": "link",
    "in a link to it": "link/deep",
    "above it": ".",
    "all results": "results",
    "the root": "/",
    "logs": "results/logs/mine",
}
KEYS = {
    "path": lambda c, p: c["scenes"]["yard"].update(path=p),
    "masks": lambda c, p: c["scenes"]["yard"].update(masks=p),
    "external_renders.renders": lambda c, p: c["scenes"]["yard"].update(
        judged(renders=p)
    ),
    "external_renders.cameras": lambda c, p: c["scenes"]["yard"].update(
        judged(cameras=p)
    ),
    "external_renders.before": lambda c, p: c["scenes"]["yard"].update(
        judged(before=p)
    ),
    "external.renders": lambda c, p: c["methods"]["base"].update(
        external={"renders": p}
    ),
    "external.depth": lambda c, p: c["methods"]["base"].update(
        external={"renders": "photos", "depth": p}
    ),
    "flow.folder": lambda c, p: c["flow"].update(
        estimator="files", folder=f"{os.path.abspath(p)}/{{split}}"
    ),
    "lpips.vgg": lambda c, p: c["lpips"].update(vgg=p),
    "frequency_weights": lambda c, p: c.update(frequency_weights=p),
}


def config_of():
    return {
        "scenes": {"yard": {"source": "photos", "path": "photos"}},
        "methods": {"base": {}},
        "flow": {},
        "lpips": {},
    }


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("where", INSIDE)
def test_no_input_lies_in_or_above_what_is_written(here, key, where):
    for folder in ("results/yard/deep/er", "results/logs/mine", "photos", "results/no"):
        (here / folder).mkdir(parents=True)
    (here / "link").symlink_to(here / "results/yard")
    config = config_of()
    for allowed in ("photos", "results/no", "results/new", None):
        if allowed:
            KEYS[key](config, allowed)
        check_apart(config)
    KEYS[key](config, INSIDE[where])
    with pytest.raises(ValueError, match=f"{key}.* (lies in|holds) results/.*this run"):
        check_apart(config)


def test_results_that_are_elsewhere(here):
    """By a link, as onto another disk."""
    (here / "disk/yard").mkdir(parents=True)
    (here / "results").symlink_to("disk")
    config = config_of()
    config["scenes"]["yard"]["path"] = "disk/yard/photos"
    with pytest.raises(ValueError, match="disk/yard/photos lies in results/yard"):
        check_apart(config)


def test_a_loop_of_links_leads_nowhere(here):
    (here / "loop").symlink_to("loop")
    config = config_of()
    config["scenes"]["yard"]["path"] = "loop"
    check_apart(config)
