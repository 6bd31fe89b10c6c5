"""The misalignment table: means, costs, colours, from hand-made scores."""

import json

import numpy as np
import pandas as pd
import pytest

from alignerf import show
from alignerf.tables import columns, intervals, misalignment, scores
from tests import table_cases
from tests.table_cases import cells, made

SETS = ("standard", "standard_valid", "warped", "control")
DIFFERENCE = scores.with_ends("difference_")


@pytest.fixture
def row(rng):
    """A method after a round, set against another; all metrics are random."""

    def random():
        return {
            name: {metric: rng.uniform(15, 25, 3) for metric in columns.METRICS}
            for name in SETS
        }

    base = table_cases.row(random(), "plain")
    return table_cases.row(random(), "my_method", 1, base=base)


def test_a_row_per_test_set_with_means_and_all_costs_so_far(row):
    table = made(misalignment.make_table, [row])
    assert table["test_set"].tolist() == ["standard", "warped", "control"]
    for line in table.to_dict("records"):
        assert line.items() >= {"method": "my_method", "warping": "once"}.items()
        assert line.items() >= table_cases.COSTS.items()
        for key in columns.METRICS:
            own = row[row["test_set"] == line["test_set"]]
            assert line[key] == pytest.approx(own[key].mean())
    # Whole numbers stay whole beside rows that lack them.
    table = made(
        misalignment.make_table,
        [row, row.assign(round=2, **dict.fromkeys(table_cases.COSTS))],
    )
    assert table["rays_seen"].dtype == "Int64"
    assert table["rays_seen"].isna().tolist() == [False] * 3 + [True] * 3
    assert table["field"].tolist() == ["my_method"] * 6


def test_a_view_in_which_nothing_moves_has_no_part_in_what_moves():
    """A view that lacks another metric still empties its mean."""

    def moving_of(db):
        moving = {"psnr_db": [np.nan, db, db], "ssim": [np.nan, 0.5, 0.5]}
        return {"standard": [db] * 3, "oracle_moving": moving, "oracle_still": moving}

    base = table_cases.row(moving_of(20.0))
    table = made(
        misalignment.make_table, [table_cases.row(moving_of(21.0), "b", base=base)]
    )
    moving = table_cases.one(table, test_set="oracle_moving")
    assert (moving["psnr_db"], moving["difference_db"]) == (21.0, 1.0)
    assert np.isnan(table_cases.one(table, test_set="oracle_still")["psnr_db"])


@pytest.mark.parametrize("lost", [[0], [0, 1], [0, 1, 2]])
def test_differences_are_of_views_that_both_rows_have(lost):
    """A view whose camera is uncertain is left out, of this row or of its base."""
    every = np.arange(3.0)
    base, own = 20 + 5 * every, 21 + 5 * every
    own[lost] = base[1] = np.nan
    row = None
    for name, db in (("plain", base), ("b", own)):
        scores = {"psnr_db": db, "ssim": db * np.nan}
        row = table_cases.row({"aligned_pose": scores}, name, base=row)
    table = made(misalignment.make_table, [row])
    found = table_cases.one(table, method="b", test_set="aligned_pose")
    kept = [view for view in range(3) if view not in lost]
    wanted = own[kept].mean() if kept else np.nan
    assert found["psnr_db"] == pytest.approx(wanted, nan_ok=True)
    gain = 1.0 if set(kept) - {1} else np.nan
    assert found["difference_db"] == pytest.approx(gain, nan_ok=True)


def test_differences_to_the_base_are_paired_by_view(row):
    for line in made(misalignment.make_table, [row]).to_dict("records"):
        own = row[row["test_set"] == line["test_set"]]
        each = (own["psnr_db"] - own["base_db"]).to_numpy()
        assert line["difference_to"] == "plain"
        assert line["difference_db"] == pytest.approx(each.mean())
        low, high = intervals.mean_interval(each)
        assert [line[key] for key in DIFFERENCE[1:]] == [low, high]
        # What a view is hard for both does not widen it.
        assert high - low < np.ptp(each) + 1e-9
    own = made(misalignment.make_table, [row.assign(base_db=row["psnr_db"])])
    assert own[DIFFERENCE].eq(0).all(axis=None)


def test_warpings_have_the_names_of_the_paper(row):
    rows = [row.assign(round=number) for number in (0, 1, 2, 5)]
    names = made(misalignment.make_table, rows)["warping"].drop_duplicates()
    assert names.tolist() == ["none", "once", "twice", "5 times"]


