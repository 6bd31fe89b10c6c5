"""alignerf.tables.across.regimes: pooled over seeds, paired by view."""

import itertools
import json

import numpy as np
import pandas as pd
import pytest

from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import columns, plots
from alignerf.tables.across import regimes
from tests import table_cases
from tests.table_cases import made, one

ROWS = [("mipnerf360", 0), ("convolution", 0), ("alignment", 0), ("mipnerf360", 1)]


@pytest.fixture
def scene_of(tmp_path, rng):
    """(name, dB of each row over the baseline, ...) -> its scene."""

    def make(name, gains, *, view_db=(20.0, 24.0, 22.0), noise=0.0, seed=0, **like):
        path = tmp_path / name / regimes.FLOW
        table_cases.put(path, pd.DataFrame({"median_px": [1.0, 2.0]}))
        rows = []
        for place, gain in enumerate((0, *gains)):
            own = np.array(view_db) + gain + (place > 0) * noise * rng.normal(size=3)
            trained, round = 1 + (place > 0), ROWS[place][1]
            costs = {"train_time_s": (10 + place) * trained, "data_time_s": 3 * round}
            costs["total_time_s"] = sum(costs.values())
            costs |= {"steps": 1, "rays_seen": 7 * trained, "params": place}
            db = {"standard": own, "oracle": own + 1}
            rows.append(table_cases.row(db, *ROWS[place], costs=costs))
        like = {"perturb_px": 1.0, "motion_m": 0.0, "steps": 100} | like
        fields = like | {"like": json.dumps(like), "seed": seed}
        return table_cases.scored(name, rows, **fields)

    return make


def without(scene, place, test_set):
    """The scene, one of whose rows lacks a test set."""
    return table_cases.without(scene, method=ROWS[place][0], test_set=test_set)


def test_minutes_show_the_steps_that_they_came_to(scene_of, tmp_path):
    table = made(regimes.make_table, [scene_of("a", (0, 0, 0), steps=None)], tmp_path)
    assert set(table["steps"]) == {1}


def test_seeds_are_pooled_and_regimes_are_not(scene_of, tmp_path):
    scenes = [
        scene_of("a", (0.5, 1.5)),
        scene_of("b", (0.1, 0.5), seed=1),
        scene_of("c", (-1.0, -1.0), perturb_px=4.0),
    ]
    table = made(regimes.make_table, scenes, tmp_path)
    assert list(table.columns) == columns.names("regimes")
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


def test_the_baseline_on_warped_photos_stands_last(scene_of, caplog, tmp_path):
    table = made(regimes.make_table, [scene_of("a", (0.5, 1.5, 2.5))], tmp_path)
    keys = {"method": "mipnerf360", "test_set": "oracle"}
    row = one(table, warping="once", **keys)
    assert row["difference_db"] == pytest.approx(2.5)
    assert row["step_db"] == pytest.approx(1.0)
    assert (row["train_time_s"], row["data_time_s"], row["total_time_s"]) == (26, 3, 29)
    assert one(table, warping="none", **keys)["total_time_s"] == 10
    # Of several trainings it has more rays, and that is no fault.
    assert "mipnerf360 saw" not in caplog.text
    assert "a: convolution saw 2.00 of the baseline's rays" in caplog.text
    assert "& mipnerf360, warped once &" in regimes.to_latex(table)
    assert set(plots.compared(table)["row"]) == {
        "convolution",
        "alignment",
        "mipnerf360, warped once",
    }


@pytest.mark.parametrize("first", [0, 1])
def test_a_round_that_one_seed_lacks_is_left_out_and_told(
    scene_of, caplog, first, tmp_path
):
    scenes = [scene_of("a", (0.5, 1.5)), scene_of("b", (0.1, 0.5, 9.0), seed=1)]
    table = made(regimes.make_table, scenes[::-1] if first else scenes, tmp_path)
    assert set(table["warping"]) == {"none"}
    row = one(table, method="alignment", test_set="oracle")
    assert row["difference_db"] == pytest.approx(1.0)
    assert "not on all seeds, left out: mipnerf360, warped once" in caplog.text


def test_how_unlike_views_are_is_no_part_of_the_interval(scene_of, tmp_path):
    table = made(regimes.make_table, [scene_of("a", (0.2, 0.3))], tmp_path)
    row = one(table, method="convolution", test_set="standard")
    assert row["difference_low_db"] == pytest.approx(0.2)
    assert row["difference_high_db"] == pytest.approx(0.2)


def test_the_same_scene_twice_is_refused_by_name(scene_of, tmp_path):
    with pytest.raises(ValueError, match="b: the same as a"):
        made(
            regimes.make_table, [scene_of(name, (0.5, 1.5)) for name in "ab"], tmp_path
        )


def test_a_flow_that_is_none_is_named(scene_of, tmp_path):
    scene = scene_of("a", (0.5, 1.5))
    table_cases.put(tmp_path / "a" / regimes.FLOW, "view\nv\n")
    reason = r"displacement\.csv: .*: no column median_px"
    with pytest.raises(ValueError, match=reason):
        made(regimes.make_table, [scene], tmp_path)


