"""A judgement in one process: neither Snakemake nor JAX, and the rules' own files."""

import os
import signal
import subprocess
import sys
import time

import pytest

from alignerf.cli import configs, light, workflow
from alignerf.experiment import check, plan
from tests import judged_cases as cases

# What is not installed by `pip install .[judge]`.
WITHOUT = ("jax", "jaxlib", "flax", "optax", "snakemake", "matplotlib", "beartype")
CODE = f"""
import sys
class Refused:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {WITHOUT}:
            raise ImportError(f"{{name}} is not to be imported")
sys.meta_path.insert(0, Refused())
from alignerf.cli import why_blurry
try:
    why_blurry.main(sys.argv[1:])
finally:
    assert not set({WITHOUT}) & sys.modules.keys()
"""
WORDS = ("judge", "--photos=photos", "--renders=renders", "--name=mine", "--cores=2")


def judge(folder, root, *words, wait=True):
    process = subprocess.Popen(
        [sys.executable, "-c", CODE, *(words or WORDS), "--cameras=transforms.json"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(root), "VERBOSE": ""},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    if not wait:
        return process
    said, _ = process.communicate()
    return process.returncode, said


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("judged")
    cases.project(folder)
    return folder


@pytest.fixture(scope="module")
def stopped(folder, root):
    """{signal: (exit code, what was said, what was left half made)} by who stops it."""
    found, begun = {}, folder / "results/mine/logs/poses.log"
    for one in (signal.SIGINT, signal.SIGTERM):
        process = judge(folder, root, wait=False)
        while not begun.is_file() and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(one)
        said, _ = process.communicate()
        begun.unlink(missing_ok=True)
        left = list((folder / "results").rglob(".*~*"))
        found[one] = process.returncode, said, left
    return found


@pytest.fixture(scope="module")
def failed(folder, root, stopped):
    """(exit code, what was said) of a judgement with a photo that is cut off."""
    photo = folder / "photos" / "v03.png"
    before = photo.read_bytes()
    photo.write_bytes(before[:2000])
    try:
        return judge(folder, root)
    finally:
        photo.write_bytes(before)


@pytest.fixture(scope="module")
def judged(folder, root, failed):
    """(folder of a judgement, what it said): who stopped or failed before goes on."""
    code, said = judge(folder, root)
    assert code == 0, said
    return folder, said


def test_it_ends_with_the_verdict_and_a_line_a_step(judged):
    folder, said = judged
    lines = said.splitlines()
    assert sum(line.startswith("  theirs: ") for line in lines) == 6
    assert any(line.startswith(("9 jobs in 0:", "10 jobs in 0:")) for line in lines)
    assert "renders are not those of their photos" in said
    assert (folder / "results/mine/index.html").is_file()
    log = (folder / "results/mine/logs/poses.log").read_text()
    assert "8 pairs, renders named like the photos" in log
    assert said.count("transforms.json: 8 of 8 photos are found by name") == 1


def test_snakemake_goes_on_with_it(judged, dry_run):
    """Its rules have these outputs, and find nothing to make."""
    config = judged[0] / "results" / "mine.yaml"
    code, said = dry_run(judged[0], "-n", "--configfile", config)
    assert code == 0, said
    assert "Nothing to be done" in said


def test_what_is_stale_is_made_with_all_that_follows(judged, monkeypatch):
    """Outputs are gone, the command is another, files are more than touched."""
    monkeypatch.chdir(judged[0])
    config = configs.read("results/mine.yaml")

    def rules(**flow):
        checked = check.checked(config | {"flow": config["flow"] | flow})
        return [rule for rule, *_ in light.stale(plan.Experiment(checked), "mine", [])]

    (judged[0] / "photos/v03.png").touch()
    assert rules() == []
    assert rules(match_blur=False)[::6] == ["align", "page"]
    page = (judged[0] / "results/mine/index.html").rename(judged[0] / "page")
    assert rules() == ["page"]
    page.rename(judged[0] / "results/mine/index.html")
    render = judged[0] / "renders/v03.png"
    render.rename(judged[0] / "v03.png")
    assert rules()[0] == "poses"
    (judged[0] / "v03.png").rename(render)
    assert rules() == []


def test_what_is_there_stays_and_what_is_not_is_made(judged, root):
    folder, _ = judged
    # With other cores, too.
    again = WORDS[:-1]
    assert "all of it is there already" in judge(folder, root, *again)[1]
    (folder / "results/mine/index.html").unlink()
    said = judge(folder, root)[1].splitlines()
    assert [line for line in said if line.startswith("1 job in 0:")]


def test_a_step_that_fails_is_one_line_and_its_log(failed):
    code, said = failed
    assert code == 1
    lines = said.splitlines()
    assert lines[-3].startswith("error: "), said
    assert lines[-2:-1] == ["  in results/mine/logs/poses.log"]
    assert "FAILED" in said
    assert "Traceback" not in said


@pytest.mark.parametrize("one", [signal.SIGINT, signal.SIGTERM])
def test_who_stops_it_finds_nothing_half_made(stopped, one):
    code, said, left = stopped[one]
    assert code == light.STOPPED, said
    assert "stopped" in said
    assert not left


@pytest.mark.parametrize(
    ("scenes", "taken"),
    [
        ("{a: {source: external_renders}}", True),
        ("{a: {source: external_renders}, b: {source: photos}}", False),
        ("{a: {source: [1]}}", False),
        ("{a: 3}", False),
    ],
)
def test_what_trains_is_left_to_snakemake(tmp_path, scenes, taken):
    path = tmp_path / "a.yaml"
    path.write_text(f"scenes: {scenes}\n")
    assert light.takes(path) == taken


def test_who_trains_without_the_extra_is_told_what_to_install(tmp_path, monkeypatch):
    path = tmp_path / "a.yaml"
    path.write_text("scenes: {a: {source: photos}}\n")
    monkeypatch.setattr(workflow.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install '\.\[train\]'"):
        workflow.run(path, 1, "all")