def make_table(psnr, lpips=np.nan):
    """A table of len(psnr) methods on the standard test set."""
    table = pd.DataFrame(columns=columns.names("misalignment"), index=range(len(psnr)))
    db = np.array(psnr, float)
    made = table.assign(
        method=[f"method_{number}" for number in range(len(psnr))],
        field="mlp 8",
        warping="none",
        test_set="standard",
        psnr_db=db,
        ssim=0.5,
        lpips_alex=lpips,
        difference_to="method_0",
        difference_db=db - db[0],
        difference_low_db=db - db[0] - 0.5 * (np.arange(len(db)) > 0),
        difference_high_db=db - db[0] + 0.5 * (np.arange(len(db)) > 0),
        train_time_s=60.0,
        data_time_s=30.0,
        total_time_s=90.0,
        params=2_500_000,
        steps=1,
        rays_seen=1,
    )
    return made.astype({"lpips_vgg": float})


def test_the_table_of_latex_is_whole():
    tex = misalignment.to_latex(make_table([20.123, np.nan]))
    assert cells(tex)[0][0] == r"method\_0"
    assert cells(tex)[0][2].endswith("20.12")
    assert cells(tex)[1][2] == "--"
    assert cells(tex)[0][-4:] == ["1.0", "0.5", "1.5", "2.50"]
    for name in ("toprule", "midrule", "bottomrule", "begin{tabular}", "end{tabular}"):
        assert tex.count("\\" + name) == 1
    # Without weights there is no column of LPIPS.
    assert r"LPIPS (Alex) $\downarrow$" not in tex
    tex = misalignment.to_latex(make_table([20.0], [0.5]))
    assert r"LPIPS (Alex) $\downarrow$" in tex
    assert "No lpips_vgg column" in tex
    table = make_table([20.0], [0.5]).assign(lpips_vgg=0.4)
    (line,) = cells(misalignment.to_latex(table))
    assert [cell[-5:] for cell in line[4:6]] == ["0.500", "0.400"]


def test_names_of_test_sets_are_escaped_and_methods_stand_once(row):
    row = row.replace({"test_set": {"warped": "aligned_pose"}})
    rows = [row.assign(round=0), row]
    tex = misalignment.to_latex(made(misalignment.make_table, rows))
    assert r"& aligned\_pose &" in tex
    assert "aligned_pose" not in tex
    assert [line[:2] for line in cells(tex)] == [
        [r"my\_method", "none"],
        ["", "once"],
    ]


def test_on_the_screen(capsys, tmp_path):
    folder = tmp_path / "my_scene" / "tables"
    folder.mkdir(parents=True)
    make_table([20, 20.3, 21]).to_csv(folder / "misalignment.csv", index=False)
    show.main([str(tmp_path)])
    lines = capsys.readouterr().out.splitlines()
    shown = {line.split()[0]: line.split() for line in lines if "method_" in line}
    assert shown["method_0"][2:4] == ["20.00", "60"]
    assert shown["method_1"][2:5] == ["20.30", "+0.30", "60"]
    # Training and data together.
    assert shown["method_2"][2:6] == ["21.00", "+1.00*", "60", "90"]


def test_who_stays_below_the_baseline_is_told_why(tmp_path):
    table = make_table([20, 19.7, 21, 18])
    staged = ["method_1", "method_2", "method_3"]
    # Only beyond chance: method_1 is 0.30 dB below, give or take 0.50.
    (line,) = show.below_baseline(table, staged)
    assert line.startswith("method_3 is 2.00 dB worse than method_0 (standard). ")
    assert not list(show.below_baseline(table, staged[:2]))
    config = {"methods": {"a": {"alignerf": None}, "b": {"alignerf": {"patches": 4}}}}
    assert show.staged_of(tmp_path) == []
    (tmp_path / "config.yaml").write_text(json.dumps(config))
    assert show.staged_of(tmp_path) == ["b"]


def test_a_table_fits_into_a_narrow_terminal(monkeypatch):
    table = pd.DataFrame({f"column {n}": [1.5, 2.5] for n in range(12)})
    assert len(show.fitting(table).splitlines()) == 3
    monkeypatch.setattr(show.sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "72")
    shown = show.fitting(table).splitlines()
    assert max(map(len, shown)) <= 72
    assert len(shown) > 6
