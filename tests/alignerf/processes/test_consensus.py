"""Several processes train what one does, and end together."""

import contextlib
import functools
import json
import os
import socket
import subprocess
import sys
import time

import jax
import pytest

from alignerf.processes import consensus
from alignerf.training import checkpoint, gradients, loop
from tests import job_cases as cases

STOPPED_AT = 7
# So many steps are alike to 1e-5. What rounds otherwise grows from step to step, since
# Adam divides each gradient by its own size.
ALIKE = 4


@contextlib.contextmanager
def started(root, count, *arguments, each=None):
    """`count` processes of tests.on_processes that know of each other; ended after.

    each: a last argument of each one's own.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "tests.on_processes", *map(str, arguments)]
    shared = {
        "JAX_COORDINATOR_ADDRESS": f"127.0.0.1:{port}",
        "JAX_NUM_PROCESSES": str(count),
    }
    found = [
        subprocess.Popen(
            [*command, *([each[number]] if each else [])],
            cwd=root,
            env=os.environ | shared | {"JAX_PROCESS_ID": str(number)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for number in range(count)
    ]
    try:
        yield found
    finally:
        for process in found:
            process.kill()
            process.communicate()


def losses(text):
    """[(step, loss)] of what the first process has said."""
    lines = [json.loads(line) for line in text.splitlines() if line.startswith("{")]
    return [(line["step"], line["loss"]) for line in lines]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return cases.make_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def of_one(scene, tmp_path_factory):
    """Of one process {step: loss}, by how many micro-batches it adds up in a step."""

    def losses_in(parts):
        found, save = {}, checkpoint.save

        def save_and_note(folder, state, *, final, **facts):
            save(folder, state, final=final, **facts)
            found[int(state.step)] = final["loss"]

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(gradients, "micro_batches_for_caches", lambda *_: parts)
            patch.setattr(checkpoint, "save", save_and_note)
            patch.setattr(loop, "CHECKPOINT_EVERY_S", 0.0)
            patch.setattr(loop, "FETCH_EVERY", 1)
            cases.run(scene, tmp_path_factory.mktemp("one"))
        return found

    return functools.cache(losses_in)


@pytest.fixture(scope="module")
def two(root, scene, tmp_path_factory):
    """(folder, losses) of two processes; how the other ended when the first died."""
    out = tmp_path_factory.mktemp("two")
    more = ["--scene", scene, "--out", out, "--config", json.dumps(cases.JOB)]
    with started(root, 2, *more, "--dies-at", STOPPED_AT) as (first, other):
        said, _ = first.communicate(timeout=300)
        died_s = time.monotonic()
        other.communicate(timeout=120)
        return out, losses(said), other.returncode, time.monotonic() - died_s


def test_two_processes_learn_what_one_does(two, of_one):
    """Added up in as many parts."""
    _, found, *_ = two
    assert [step for step, _ in found] == list(range(1, STOPPED_AT + 1))
    check_alike(found, of_one(2))


def test_two_processes_learn_from_what_the_first_has_aligned(root, tmp_path):
    """The other warps its photos by what it was told, and both go on with the same."""
    scene = cases.make_scene(tmp_path, width=81, height=67)
    align = {"cameras_at": [], "photos_at": [0.3], "photos": "whole"}
    align |= {"min_move_px": 0.0, "estimator": "dis_medium"}
    job = cases.JOB | {"align": align}
    out = tmp_path / "out"
    more = ["--scene", scene, "--out", out, "--config", json.dumps(job)]
    with started(root, 2, *more) as processes:
        ends = [process.communicate(timeout=300) for process in processes]
        assert [process.returncode for process in processes] == [0, 0], ends
    (row,) = json.loads((out / "timing.json").read_text())["alignments"]
    assert row["photos_warped"] == 3
    # With other views in either they would have said so.
    assert len(losses(ends[0][0])) >= cases.STEPS
    assert sorted(path.name for path in (out / "learnt").glob("[!.]*")) == [
        *("cameras.npz", "model.msgpack", "photos", "valid")
    ]


def check_alike(found, losses):
    """[(step, loss)] as those of one process."""
    for step, loss in found:
        rel = 1e-5 if step <= ALIKE else 1e-3
        assert loss == pytest.approx(losses[step], rel=rel), step


def test_one_that_dies_ends_the_other(two):
    *_, code, seconds = two
    assert code != 0
    assert seconds < 120


def test_processes_of_other_configs_say_so_and_end(root, scene, tmp_path):
    """Before the first step, or steps and minutes would wait for each other."""
    budget = {"training": {**cases.TRAINING, "steps": None, "budget_min": 0.1}}
    configs = [json.dumps(cases.JOB), json.dumps(cases.JOB | budget)]
    more = ["--scene", scene, "--out", tmp_path, "--config"]
    with started(root, 2, *more, each=configs) as processes:
        said = [process.communicate(timeout=120)[1] for process in processes]
    wanted = "config: not the same in process 1 as in process 0"
    assert [wanted in text for text in said] == [True, True]


def test_four_go_on_from_two(root, scene, two, of_one, tmp_path):
    out, *_ = two
    more = ["--scene", scene, "--out", out, "--config", json.dumps(cases.JOB)]
    with started(root, 4, *more, "--again", tmp_path) as processes:
        ends = [process.communicate(timeout=300) for process in processes]
        assert [process.returncode for process in processes] == [0] * 4, ends
    found, error = losses(ends[0][0]), ends[0][1]
    left = cases.STEPS - STOPPED_AT
    assert [step for step, _ in found[:left]] == [*range(8, cases.STEPS + 1)]
    assert "resuming at step 7 of 14" in error
    check_alike(found[:left], of_one(2))
    check_alike(found[left:], of_one(4))
    assert len(found) == left + cases.STEPS
    assert json.loads((out / "timing.json").read_text())["processes"] == 4


@pytest.mark.parametrize(
    "environ",
    [
        {},
        {"SLURM_STEP_NUM_TASKS": "1", "SLURM_PROCID": "0"},
        # A batch job with four tasks, before srun.
        {"SLURM_NTASKS": "4", "SLURM_PROCID": "0"},
    ],
)
def test_one_process_meets_nobody(environ, monkeypatch):
    monkeypatch.setattr(jax.distributed, "initialize", None)
    with consensus.together(environ):
        assert (consensus.count(), consensus.is_first()) == (1, True)
        assert consensus.on({"a": 1}) == {"a": 1}
