"""The tables of controls and of ranking, from hand-made scores."""

import itertools

import numpy as np
import pandas as pd
import pytest

from alignerf import show
from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import controls, intervals, ranking
from tests import table_cases

VIEWS = [f"view_{number}" for number in range(6)]
MOVED = (
    *("aligned_pose", "aligned_pose_leak"),
    *("aligned_pose_gradient", "aligned_pose_gradient_leak"),
)
SETS = (*sorted(controls.NEEDED), "oracle", *MOVED)


@pytest.fixture
def entries(tmp_path, rng):
    """Two methods of two rounds with random scores."""
    found = []
    for method, round in itertools.product(("plain_one", "other"), (0, 1)):
        path = tmp_path / f"{method}{round}.csv"
        write(path, {name: rng.uniform(15, 25, len(VIEWS)) for name in SETS})
        found.append(table_rows.Scores(method, round, str(path)))
    return found


def write(path, psnr_db):
    """Scores {test set: [views]} as evaluate writes them."""
    rows = [
        {"view": view, "test_set": name, "psnr_db": value, "ssim": 0.5}
        for name, values in psnr_db.items()
        for view, value in zip(VIEWS, values, strict=True)
    ]
    pd.DataFrame(rows).to_csv(path, index=False)


def psnr_of(entry):
    scores = pd.read_csv(entry.metrics)
    return scores.pivot(index="view", columns="test_set", values="psnr_db")


def test_a_gain_is_the_sum_of_its_parts(entries):
    table = controls.make_table(entries)
    assert tuple(table.columns) == controls.COLUMNS
    lines = table.drop_duplicates(["method", "warping"])[["method", "warping"]]
    assert lines.values.tolist() == [
        ["plain_one", "none"],
        ["plain_one", "once"],
        ["other", "none"],
        ["other", "once"],
    ]
    for entry, (_, rows) in zip(
        entries, table.groupby(["method", "warping"], sort=False), strict=True
    ):
        db = rows.set_index("quantity")["db"]
        psnr = psnr_of(entry).mean()
        assert db["gain"] == pytest.approx(psnr["warped"] - psnr["standard"])
        assert db["choice"] == pytest.approx(psnr["standard_valid"] - psnr["standard"])
        assert db["resampling"] == pytest.approx(psnr["control"] - psnr["standard"])
        assert db["placebo"] == pytest.approx(psnr["placebo"] - psnr["standard"])
        assert db["leak"] == pytest.approx(psnr["leak"] - psnr["leak_held_out"])
        assert db["displaced"] == pytest.approx(psnr["leak_held_out"] - psnr["aligned"])
        # On the pixels of the warped photo, not on all.
        assert db["held_out"] == pytest.approx(
            psnr["held_out"] - psnr["standard_valid"]
        )
        assert db["oracle_gain"] == pytest.approx(psnr["oracle"] - psnr["standard"])
        pose, pose_leak, gradient, gradient_leak = psnr[list(MOVED)]
        assert db["pose_gain"] == pytest.approx(pose - psnr["standard"])
        assert db["pose_leak"] == pytest.approx(pose_leak - psnr["oracle"])
        assert db["gradient_gain"] == pytest.approx(gradient - psnr["standard"])
        assert db["gradient_leak"] == pytest.approx(gradient_leak - psnr["oracle"])
        assert db["gain"] == pytest.approx(
            db["choice"] + db["resampling"] + db["leak"] + db["remains"]
        )
        assert set(rows["views"]) == {len(VIEWS)}


def test_intervals_are_of_differences_view_by_view(entries, rng):
    # A view that is 10 dB harder for both is no doubt about the difference.
    hard = rng.uniform(-10, 10, len(VIEWS))
    path = entries[0].metrics
    write(path, {name: 20 + hard + (name == "warped") for name in SETS})
    rows = controls.make_table(entries[:1]).set_index("quantity")
    assert rows.loc["gain", ["db", "low_db", "high_db"]].tolist() == pytest.approx(
        [1, 1, 1]
    )
    low, high = intervals.mean_interval(20 + hard)
    assert rows.loc["standard", "low_db"] == pytest.approx(low)
    assert rows.loc["standard", "high_db"] == pytest.approx(high)
    assert high - low > 2


