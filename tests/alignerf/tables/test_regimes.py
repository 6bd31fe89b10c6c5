"""alignerf.tables.regimes: pooled over seeds, paired by view."""

import json

import numpy as np
import pandas as pd
import pytest

from alignerf.experiment.tables import regimes as regime_rows
from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import intervals, regimes
from alignerf.tables.plots import regimes as regimes_plot

ROWS = [("mipnerf360", 0), ("convolution", 0), ("alignment", 0), ("mipnerf360", 1)]


@pytest.fixture
def scene_of(tmp_path):
    """Writes one scene's files; `gains` in dB of each row over the baseline."""

    def write(name, gains, *, regime, view_db=(20.0, 24.0, 22.0), noise=0.0, seed=0):
        rng = np.random.default_rng(seed)
        methods = []
        for place, gain in enumerate((0, *gains)):
            views = [
                {"view": f"v{i}", "test_set": test_set, "psnr_db": db, "ssim": 0.5}
                for test_set, extra in (("standard", 0.0), ("oracle", 1.0))
                for i, base in enumerate(view_db)
                for db in [base + extra + gain + (place > 0) * noise * rng.normal()]
            ]
            methods.append(write_row(tmp_path, name, place, views))
        displacement = tmp_path / f"{name}.csv"
        pd.DataFrame({"median_px": [1.0, 2.0]}).to_csv(displacement, index=False)
        return regime_rows.Regime(
            **regime,
            scene=name,
            seed=seed,
            alike=json.dumps(regime),
            displacement=str(displacement),
            methods=methods,
        )

    return write


def write_row(folder, scene, place, views):
    """The files of one of ROWS: its views' scores, and what it took."""
    method, round = ROWS[place]
    metrics, timing, data = (
        folder / f"{scene}_{method}{round or ''}{end}"
        for end in (".csv", ".json", "_data.json")
    )
    pd.DataFrame(views).to_csv(metrics, index=False)
    costs = {"train_time_s": 10 + place, "steps": 1, "rays_seen": 7, "params": place}
    timing.write_text(json.dumps(costs))
    data.write_text(json.dumps({"time_s": 3.0}))
    return regime_rows.Method(
        method=method,
        round=round,
        parts=method,
        metrics=str(metrics),
        trainings=[str(timing)] * (1 + (place > 0)),
        data=[str(data)] * round,
    )


def regime(perturb_px=1.0, motion_m=0.0, steps=100):
    return {"perturb_px": perturb_px, "motion_m": motion_m, "steps": steps}


def one(table, **keys):
    chosen = np.logical_and.reduce([table[key] == value for key, value in keys.items()])
    (row,) = table[chosen].to_dict("records")
    return row


def test_minutes_show_the_steps_that_they_came_to(scene_of):
    table = regimes.make_table([scene_of("a", (0, 0, 0), regime=regime(steps=None))])
    assert set(table["steps"]) == {1}


def test_seeds_are_pooled_and_regimes_are_not(scene_of):
    scenes = [
        scene_of("a", (0.5, 1.5), regime=regime()),
        scene_of("b", (0.1, 0.5), regime=regime(), seed=1),
        scene_of("c", (-1.0, -1.0), regime=regime(perturb_px=4.0)),
    ]
    table = regimes.make_table(scenes)
    row = one(table, perturb_px=1.0, method="alignment", test_set="oracle")
    assert row["difference_db"] == pytest.approx(1.0)
    assert row["step_db"] == pytest.approx(0.7)
    assert row["psnr_db"] == pytest.approx(22 + 1 + 1.0)
    assert (row["seeds"], row["views"], row["misalignment_px"]) == (2, 6, 1.5)
    assert (row["train_time_s"], row["rays_seen"], row["params"]) == (24, 14, 2)
    # All views of a seed gain alike: what is unsure is which seed. Student's t is
    # 12.7 for two of them, half a decibel from their mean.
    assert row["difference_low_db"] == pytest.approx(1.0 - 12.706 * 0.5, abs=1e-3)
    assert row["difference_high_db"] == pytest.approx(1.0 + 12.706 * 0.5, abs=1e-3)
    other = one(table, perturb_px=4.0, method="alignment", test_set="standard")
    assert other["difference_db"] == other["difference_low_db"] == -1.0
    assert other["step_db"] == 0.0


