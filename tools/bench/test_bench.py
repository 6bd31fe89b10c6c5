"""The benchmarks run, and their figures mean what they say."""

import argparse
import importlib
import os
import subprocess
import sys
import time

import jax
import numpy as np
import pandas as pd
import pytest
import yaml

from alignerf.experiment import check, schema
from alignerf.scenes import cameras
from alignerf.systems import mipnerf360
from alignerf.training import compose
from tools.bench import cases, measure, multinerf, reproduction, theirs


def test_it_writes_finite_figures_with_the_hardware(root, tmp_path):
    """Programs are not optimised: they are compiled for one call or a few."""
    words = ["--quick", "--repeats=1", f"--out={tmp_path}"]
    done = subprocess.run(
        [sys.executable, "-m", "tools.bench.speed", *words],
        cwd=root,
        env=os.environ | {"JAX_DISABLE_MAX_OPTIMIZATIONS": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found = pd.read_csv(tmp_path / "speed.csv")
    assert list(found["what"]) == ["training, tiny", "rendering, tiny"]
    assert set(found["jax"]) == {jax.__version__}
    assert (found["cores"] >= 1).all()
    assert (found["ours_low_rays_per_s"] > 0).all()
    assert found["ratio"].isna().all()


def test_arms_take_turns_after_a_first_call_of_each():
    calls = []
    arms = {name: lambda name=name: calls.append(name) for name in "ab"}
    times = measure.interleave(arms, 3)
    assert "".join(calls) == "ab" + "ababab"
    assert {name: len(found) for name, found in times.items()} == {"a": 3, "b": 3}


def test_ratios_come_from_pairs():
    # The machine was ten times slower at the second pair: ratios do not see it.
    times = {"ours": [1.0, 10.0, 1.0], "multinerf": [3.0, 30.0, 4.0]}
    row = measure.rates("x", times, 12)
    assert [row[f"ratio{part}"] for part in measure.SPREAD] == [3.0, 3.0, 4.0]
    assert row["ours_low_rays_per_s"] == 1.2
    assert set(row) == {*measure.RATES}


def test_a_turn_has_as_many_calls_as_its_seconds_hold(monkeypatch):
    """Of seconds a call, not a turn; a call that takes longer is made once."""
    now = [0.0]
    monkeypatch.setattr(measure.time, "perf_counter", lambda: now[0])
    made = []

    def call_of(name, took_s):
        def call():
            made.append(name)
            now[0] += took_s

        return call

    arms = {"fast": call_of("fast", 0.25), "slow": call_of("slow", 2.0)}
    times = measure.interleave(arms, 3, least_s=1.0)
    assert times == {"fast": [0.25] * 3, "slow": [2.0] * 3}
    assert made[4:9] == ["fast"] * 4 + ["slow"]


def test_a_kill_loses_no_row_of_a_csv(tmp_path):
    """Whenever it comes, what is there are whole rows, and the next one fits."""
    path, columns = tmp_path / "rows.csv", ("number", "text")
    code = (
        "import sys; from tools.bench import measure\n"
        "for n in range(10**9):\n"
        f"    measure.append({str(path)!r}, {columns}, dict(number=n, text='a,b'*n))"
    )
    for _ in range(2):
        before = path.stat().st_size if path.exists() else 0
        child = subprocess.Popen([sys.executable, "-c", code])
        while not path.exists() or path.stat().st_size < before + 5000:
            time.sleep(0.01)
        child.kill()
        child.wait()
        rows = pd.read_csv(path, keep_default_na=False)
        expected = ["a,b" * number for number in rows["number"]]
        assert list(rows["text"]) == expected
        assert len(rows) > 9
    with pytest.raises(ValueError, match=f"{path}: columns number,text, not other"):
        measure.append(path, ("other",), {"other": 1})


def test_the_default_model_is_that_of_the_benchmarks(root):
    config = yaml.safe_load((root / "workflow/config/table4.yaml").read_text())
    found = check.checked(config).models["base"]
    assert schema.check(mipnerf360.Model, cases.GRID).closed({}) == found


def test_a_missing_peer_is_named(tmp_path):
    with pytest.raises(ValueError, match=f"{tmp_path}: not a checkout"):
        multinerf.load(tmp_path)


@pytest.mark.parametrize("model", [cases.SMALL, cases.PUBLISHED])
def test_the_peer_has_as_many_parameters(peer, model):
    made = theirs.make(peer, name="count", **model, batch_rays=16, steps=10)
    count = lambda tree: sum(leaf.size for leaf in jax.tree.leaves(tree))  # noqa: E731
    key = jax.random.PRNGKey(0)
    method = compose.make_method(cases.make_job(model, batch_rays=16))
    mine = jax.eval_shape(method.init, jax.random.key(0))
    assert count(jax.eval_shape(made.init, key)) == count(mine)


def test_the_peer_sees_the_same_rays_and_colours(peer):
    photos = cases.orbit(3, 12, 8)
    made = theirs.make(peer, name="rays", **cases.TINY, batch_rays=16, steps=10)
    found = theirs.make_dataset(made, photos, split="test").generate_ray_batch(1)
    y, x = np.mgrid[:8, :12]
    camera = photos.pixtocams[1], photos.camtoworlds[1]
    rays = cameras.pixels_to_rays(
        x.ravel(), y.ravel(), *(part.astype(np.float32) for part in camera)
    )
    for name in ("origins", "directions", "viewdirs", "radii"):
        theirs_flat = getattr(found.rays, name).reshape(96, -1)
        np.testing.assert_allclose(getattr(rays, name), theirs_flat, atol=1e-6)
    assert (np.round(found.rgb * 255) == photos.images[1]).all()


def test_every_benchmark_is_importable(root):
    """Those that take hours are run by nobody else."""
    for path in sorted((root / "tools/bench").glob("*.py")):
        if path.stem not in ("__init__", "conftest"):
            importlib.import_module(f"tools.bench.{path.stem}")


def test_gains_are_of_as_many_steps_and_of_as_many_seconds():
    """Plain training gains 1 dB with each doubling of its time; the other has 1 dB."""
    lines = [
        {"scene": "s", "seed": seed, "share": share, "method": method, "round": 0}
        | {"view": view, "psnr_db": 20 + seed + view + np.log2(share) + more}
        | {"test_set": test_set, "total_time_s": 10 * share * times}
        for seed in (0, 2)
        for share in (1.0, 4.0)
        for method, more, times in (("plain", 0, 1), ("other", 1, 2))
        for test_set in ("oracle", "warped")
        for view in (0, 1, 2)
    ]
    lines = [line | {"rays_seen": 600} for line in lines]
    args = argparse.Namespace(steps=2000, pixels=300)
    rows = list(reproduction.budget_of(pd.DataFrame(lines), args))
    plain, other, _, long = rows
    assert (plain["psnr_db"], plain["seconds"], plain["seeds"]) == (22, 10, 2)
    assert "steps_db" not in plain
    assert plain["epochs"] == 2
    gains = ("steps_db", "warped_db", "seconds_db")
    assert [other[name] for name in gains] == pytest.approx([1, 1, 0])
    # Nobody trained the plain one for 80 s.
    assert (long["steps"], long["steps_db"]) == (8000, pytest.approx(1))
    assert "seconds_db" not in long


def test_scores_are_read_off_over_the_logarithm_and_not_beyond(rng):
    """dB rise by 1 with each doubling of the time, of every view."""
    seconds = 100 * 2.0 ** np.arange(3)
    views = rng.normal(20, 2, 5)
    psnr_db = views + np.log2(seconds / 100)[:, None]
    for time_s in rng.uniform(100, 400, 20):
        found = reproduction.interpolated(seconds, psnr_db, time_s)
        assert found == pytest.approx(views + np.log2(time_s / 100))
    # Seconds vary: a little too short counts as long enough.
    assert reproduction.interpolated(seconds, psnr_db, 415.0) == pytest.approx(
        views + 2
    )
    for time_s in (90.0, 430.0):
        assert np.isnan(reproduction.interpolated(seconds, psnr_db, time_s)).all()
