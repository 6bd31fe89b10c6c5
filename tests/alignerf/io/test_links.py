"""Nothing below results/ is written or removed through a link, by whatever writes."""

import os
from pathlib import Path

import pytest

from alignerf.cli import workflow
from alignerf.experiment.checks import results
from alignerf.io import atomic, owned
from alignerf.training import checkpoint

WAYS = {
    "a file": lambda path: entered(atomic.replace_file(path / "a.csv")),
    "a folder": lambda path: entered(atomic.replace_folder(path / "renders")),
    "scratch": lambda path: entered(atomic.scratch_folder(path)),
    "a moved file": lambda path: atomic.move(fresh("new.csv"), path / "a.csv"),
    "a moved folder": lambda path: atomic.move(fresh("new/a.csv").parent, path / "r"),
    "a mark": owned.put,
    "a claim": owned.claim,
    "a removal": owned.remove,
    "a command's folder": owned.clear,
    "checkpoints": lambda path: entered(checkpoint.lock(path)),
    "an output of a job": lambda path: results.claim((), written=[path / "a.csv"]),
}


def entered(context):
    with context:
        pass


def fresh(name):
    """A new file, elsewhere."""
    os.makedirs(os.path.dirname(f"fresh/{name}"), exist_ok=True)
    with open(f"fresh/{name}", "w", encoding="utf-8") as file:
        file.write("ours")
    return Path(f"fresh/{name}")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    owned.claim("results/yard")
    (tmp_path / "disk/deep").mkdir(parents=True)
    (tmp_path / "disk/a.csv").write_text("mine")
    (tmp_path / "disk" / owned.MARK).write_text('["a.csv"]')
    return tmp_path


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    "link", ["results/link", "results/yard/link", "results/yard/plain/round0/link"]
)
@pytest.mark.parametrize("inside", ["", "deep", "new/deeper"])
def test_no_way_leads_through_a_link(here, way, link, inside):
    path = here / link
    path.parent.mkdir(parents=True, exist_ok=True)
    path.symlink_to(here / "disk")
    before = {p: p.is_file() and p.read_text() for p in (here / "disk").rglob("*")}
    with pytest.raises(ValueError, match=f"{link}: a link, and nothing is"):
        WAYS[way](Path(link, inside))
    after = {p: p.is_file() and p.read_text() for p in (here / "disk").rglob("*")}
    assert after == before
    assert path.is_symlink()


@pytest.mark.parametrize("way", ["a file", "a mark", "a moved file"])
def test_a_link_in_the_place_of_a_file_is_a_user_s(here, way):
    link = "results/yard/a.csv" if way != "a mark" else "results/yard/plain"
    os.symlink(here / "disk/a.csv", link)
    with pytest.raises(ValueError, match=f"{link}: a link"):
        WAYS[way](Path("results/yard" if way != "a mark" else link))
    assert (here / "disk/a.csv").read_text() == "mine"


@pytest.mark.parametrize("shared", results.SHARED)
def test_no_log_and_no_cache_is_written_through_a_link(here, shared):
    os.symlink(here / "disk", f"results/{shared}")
    with pytest.raises(ValueError, match=f"results/{shared}: a link"):
        results.check_folders({}, {})
    if shared == "logs":
        with pytest.raises(ValueError, match="results/logs: a link"):
            workflow.log_file()


def test_results_may_lie_on_another_disk_and_scenes_in_a_storage(here):
    for way in ("a file", "a folder", "scratch", "checkpoints"):
        (here / "results").rename(here / "other")
        (here / "results").symlink_to("other")
        WAYS[way](Path("results/yard"))
        (here / "results").unlink()
        (here / "other").rename(here / "results")
    (here / owned.STORAGE / "s3/results/tiny").mkdir(parents=True)
    os.symlink(here / owned.STORAGE / "s3/results/tiny", "results/tiny")
    WAYS["a file"](Path("results/tiny"))


def test_what_a_killed_run_left_goes_with_the_next(here, capsys):
    left = here / "results/yard" / atomic.temporary_prefix("poses")
    dead = left.with_name(left.name.replace(f"~{os.getpid()}~", "~999999999~"))
    (dead / "photos").mkdir(parents=True)
    left.mkdir()
    with results.held("yard"):
        assert not dead.exists()
        assert left.exists()
    assert "removed what a killed run had half written" in capsys.readouterr().err