def test_the_baseline_on_warped_photos_stands_last(scene_of, caplog):
    scene = scene_of("a", (0.5, 1.5, 2.5), regime=regime())
    table = regimes.make_table([scene])
    keys = {"method": "mipnerf360", "test_set": "oracle"}
    row = one(table, warping="once", **keys)
    assert row["difference_db"] == pytest.approx(2.5)
    assert row["step_db"] == pytest.approx(1.0)
    assert (row["train_time_s"], row["data_time_s"], row["total_time_s"]) == (26, 3, 29)
    assert one(table, warping="none", **keys)["total_time_s"] == 10
    # Of several trainings it has more rays, and that is no fault.
    assert "mipnerf360 saw" not in caplog.text
    assert "mipnerf360, warped once &" in regimes.to_latex(table)
    assert set(regimes_plot.compared(table)["row"]) == {
        "convolution",
        "alignment",
        "mipnerf360, warped once",
    }


@pytest.mark.parametrize("first", [0, 1])
def test_a_round_that_one_seed_lacks_is_left_out_and_told(scene_of, caplog, first):
    scenes = [
        scene_of("a", (0.5, 1.5), regime=regime()),
        scene_of("b", (0.1, 0.5, 9.0), regime=regime(), seed=1),
    ]
    table = regimes.make_table(scenes[::-1] if first else scenes)
    assert set(table["warping"]) == {"none"}
    row = one(table, method="alignment", test_set="oracle")
    assert row["difference_db"] == pytest.approx(1.0)
    assert "not on all seeds, left out: mipnerf360, warped once" in caplog.text


def test_how_unlike_views_are_is_no_part_of_the_interval(scene_of):
    table = regimes.make_table([scene_of("a", (0.2, 0.3), regime=regime())])
    row = one(table, method="convolution", test_set="standard")
    assert row["difference_low_db"] == pytest.approx(0.2)
    assert row["difference_high_db"] == pytest.approx(0.2)


def test_other_views_are_refused_by_name(scene_of):
    scene = scene_of("a", (0.2, 0.3), regime=regime())
    other = scene_of("b", (0.2, 0.3), regime=regime(), view_db=(20.0, 21.0))
    scene.methods[1] = other.methods[1]
    with pytest.raises(ValueError, match=r"b_convolution\.csv: not the views"):
        regimes.make_table([scene])


def test_the_same_scene_twice_is_refused_by_name(scene_of):
    scenes = [scene_of(name, (0.5, 1.5), regime=regime()) for name in "ab"]
    with pytest.raises(ValueError, match="b: the same as a"):
        regimes.make_table(scenes)


def test_what_is_missing_is_named(scene_of):
    scene = scene_of("a", (0.5, 1.5), regime=regime())
    pd.DataFrame({"view": ["v"]}).to_csv(scene.displacement, index=False)
    with pytest.raises(ValueError, match=r"a\.csv: .*: no column median_px"):
        regimes.make_table([scene])
    metrics = scene.methods[1].metrics
    pd.read_csv(metrics).drop(columns="psnr_db").to_csv(metrics, index=False)
    with pytest.raises(ValueError, match=r"a_convolution\.csv: no column psnr_db"):
        regimes.make_table([scene])


def test_a_test_set_that_one_method_lacks_is_left_out(scene_of):
    scene = scene_of("a", (0.5, 1.5), regime=regime())
    metrics = scene.methods[2].metrics
    rows = pd.read_csv(metrics)
    rows[rows["test_set"] == "standard"].to_csv(metrics, index=False)
    assert set(regimes.make_table([scene])["test_set"]) == {"standard"}


def test_other_numbers_of_rays_are_told(scene_of, caplog):
    scene = scene_of("a", (0.5, 1.5), regime=regime())
    regimes.make_table([scene])
    assert "a: convolution saw 2.00 of the baseline's rays" in caplog.text


