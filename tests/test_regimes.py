"""alignerf.regimes: pooled over seeds, paired by view."""

import ast
import json
import re

import numpy as np
import pandas as pd
import pytest

from alignerf import intervals, poses, regimes

METHODS = ("mipnerf360", "convolution", "alignment")


@pytest.fixture
def scene_of(tmp_path):
    """Writes one scene's files; `gains` in dB of each method over the baseline."""

    def write(name, gains, *, regime, view_db=(20.0, 24.0, 22.0), noise=0.0, seed=0):
        rng = np.random.default_rng(seed)
        methods = []
        for place, (method, gain) in enumerate(zip(METHODS, (0, *gains), strict=True)):
            rows = [
                {"view": f"v{i}", "test_set": test_set, "psnr_db": db, "ssim": 0.5}
                for test_set, extra in (("standard", 0.0), ("oracle", 1.0))
                for i, base in enumerate(view_db)
                for db in [base + extra + gain + (place > 0) * noise * rng.normal()]
            ]
            metrics, timing = (
                tmp_path / f"{name}_{method}.{end}" for end in ("csv", "json")
            )
            pd.DataFrame(rows).to_csv(metrics, index=False)
            timing.write_text(
                json.dumps(
                    {"train_time_s": 10 + place, "rays_seen": 7, "params": place}
                )
            )
            methods.append(
                {
                    "method": method,
                    "parts": method,
                    "metrics": str(metrics),
                    "trainings": [str(timing)] * (1 + (place > 0)),
                }
            )
        displacement = tmp_path / f"{name}.csv"
        pd.DataFrame({"median_px": [1.0, 2.0]}).to_csv(displacement, index=False)
        return regime | {"displacement": str(displacement), "methods": methods}

    return write


def regime(perturb_px=1.0, motion_m=0.0, steps=100, scene="courtyard"):
    keys = (scene, perturb_px, motion_m, steps)
    return dict(zip(regimes.REGIME, keys, strict=True))


def one(table, **keys):
    chosen = np.logical_and.reduce([table[key] == value for key, value in keys.items()])
    (row,) = table[chosen].to_dict("records")
    return row


def test_seeds_are_pooled_and_regimes_are_not(scene_of):
    scenes = [
        scene_of("a", (0.5, 1.5), regime=regime()),
        scene_of("b", (0.1, 0.5), regime=regime()),
        scene_of("c", (-1.0, -1.0), regime=regime(perturb_px=4.0)),
    ]
    table = regimes.make_table(scenes)
    row = one(table, perturb_px=1.0, method="alignment", test_set="oracle")
    assert row["difference_db"] == pytest.approx(1.0)
    assert row["step_db"] == pytest.approx(0.7)
    assert row["psnr_db"] == pytest.approx(22 + 1 + 1.0)
    assert (row["seeds"], row["views"], row["misalignment_px"]) == (2, 6, 1.5)
    assert (row["train_time_s"], row["rays_seen"], row["params"]) == (24, 14, 2)
    # All views of a seed gain alike: what is unsure is which seed.
    assert row["difference_low_db"] == pytest.approx(0.5)
    assert row["difference_high_db"] == pytest.approx(1.5)
    other = one(table, perturb_px=4.0, method="alignment", test_set="standard")
    assert other["difference_db"] == other["difference_low_db"] == -1.0
    assert other["step_db"] == 0.0


def test_how_unlike_views_are_is_no_part_of_the_interval(scene_of):
    table = regimes.make_table([scene_of("a", (0.2, 0.3), regime=regime())])
    row = one(table, method="convolution", test_set="standard")
    assert row["difference_low_db"] == pytest.approx(0.2)
    assert row["difference_high_db"] == pytest.approx(0.2)


def test_other_views_are_refused_by_name(scene_of):
    scene = scene_of("a", (0.2, 0.3), regime=regime())
    other = scene_of("b", (0.2, 0.3), regime=regime(), view_db=(20.0, 21.0))
    scene["methods"][1]["metrics"] = other["methods"][1]["metrics"]
    with pytest.raises(ValueError, match=r"b_convolution\.csv: not the views"):
        regimes.make_table([scene])


def test_pooled_interval_holds_the_mean_as_often_as_it_says():
    """Views and seeds drawn from normals: 95 % of views' part, less with few seeds."""
    rng = np.random.default_rng(0)
    hits = {0.0: 0, 0.3: 0}
    for spread in hits:
        for _ in range(200):
            groups = [rng.normal(s, 1.0, 6) for s in rng.normal(0, spread, 3)]
            low, high = intervals.pooled_interval(groups, draws=1000)
            hits[spread] += low < 0 < high
    assert 0.93 <= hits[0.0] / 200 <= 1.0
    assert 0.85 <= hits[0.3] / 200 <= 1.0


def test_pooled_interval_of_one_seed_is_that_of_its_views():
    values = np.array([0.1, 0.4, -0.2, 0.3])
    assert intervals.pooled_interval([values]) == intervals.mean_interval(values)
    assert np.isnan(intervals.pooled_interval([values, [np.nan, 1.0]])).all()
    assert np.isnan(intervals.pooled_interval([values, [1.0]])).all()


def test_files_are_written_and_latex_has_a_block_a_regime(scene_of, tmp_path):
    chosen = [(0, 0.0, 100), (2, 0.0, 100), (0, 0.02, 100), (2, 0.02, 100)]
    scenes = [
        scene_of(f"{p}{m}{s}", (0.5, 1.0), noise=0.1, seed=k, regime=regime(p, m, s))
        for k, (p, m, s) in enumerate([*chosen, (2, 0.02, 200)])
    ]
    scenes.append(scene_of("fox", (0.1, 0.2), regime=regime(0, None, 300, "fox")))
    paths = [tmp_path / f"out.{end}" for end in ("csv", "tex", "png")]
    regimes.main(
        ["--rows", json.dumps(scenes)]
        + [
            f"{o}={p}"
            for o, p in zip(("--csv", "--tex", "--figure"), paths, strict=True)
        ]
    )
    csv, tex, png = paths
    assert len(pd.read_csv(csv)) == 6 * 3 * 2
    text = tex.read_text()
    assert text.count(r"\emph{") == 6
    assert "poses off by 2 px, motion 2 cm, 200 steps" in text
    assert "poses off by 2 px, still, 100 steps" in text
    assert "fox, 300 steps" in text
    assert png.read_bytes().startswith(b"\x89PNG")


def test_workflow_and_poses_agree_about_motion(root):
    text = (root / "workflow/rules/regime_rows.smk").read_text()
    (found,) = re.findall(r"COURTYARD_MOTION = (\{.*\})", text)
    defaults = poses.DEFAULTS["courtyard"]
    assert ast.literal_eval(found) == {k: defaults[k] for k in ("motion", "motion_m")}