def test_without_an_oracle_its_columns_are_not_there(entries):
    scores = pd.read_csv(entries[0].metrics)
    known = ~scores["test_set"].isin(["oracle", *MOVED])
    scores[known].to_csv(entries[0].metrics, index=False)
    table = controls.make_table(entries[:1])
    later = list(controls.HEADINGS)[list(controls.HEADINGS).index("oracle") :]
    assert not {*later} & set(table["quantity"])
    assert "oracle" not in controls.to_latex(table)
    assert "oracle gain" in controls.to_latex(controls.make_table(entries[1:]))


def test_a_view_without_a_score_leaves_its_quantities_empty(entries):
    scores = pd.read_csv(entries[0].metrics)
    missing = (scores["view"] == VIEWS[2]) & (scores["test_set"] == "control")
    scores.loc[missing, "psnr_db"] = np.nan
    scores.to_csv(entries[0].metrics, index=False)
    table = controls.make_table(entries[:1]).set_index("quantity")
    for quantity in ("resampling", "remains"):
        assert table.loc[quantity, ["db", "low_db", "high_db"]].isna().all()
    assert np.isfinite(table.loc["gain", "db"])
    assert "--" in controls.to_latex(table.reset_index())


def test_the_table_of_latex_marks_what_is_beyond_chance(entries):
    tex = controls.to_latex(controls.make_table(entries))
    body = tex.split(r"\midrule")[1].split(r"\bottomrule")[0]
    lines = [line for line in body.splitlines() if "&" in line]
    assert len(lines) == len(entries)
    assert {line.count("&") for line in lines} == {1 + len(controls.HEADINGS)}
    assert r"plain\_one" in lines[0]
    assert "Method" in tex
    cell = controls.cell
    assert cell("gain", 1.0, 0.5, 1.5) == r"\textbf{+1.00} {\tiny [+0.50, +1.50]}"
    assert cell("remains", -0.1, -0.5, 0.5) == r"-0.10 {\tiny [-0.50, +0.50]}"
    assert cell("warped", 20.0, 19.0, 21.0) == "20.00"


def ranked(entries, oracle, other):
    """Entries whose oracle and `other` means are these, each view alike."""
    for entry, of_oracle, of_other in zip(entries, oracle, other, strict=True):
        values = dict.fromkeys(SETS, np.full(len(VIEWS), of_other))
        values["oracle"] = np.full(len(VIEWS), of_oracle)
        write(entry.metrics, values)
    return ranking.make_table(entries).set_index("test_set")


def test_tau_counts_pairs_in_the_same_order(entries):
    assert ranked(entries, [1, 2, 3, 4], [5, 6, 7, 8])["tau"].tolist() == [1.0] * 5
    assert ranked(entries, [1, 2, 3, 4], [8, 7, 6, 5])["tau"].tolist() == [-1.0] * 5
    # Five pairs of six in the same order, one not.
    table = ranked(entries, [1, 2, 3, 4], [5, 7, 6, 8])
    np.testing.assert_allclose(table["tau"], (5 - 1) / 6)
    # The same for every view, so for every draw of views.
    np.testing.assert_allclose(table["tau_low"], table["tau"])
    np.testing.assert_allclose(table["tau_high"], table["tau"])
    # Tau-b: a tie in one is a pair for the other alone.
    tied = ranked(entries, [1, 2, 3, 4], [5, 5, 7, 8])
    np.testing.assert_allclose(tied["tau"], 5 / np.sqrt(6 * 5))
    assert ranked(entries, [1, 2, 3, 4], [5, 5, 5, 5])["tau"].isna().all()