@pytest.mark.parametrize("spread", [0.0, 0.3, 1.0, 3.0])
def test_pooled_interval_holds_the_mean_as_often_as_it_says(spread):
    """Seeds' and views' parts drawn from normals, views' of deviation 1."""
    rng = np.random.default_rng(0)
    hits = 0
    for _ in range(300):
        groups = [rng.normal(s, 1.0, 6) for s in rng.normal(0, spread, 3)]
        low, high = intervals.pooled_interval(groups, draws=1000)
        hits += low < 0 < high
    # Three deviations of a share of 300 about 0.95.
    assert hits / 300 > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 300)


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
    fox = scene_of("fox", (0.1, 0.2), regime=regime(0, None, 300))
    for method in fox.methods:
        rows = pd.read_csv(method.metrics)
        rows[rows["test_set"] == "standard"].to_csv(method.metrics, index=False)
    scenes.append(fox)
    paths = [tmp_path / f"out.{end}" for end in ("csv", "tex", "png")]
    regimes.main(
        ["--rows", table_rows.as_json(scenes)]
        + [
            f"{o}={p}"
            for o, p in zip(("--csv", "--tex", "--figure"), paths, strict=True)
        ]
    )
    csv, tex, png = paths
    table = pd.read_csv(csv)
    assert len(table) == 5 * 3 * 2 + 3
    shown = pd.concat(regimes_plot.compared(rows) for _, rows in table.groupby("scene"))
    assert set(shown["method"]) == {"convolution", "alignment"}
    assert set(shown["scene"]) == set(table["scene"])
    titles = [title for title, *_ in regimes_plot.panels(shown)]
    assert titles == ["nothing moves", "objects move", "budget", "scenes"]
    text = tex.read_text()
    assert text.count(r"\emph{") == 6
    assert "poses off by 2 px, motion 2 cm, 200 steps" in text
    assert "poses off by 2 px, still, 100 steps" in text
    assert "fox, 300 steps" in text
    assert png.read_bytes().startswith(b"\x89PNG")
    origin = json.loads((tmp_path / "out.provenance.json").read_text())
    labels = [(row["scene"], row["method"]) for row in origin["rows"]]
    assert labels == [(s.scene, m.method) for s in scenes for m in s.methods]
    assert len(origin["rows"][1]["trainings"]) == 2


def test_a_view_without_a_length_leaves_the_misalignment_empty(scene_of):
    scenes = [
        scene_of("a", (0.5, 1.5), regime=regime()),
        scene_of("b", (0.5, 1.5), regime=regime(), seed=1),
    ]
    lengths = pd.DataFrame({"median_px": [1.0, np.nan]})
    lengths.to_csv(scenes[1].displacement, index=False)
    table = regimes.make_table(scenes)
    assert table["misalignment_px"].isna().all()
    assert table["psnr_db"].notna().all()
    assert "flow -- px" in regimes.to_latex(table)


def test_a_view_without_a_score_leaves_its_test_set_empty(scene_of):
    scene = scene_of("a", (0.5, 1.5), regime=regime())
    metrics = scene.methods[1].metrics
    views = pd.read_csv(metrics)
    views.loc[(views["view"] == "v1") & (views["test_set"] == "oracle"), "psnr_db"] = (
        np.nan
    )
    views.to_csv(metrics, index=False)
    table = regimes.make_table([scene])
    row = one(table, method="convolution", test_set="oracle")
    assert np.isnan([row["psnr_db"], row["difference_db"], row["step_db"]]).all()
    assert np.isfinite(one(table, method="convolution", test_set="standard")["psnr_db"])
    # What stands below it has lost what it is set against.
    assert np.isnan(one(table, method="alignment", test_set="oracle")["step_db"])
    (line,) = [x for x in regimes.to_latex(table).splitlines() if "convolution" in x]
    assert "& -- & -- &" in line
    assert "nan" not in regimes.to_latex(table)
