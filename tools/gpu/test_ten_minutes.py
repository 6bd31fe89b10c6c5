"""Ten minutes on an accelerator: all of it on a CPU, and that it keeps to its time."""

import math
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from alignerf.io import provenance
from tools.gpu import paper_size, ten_minutes


def states(out):
    table = pd.read_csv(out / "stages.csv", keep_default_na=False)
    return dict(zip(table["stage"], table["state"], strict=True))


def hanging(mark):
    """A command that never ends; `mark` takes its number."""
    return ["sh", "-c", f"echo $$ > {mark}.new; mv {mark}.new {mark}; exec sleep 300"]


def is_gone(mark):
    """Whether a process ends soon; its parent, which is to take note, may be gone."""
    place = Path("/proc", mark.read_text().strip(), "cmdline")
    deadline = time.monotonic() + 10
    while place.exists() and place.read_text() and time.monotonic() < deadline:
        time.sleep(0.05)
    return not place.exists() or not place.read_text()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("compiles", [False, True])
def test_what_ends_it_ends_its_processes_at_once(tmp_path, number, compiles):
    """The device is left free: by Ctrl-C too, and while programs are compiled."""
    mark = tmp_path / "mark"
    stage = ten_minutes.Stage("hangs", 0, subprocess.run, (hanging(mark),), {})
    killed = multiprocessing.get_context("spawn").Process(
        target=ten_minutes.carry_out,
        args=([stage] * compiles, [stage], tmp_path),
        kwargs={"seconds": 300},
    )
    killed.start()
    while not mark.exists():
        assert killed.is_alive()
        time.sleep(0.05)
    os.kill(killed.pid, number)
    killed.join(10)
    assert not killed.is_alive()
    assert is_gone(mark)


def test_what_fails_hangs_or_does_not_fit_stops_no_other(tmp_path, monkeypatch):
    """A process that is gone is replaced; one that hangs is ended with its own."""
    # As of a copy of the sources without Git's folder.
    monkeypatch.setattr(provenance, "commit", lambda: None)
    stage, mark = ten_minutes.Stage, tmp_path / "mark"
    todo = [
        stage("fails", 0, int, ("no number",)),
        stage("dies", 0, os._exit, (1,)),
        stage("long", 1000, math.sqrt, (4,)),
        stage("runs", 0, math.isnan, (4,)),
        stage("hangs", 0, subprocess.run, (hanging(mark),), most_s=2),
    ]
    ten_minutes.carry_out(todo[:1], todo, tmp_path, seconds=300)
    expected = {"fails": "failed", "dies": "failed", "long": "skipped"}
    assert states(tmp_path) == expected | {"runs": "done", "hangs": "stopped"}
    assert is_gone(mark)
    # What is done is not done again, and a run keeps to its time.
    todo = [todo[3], stage("sleeps", 0, time.sleep, (300,)), stage("late", 1, int, ())]
    began = time.monotonic()
    ten_minutes.carry_out([], todo, tmp_path, seconds=1)
    assert time.monotonic() - began < 30
    assert states(tmp_path) | {"sleeps": "stopped", "late": "skipped"} == states(
        tmp_path
    )
    assert (tmp_path / "stages.csv").read_text().count("runs,") == 1


def test_eight_cards_share_trainings_and_no_more(rng):
    """As a schedule by hand: each training takes a card for its hours."""
    for _ in range(100):
        count, cards = (int(n) for n in rng.integers(1, 20, 2))
        each = rng.uniform(1, 100)
        free = np.zeros(cards)
        for _ in range(count):
            free[free.argmin()] += each
        rays = 3600 * each * count * 1e5
        assert paper_size.hours(rays, 1e5, count, cards) == pytest.approx(free.max())


def test_an_unprepared_folder_is_named(tmp_path):
    with pytest.raises(ValueError, match=f"{tmp_path}: not prepared"):
        ten_minutes.main([str(tmp_path)])


@pytest.mark.parametrize("minutes", ["0", "-1", "nan", "inf"])
def test_minutes_in_which_nothing_fits_are_refused(tmp_path, minutes):
    with pytest.raises(ValueError, match=f"--minutes: {minutes} is no time"):
        ten_minutes.main([str(tmp_path), f"--minutes={minutes}"])


@pytest.mark.whole
def test_a_dry_run_does_all_of_it(tmp_path, root, capsys):
    """Without a peer and gsplat, which it says; and the hours that follow."""
    folder = tmp_path / "folder"
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "tools.gpu.ten_minutes",
            str(folder),
            "--dry",
            "--minutes=60",
        ],
        cwd=root,
    )
    assert done.returncode == 0
    measured = folder / "measured"
    assert set(states(measured).values()) == {"done"}
    assert "no multinerf" in (measured / "stages.csv").read_text()
    assert "no gsplat" in (measured / "stages.csv").read_text()
    rates = pd.read_csv(measured / "speed.csv")
    assert len(rates) == 4
    trained = pd.read_csv(measured / "trainings.csv")
    # Two scenes, two lengths; AligNeRF has two stages.
    assert len(trained) == 2 * 2 * (1 + 2 + 1)
    assert (trained["rays_per_s"] > 0).all()
    scores = pd.read_csv(measured / "scores.csv")
    assert set(scores["test_set"]) >= {"standard", "oracle"}
    assert np.isfinite(scores["psnr_db"]).all()
    paper_size.main([str(measured / "trainings.csv")])
    assert "Table 2, mip-NeRF 360: " in capsys.readouterr().out