def test_an_interval_of_tau_is_over_views(entries, rng):
    # Noise of single views is larger than what the methods differ in.
    for number, entry in enumerate(entries):
        noise = rng.normal(size=(len(SETS), len(VIEWS)))
        write(entry.metrics, dict(zip(SETS, 20 + 0.5 * number + noise, strict=True)))
    table = ranking.make_table(entries)
    assert (table["rows"] == 4).all()
    assert (table["views"] == 6).all()
    assert ((table["tau_low"] <= table["tau"]) & (table["tau"] <= 1)).all()
    assert (table["tau_low"] < 0.7).all()
    again = ranking.make_table(entries)
    pd.testing.assert_frame_equal(again, table)


def test_a_set_that_some_row_lacks_is_not_ranked(entries):
    scores = pd.read_csv(entries[0].metrics)
    known = scores["test_set"] != "aligned_pose"
    scores[known].to_csv(entries[0].metrics, index=False)
    assert ranking.make_table(entries)["test_set"].tolist() == [*ranking.TEST_SETS]


def test_scores_of_moved_cameras_lie_in_a_file_of_their_own(entries, tmp_path):
    whole = controls.make_table(entries[:1])
    scores = pd.read_csv(entries[0].metrics)
    more, moved = tmp_path / "more.csv", scores["test_set"].isin(MOVED)
    scores[moved].to_csv(more, index=False)
    scores[~moved].to_csv(entries[0].metrics, index=False)
    apart = entries[0]._replace(aligned_pose=str(more))
    pd.testing.assert_frame_equal(controls.make_table([apart]), whole)
    scores[moved & (scores["view"] != VIEWS[0])].to_csv(more, index=False)
    with pytest.raises(ValueError, match=r"more\.csv: not the views of"):
        controls.make_table([apart])


@pytest.mark.parametrize("module", [controls, ranking])
def test_as_commands(entries, tmp_path, module):
    name = module.__name__.rpartition(".")[2]
    csv, tex = table_cases.make(name, entries, tmp_path / "tables")
    assert tuple(pd.read_csv(csv).columns) == module.COLUMNS
    tex = tex.read_text()
    assert tex.count(r"\begin{tabular}") == tex.count(r"\end{tabular}") == 1
    found = sorted(path.name for path in csv.parent.iterdir())
    assert found == [f"{name}.{kind}" for kind in ("csv", "provenance.json", "tex")]


@pytest.mark.parametrize("module", [controls, ranking])
@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda s: s[s["test_set"] != "held_out"], "no test set 'held_out'"),
        (lambda s: s.drop(columns="test_set"), "not the scores of views"),
        (lambda s: pd.concat([s, s]), "not the scores of views"),
    ],
)
def test_bad_scores_are_named_and_nothing_written(
    entries, tmp_path, module, damage, reason
):
    path = entries[1].metrics
    damage(pd.read_csv(path)).to_csv(path, index=False)
    name = module.__name__.rpartition(".")[2]
    with pytest.raises(ValueError, match=rf"plain_one1\.csv: {reason}"):
        table_cases.make(name, entries, tmp_path / "tables")
    assert not (tmp_path / "tables").exists()


def test_other_views_are_not_ranked_together(entries):
    scores = pd.read_csv(entries[2].metrics)
    scores[scores["view"] != VIEWS[0]].to_csv(entries[2].metrics, index=False)
    with pytest.raises(ValueError, match=r"other0\.csv: not the views"):
        ranking.make_table(entries)


def test_on_the_screen(entries):
    table = controls.make_table(entries)
    shown = show.breakdown(table)
    assert list(shown.index) == [
        ("plain_one", "none"),
        ("plain_one", "once"),
        ("other", "none"),
        ("other", "once"),
    ]
    rows = table[table["quantity"] == "remains"]["db"].round(2)
    assert shown["remains"].tolist() == rows.tolist()
