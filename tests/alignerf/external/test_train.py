"""Training and rendering by commands: what they get, and what is left of them."""

import json
import os
import sys
import time

import pytest

from alignerf.external import commands
from alignerf.io import archives, json_files, owned

# Writes what it gets where its second word says, and fails if a third is there.
TRAINER = """
import os, sys
with open(os.path.join(sys.argv[2], "said"), "a") as file:
    file.write(sys.argv[1] + "\\n")
if len(sys.argv) > 3:
    sys.exit("out of memory")
"""
# Moves images from the folder that it is started with to the one for renders.
RENDERER = """
import pathlib, shutil, sys
for path in pathlib.Path(sys.argv[1]).glob("*.png"):
    shutil.copy(path, sys.argv[2])
"""


@pytest.fixture
def ran(forked, made, training):
    """What a command says; commands fork, which JAX forbids to this process."""

    def run(what, external, *more):
        words = ["--config", json.dumps({"external": external}), "--training", training]
        module = f"alignerf.external.{what}"
        _, said = forked.run(module, "--scene", made, *words, *more)
        assert "Traceback" not in said
        return said

    return run


@pytest.fixture
def training(tmp_path):
    """A training's folder."""
    (tmp_path / "a b" / "round2").mkdir(parents=True)
    return tmp_path / "a b" / "round2"


@pytest.fixture
def train(made, ran, training, tmp_path):
    (tmp_path / "train.py").write_text(TRAINER)

    def run(said, *, more="", sources="", **keys):
        command = f"'{sys.executable}' {tmp_path}/train.py {said} {{model}} {more}"
        outs = ("--timing", training / "timing.json", "--learnt", training / "learnt")
        external = {"train": command} | keys
        read = ("--cameras", made / "cameras.npz", "--photos", made / "images")
        more = ("--sources", sources)
        return ran("train", external, *outs, *read, *more)

    return run


def test_a_training_knows_its_seconds_and_no_more(train, training, made):
    began = time.monotonic()
    train("{scene},{round},{cores},{seed},{steps}", seed=7, steps=30)
    timing = json_files.read(training / "timing.json", {"train_time_s": float})
    assert 0 < timing["train_time_s"] < time.monotonic() - began
    assert timing["steps"] == 30
    assert timing["rays_seen"] is timing["params"] is None
    assert (training / "model" / "said").read_text() == "yard,2,1,7,30\n"
    names = ["names", "camtoworlds"]
    learnt = archives.read(training / "learnt" / "cameras.npz", names)
    given = archives.read(made / "cameras.npz", names)
    assert all((learnt[key] == given[key]).all() for key in names)


def test_folders_are_whole_paths(train, training):
    train("{data}")
    assert (training / "model" / "said").read_text() == f"{training / 'data'}\n"


def test_a_model_stays_until_it_is_done_or_learns_from_something_else(train, training):
    said = training / "model" / "said"
    assert "error: " in train("one", more="fail")
    assert not (training / "timing.json").exists()
    assert not (training / "learnt").exists()
    assert "{model} is that of a run that was stopped" in train("one", more="fail")
    assert said.read_text() == "one\none\n"
    train("two")
    assert said.read_text() == "two\n"
    # It is done: the next one is another training.
    train("two")
    assert said.read_text() == "two\n"
    train("three", more="fail")
    train("three", more="fail", sources="other code")
    assert said.read_text() == "three\n"


def test_what_a_command_keeps_beside_its_data_is_no_user_s(train, training):
    """As nerfstudio's smaller photos: a stopped run goes on, and they are replaced."""
    data, said = training / "data", training / "model" / "said"
    train("one", more="fail")
    (data / "images_2").mkdir()
    (data / "images_2" / "a.png").touch()
    assert "{model} is that of a run that was stopped" in train("one", more="fail")
    assert said.read_text() == "one\none\n"
    assert owned.others(data) == ["images_2/a.png"]
    train("two")
    assert owned.others(data) == []


@pytest.mark.parametrize("begun", [None, b"\xff\xfe"])
def test_a_mark_that_is_none_is_replaced(train, training, begun):
    """Nor is a pipe waited for."""
    path = training / "model.begun"
    os.mkfifo(path) if begun is None else path.write_bytes(begun)
    train("one", more="fail")
    assert path.is_file()
    assert (training / "model" / "said").read_text() == "one\n"
    assert "{model} is that of a run that was stopped" in train("one", more="fail")


@pytest.fixture
def render(made, ran, training, tmp_path):
    (tmp_path / "render.py").write_text(RENDERER)

    def run(external):
        outs = ("--renders", training / "renders", "--depth", training / "depth")
        outs += ("--timing", training / "render")
        splits = ("--splits", "train", "test", "--cameras", made / "cameras.npz")
        return ran("render", external, *outs, *splits)

    return run


def test_renders_of_a_command(render, training, theirs, tmp_path):
    program = f"'{sys.executable}' {tmp_path}/render.py"
    render({"render": f"{program} '{theirs}' {{renders}}"})
    assert len(list((training / "renders").glob("t*/*.png"))) == 8
    assert len(list((training / "depth").glob("t*/*.npz"))) == 8
    numbers = {"views": int, "view_time_s": float, "time_s": float}
    timing = json_files.read(training / "render" / "train.json", numbers)
    assert timing["views"] == 6
    assert timing["time_s"] == pytest.approx(6 * timing["view_time_s"], abs=1e-3)
    # What it has written on the way is gone.
    left = {path.name for path in training.iterdir()}
    assert left == {"renders", "depth", "render"}


def test_renders_that_are_missing(render, training, tmp_path):
    program = f"'{sys.executable}' {tmp_path}/render.py"
    said = render({"render": f"{program} '{tmp_path}' {{renders}}"})
    assert "8 of 8 views are missing" in said.splitlines()[-1]
    assert said.splitlines()[-1].endswith("; it is empty")
    # It can be looked at; what would be read on is not there.
    assert {path.name for path in training.iterdir()} == {"rendered"}


def test_finished_renders_take_no_time(render, training, theirs, made):
    folder = str(theirs).replace("theirs", "{scene}")
    theirs.rename(theirs.with_name("yard"))
    render({"renders": folder})
    timing = json_files.read(training / "render" / "test.json")
    assert timing == {"time_s": 0.0, "views": 2, "view_time_s": 0.0}


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"external": {"trian": "x"}}'])
def test_a_job_of_another_kind_is_refused(text):
    with pytest.raises(ValueError, match="--config is no external job"):
        commands.job_of(text)
