"""The tables of windows at several sizes, of scores that are made up."""

import json

import pandas as pd
import pytest

from tools.bench import window_sizes

VIEWS = ("a", "b", "c")
PLAIN, ALIGNED = ("mipnerf360", 0), ("aligned", 0)


def write_scene(folder, psnr_db, *, flow_px=0.5, time_s=None):
    """What the bench reads of a scene; psnr_db: by (method, round), the fair score."""
    (folder / "tables").mkdir(parents=True)
    rows = [
        (*method, test_set, view, "psnr_db", db + 0.1 * n - (test_set == "standard"))
        for method, db in psnr_db.items()
        for test_set in ("standard", "aligned_pose")
        for n, view in enumerate(VIEWS)
    ]
    columns = [*window_sizes.KEYS, "metric", "value"]
    pd.DataFrame(rows, columns=columns).to_csv(folder / "scores.csv", index=False)
    times = [(name, "none", (time_s or {}).get((name, 0), 10)) for name, _ in psnr_db]
    columns = ["method", "warping", "total_time_s"]
    table = pd.DataFrame(times, columns=columns)
    table.to_csv(folder / "tables/misalignment.csv", index=False)
    (folder / "poses.json").write_text(json.dumps({"photo_size": [800, 600]}))
    evidence = {"flow_train_px": flow_px, "flow_test_px": None, "passes": 1.5}
    (folder / "verdict.json").write_text(json.dumps({"evidence": evidence}))


def write_longer(folder, db):
    """A plain training of twice the steps."""
    folder = folder / "mipnerf360/round0"
    folder.mkdir(parents=True)
    names = {"standard": "metrics", "aligned_pose": "metrics_aligned_pose"}
    for test_set, name in names.items():
        rows = [(view, test_set, db + 0.1 * n) for n, view in enumerate(VIEWS)]
        table = pd.DataFrame(rows, columns=["view", "test_set", "psnr_db"])
        table.to_csv(folder / f"{name}.csv", index=False)
    (folder / "timing.json").write_text(json.dumps({"train_time_s": 20}))


def tables(tmp_path, *results):
    config = tmp_path / "windows.yaml"
    config.write_text("scenes: { chair: {}, chair_half: {}, chair_colmap: {} }\n")
    plain, out = tmp_path / "plain.csv", tmp_path / "out.csv"
    window_sizes.main(
        [
            *(str(config), "--results", *map(str, results)),
            *("--plain", str(plain), "--out", str(out)),
        ]
    )
    return pd.read_csv(plain), pd.read_csv(out).set_index(["poses", "method"])


def test_gains_are_over_plain_training_of_the_same_size_and_seed(tmp_path):
    for seed in (0, 1):
        results = tmp_path / f"seed{seed}"
        scores = {PLAIN: 20.0 + seed, ALIGNED: 21.5 + seed}
        write_scene(results / "chair", scores, time_s={ALIGNED: 12})
        write_scene(results / "chair_half", {PLAIN: 22.0 + seed}, flow_px=0.3)
        write_scene(results / "chair_colmap", {PLAIN: 23.0 + seed})
        write_longer(results / "chair_x2", 20.5 + seed)
    plain, gains = tables(tmp_path, tmp_path / "seed0", tmp_path / "seed1")
    full, half = plain[plain["poses"] == "the phone's own"].to_dict("records")
    assert (full["width_px"], half["width_px"], full["seeds"]) == (800, 400, 2)
    assert full["loss_db"] == pytest.approx(3)
    assert half["flow_photo_px"] == pytest.approx(0.6)
    own = gains.loc["the phone's own"]
    assert own.loc["aligned on the way", "full_gain_db"] == pytest.approx(1.5)
    assert own.loc["aligned on the way", "full_time"] == pytest.approx(1.2)
    assert own.loc["aligned on the way", "full_psnr_db"] == pytest.approx(22.1)
    longer = own.loc["twice the steps, plain training"]
    assert longer["full_gain_db"] == pytest.approx(0.5)
    assert longer["full_time"] == pytest.approx(2)
    assert "half_gain_db" not in gains


def test_what_is_not_whole_is_left_out(tmp_path):
    results = tmp_path / "results"
    write_scene(results / "chair", {PLAIN: 20.0})
    write_scene(results / "chair_half", {PLAIN: 20.0})
    (results / "chair_half/verdict.json").unlink()
    plain, gains = tables(tmp_path, results)
    assert plain["size"].tolist() == ["full"]
    assert "loss_db" not in plain
    assert len(gains) == 1