def test_a_test_set_that_one_method_lacks_is_left_out(scene_of, tmp_path):
    scene = without(scene_of("a", (0.5, 1.5)), 2, "oracle")
    assert set(made(regimes.make_table, [scene], tmp_path)["test_set"]) == {"standard"}


def test_latex_has_a_block_a_regime_and_the_figure_a_panel_a_kind(scene_of, tmp_path):
    chosen = [*itertools.product((0, 2), (0.0, 0.02), (100,)), (2, 0.02, 200)]
    keys = ("perturb_px", "motion_m", "steps")
    scenes = [
        scene_of(f"{k}", (0.5, 1.0), noise=0.1, **dict(zip(keys, like, strict=True)))
        for k, like in enumerate(chosen)
    ]
    fox = scene_of("fox", (0.1, 0.2), perturb_px=0, motion_m=None, steps=300)
    scenes.append(without(fox, 0, "oracle"))
    table = made(regimes.make_table, scenes, tmp_path)
    assert len(table) == 5 * 3 * 2 + 3
    shown = pd.concat(plots.compared(rows) for _, rows in table.groupby("scene"))
    assert set(shown["method"]) == {"convolution", "alignment"}
    assert set(shown["scene"]) == set(table["scene"])
    titles = [title for title, *_ in plots.panels(shown)]
    assert titles == ["nothing moves", "objects move", "budget", "scenes"]
    text = regimes.to_latex(table)
    blocks = [line[0] for line in table_cases.cells(text)]
    assert len([block for block in blocks if block]) == 6
    assert "poses off by 2 px, motion 2 cm, 200 steps, flow 1.50 px" in text
    assert "poses off by 2 px, still, 100 steps" in text
    assert "fox, 300 steps" in text
    # It lacks what the others have; nothing is in all columns of a block's head.
    assert table_cases.cells(text)[-1][3] == "--"


def test_a_view_without_a_length_leaves_the_misalignment_empty(scene_of, tmp_path):
    scenes = [scene_of(name, (0.5, 1.5), seed=k) for k, name in enumerate("ab")]
    lengths = pd.DataFrame({"median_px": [1.0, np.nan]})
    table_cases.put(tmp_path / "b" / regimes.FLOW, lengths)
    table = made(regimes.make_table, scenes, tmp_path)
    assert table["misalignment_px"].isna().all()
    assert table["psnr_db"].notna().all()
    assert "flow -- px" in regimes.to_latex(table)


def test_a_view_without_a_score_leaves_its_test_set_empty(scene_of, tmp_path):
    lost = {"method": "convolution", "test_set": "oracle", "view": "v1"}
    scene = table_cases.emptied(scene_of("a", (0.5, 1.5)), **lost)
    table = made(regimes.make_table, [scene], tmp_path)
    row = one(table, method="convolution", test_set="oracle")
    assert np.isnan([row["psnr_db"], row["difference_db"], row["step_db"]]).all()
    assert np.isfinite(one(table, method="convolution", test_set="standard")["psnr_db"])
    # What stands below it has lost what it is set against.
    assert np.isnan(one(table, method="alignment", test_set="oracle")["step_db"])
    (line,) = [x for x in regimes.to_latex(table).splitlines() if "convolution" in x]
    assert line.count("--") == 2
    assert "nan" not in regimes.to_latex(table)


def test_as_a_command(tmp_path):
    """Two seeds, of a folder each; their rows stand in provenance."""
    db = {"standard": [20.0, 22.0]}
    scenes = []
    for seed, name in enumerate("ab"):
        folder = tmp_path / name
        rows = [table_cases.written(folder, db, m, base="m") for m in ("m", "n")]
        rows.append(table_cases.written(folder, db, "m", 1))
        table_cases.collect(folder, rows, "regimes")
        table_cases.put(folder / regimes.FLOW, "median_px\n1\n")
        scenes.append(table_cases.scene_like(name, like="one", seed=seed))
    options = {kind: f"{tmp_path}/out.{kind}" for kind in ("csv", "tex")}
    options |= {"scenes": table_rows.as_json(scenes), "results": str(tmp_path)}
    options["figure"] = f"{tmp_path}/out.png"
    regimes.main([f"--{name}={value}" for name, value in options.items()])
    table = pd.read_csv(tmp_path / "out.csv")
    assert table["method"].tolist() == ["m", "n", "m"]
    assert set(table["seeds"]) == {2}
    assert r"\toprule" in (tmp_path / "out.tex").read_text()
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")
    origin = json.loads((tmp_path / "out.provenance.json").read_text())
    labels = [(row["scene"], row["method"]) for row in origin["rows"]]
    assert labels == [(scene, method) for scene in "ab" for method in "mnm"]
    assert len(origin["rows"][2]["trainings"]) == 2
