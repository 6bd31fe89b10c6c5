"""Remedies at equal time, from curves that are known."""

import json

import numpy as np
import pandas as pd
import pytest

from alignerf.experiment.tables import regimes as regime_rows
from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import remedies
from alignerf.tables.plots import remedies as remedies_plot
from alignerf.tables.plots import sizes as sizes_plot

VIEWS = ["a", "b", "c"]
SHARES = (0.5, 1, 2, 4)
BASE_S = 100.0


@pytest.fixture
def row(tmp_path):
    """(name, seed, share, {method: (dB of views, seconds)}) -> its row, with files."""

    def write(
        name, seed, share, found, *, test_sets=("standard", "oracle"), width_px=200
    ):
        methods = []
        scene = tmp_path / f"{name}_{seed}_{share:g}"
        facts = {"width_px": width_px, "height_px": 150, "pixel_angle_mrad": 2.0}
        scene.with_suffix(".facts.json").write_text(json.dumps(facts))
        # A fixed angle, whose pixels grow with the size.
        flow_px = width_px / 400 * np.array([0.5, 1.0, 9.0])
        displacement = scene.with_suffix(".flow.csv")
        pd.DataFrame({"median_px": flow_px}).to_csv(displacement, index=False)
        for round, (method, (views_db, seconds)) in enumerate(found.items()):
            path = tmp_path / f"{name}_{seed}_{share:g}x_{method}".replace(".", "_")
            lines = [
                {"view": view, "test_set": test_set, "psnr_db": db + place, "ssim": 1}
                for place, test_set in enumerate(test_sets)
                for view, db in zip(VIEWS, views_db, strict=True)
            ]
            pd.DataFrame(lines).to_csv(f"{path}.csv", index=False)
            costs = {"train_time_s": seconds - 3, "steps": 1}
            costs |= {"rays_seen": 1, "params": 1}
            path.with_suffix(".json").write_text(json.dumps(costs))
            data = path.with_suffix(".data.json")
            data.write_text(json.dumps({"time_s": 3.0}))
            files = ([f"{path}.json"], [str(data)])
            methods.append(
                regime_rows.Method(method, round, method, f"{path}.csv", *files)
            )
        return regime_rows.Remedies(
            scene=f"{name}_x{share}",
            seed=seed,
            alike=name,
            # What stands before its size.
            capture=name.split("-")[0],
            facts=str(scene.with_suffix(".facts.json")),
            displacement=str(displacement),
            share=share,
            methods=methods,
        )

    return write


def curves(share, *, plain_db=20.0, gain_db=1.5, cost=2.0):
    """dB rise by 1 with each doubling; a remedy has more, and takes longer."""
    views = np.array([-2.0, 0.0, 2.0]) + plain_db + np.log2(share)
    return {
        "plain": (views, BASE_S * share),
        "fix": (views + gain_db, cost * BASE_S * share),
    }


@pytest.fixture
def rows(row):
    return [
        row("wrong", seed, share, curves(share, plain_db=20 + seed))
        for seed in (0, 2)
        for share in SHARES
    ]


def one(table, **keys):
    chosen = np.logical_and.reduce([table[key] == value for key, value in keys.items()])
    (found,) = table[chosen].to_dict("records")
    return found


def test_scores_are_read_off_at_equal_time(rows):
    table = remedies.make_table(remedies.conditions_of(rows))
    assert tuple(table.columns) == remedies.COLUMNS
    assert list(dict.fromkeys(table["budget"])) == [1, 2, 4]
    for budget in (1, 2, 4):
        plain = one(table, budget=budget, method="plain", test_set="oracle")
        assert plain["time_s"] == pytest.approx(budget * BASE_S)
        # Mean of seeds 0 and 2, and the oracle is 1 dB above.
        assert plain["psnr_db"] == pytest.approx(22 + np.log2(budget))
        assert plain["gain_db"] == 0
        fix = one(table, budget=budget, method="fix", test_set="oracle")
        # It costs twice the time, which is worth 1 dB of its 1.5.
        assert fix["gain_db"] == pytest.approx(0.5)
        assert fix["gain_low_db"] == pytest.approx(0.5)
        assert (fix["seeds"], fix["views"], fix["warping"]) == (2, 6, "once")


def test_between_two_lengths_the_line_is_over_the_logarithm(row):
    rows = [
        row("wrong", 0, share, curves(share, cost=2.0 * 2**0.25)) for share in SHARES
    ]
    table = remedies.make_table(remedies.conditions_of(rows))
    found = one(table, budget=2, method="fix", test_set="standard")
    assert found["gain_db"] == pytest.approx(1.5 - 1.25)


def test_nothing_is_extrapolated(row):
    """Too dear for the shortest budget, and not trained long enough for the longest."""
    rows = [row("wrong", 0, s, curves(s, cost=3.0)) for s in SHARES]
    table = remedies.make_table(remedies.conditions_of(rows))
    fix = table[table["method"] == "fix"]
    assert set(fix["budget"]) == {2, 4}
    found = {}
    for share in SHARES:
        both = curves(share, cost=0.5)
        found[share] = row("other", 0, share, both)
    table = remedies.make_table(remedies.conditions_of(list(found.values())))
    assert set(table[table["method"] == "fix"]["budget"]) == {1, 2}
    # Seconds vary: a little too short counts as long enough.
    rows = [row("third", 0, s, curves(s, cost=0.96)) for s in SHARES]
    table = remedies.make_table(remedies.conditions_of(rows))
    assert one(table, budget=4, method="fix", test_set="oracle")["gain_db"] == 1.5


def test_budgets_that_plain_training_lacks_are_left_out(row):
    rows = [row("wrong", 0, share, curves(share)) for share in (0.25, 0.5, 1)]
    table = remedies.make_table(remedies.conditions_of(rows))
    assert set(table["budget"]) == {1}


def test_conditions_and_photos_without_truth_stand_apart(rows, row):
    fox = [
        row("fox", 0, share, curves(share), test_sets=("standard", "aligned_pose"))
        for share in SHARES
    ]
    conditions = remedies.conditions_of([*rows, *fox])
    table = remedies.make_table(conditions)
    assert list(dict.fromkeys(table["condition"])) == ["wrong_x0.5", "fox_x0.5"]
    assert set(table[table["condition"] == "fox_x0.5"]["test_set"]) == {
        "standard",
        "aligned_pose",
    }
    means = {one.name: remedies_plot.means_of(one) for one in conditions}
    assert means["fox_x0.5"]["plain"][2] == "standard"
    seconds, psnr_db, test_set = means["wrong_x0.5"]["fix"]
    assert test_set == "oracle"
    assert seconds == [2 * BASE_S * share for share in SHARES]
    np.testing.assert_allclose(psnr_db, 23.5 + np.log2(SHARES))
    tex = remedies.to_latex(table)
    assert r"fox\_x0.5, standard: 1.7, 3.3, 6.7 min" in tex
    assert r"22.50 & \textbf{+0.50}" in tex


def test_a_photo_is_one_view_however_many_seeds_there_are(row, rng):
    """Trainings of the same photos: their gains are averaged before the interval."""
    gains = rng.normal(size=3)
    pairs = [(20.0 + gains, np.full(3, 20.0))]
    once, thrice = (
        remedies.gain_of(pairs * count, same_photos=True) for count in (1, 3)
    )
    for key in ("gain_db", "gain_low_db", "gain_high_db"):
        assert once[key] == pytest.approx(thrice[key])
    assert (once["views"], thrice["views"]) == (3, 3)
    made = remedies.gain_of(pairs * 3, same_photos=False)
    assert made["views"] == 9
    assert made["gain_low_db"] > once["gain_low_db"]


def test_sizes_of_a_capture_are_set_side_by_side(row, rows, tmp_path, monkeypatch):
    """Its flow in pixels and as an angle, and a figure of gains by size."""
    sized = [
        row(f"fox-{width}", seed, s, curves(s, gain_db=width / 200), width_px=width)
        for width in (400, 200)
        for seed in (0, 2)
        for s in SHARES
    ]
    conditions = remedies.conditions_of([*sized, *rows])
    table = remedies.make_table(conditions)
    for width in (200, 400):
        chosen = table[table["condition"] == f"fox-{width}_x0.5"]
        found = one(chosen, method="fix", test_set="oracle", budget=2)
        assert (found["width_px"], found["seeds"]) == (width, 2)
        # The median view's.
        assert found["flow_px"] == pytest.approx(width / 400)
        assert found["flow_mrad"] == pytest.approx(width / 200)
        assert found["gain_db"] == pytest.approx(width / 200 - 1)
    assert remedies.by_capture(conditions) == [["fox-400_x0.5", "fox-200_x0.5"]]
    assert remedies.by_capture(remedies.conditions_of(rows)) == []
    drawn = {}
    monkeypatch.setattr(
        "matplotlib.axes.Axes.errorbar",
        lambda axes, x, y, *args, label, color, **_: drawn.update(
            {label: (list(x), list(y), color)}
        ),
    )
    path = tmp_path / "sizes.png"
    sizes_plot.draw(table, remedies.by_capture(conditions), path)
    assert path.stat().st_size > 10_000
    # From small to large; the largest budget of those that all sizes have.
    assert drawn["plain"] == ([200, 400], [0, 0], "black")
    assert drawn["fix"][0] == [200, 400]
    np.testing.assert_allclose(drawn["fix"][1], [0, 1], atol=1e-9)
    assert sizes_plot.budget_of(table) == 4
    assert sizes_plot.budget_of(table[table["budget"] < 4]) == 2
    # A remedy has one colour, whichever a capture lacks.
    lacking = table[(table["method"] != "fix") | (table["width_px"] == 200)]
    sizes_plot.draw(lacking, [["fox-400_x0.5"], ["fox-200_x0.5"]], path)
    assert drawn["fix"][2] == remedies_plot.COLOURS[0]
    assert drawn["plain"][2] == "black"


def test_the_flow_of_a_size_is_the_mean_of_its_seeds(row, rows):
    more = row("wrong", 3, 1, curves(1), width_px=200)
    pd.DataFrame({"median_px": [3.5]}).to_csv(more.displacement, index=False)
    (condition,) = remedies.conditions_of([*rows, more])
    size = next(remedies.lines_of(condition))
    assert (size["width_px"], size["height_px"]) == (200, 150)
    # A number of pixels is whole, in the table too.
    assert isinstance(size["width_px"], int)
    assert size["flow_px"] == pytest.approx((0.5 + 0.5 + 3.5) / 3)


def test_faults_are_named(rows, row):
    with pytest.raises(ValueError, match=r"wrong_x1: the same as another scene"):
        remedies.conditions_of([*rows, row("wrong", 0, 1, curves(1))])
    # Of another length of the same scene.
    path = rows[3].methods[1].metrics
    table = pd.read_csv(path)
    table[table["view"] != "a"].to_csv(path, index=False)
    with pytest.raises(ValueError, match="not the views of the others"):
        remedies.conditions_of(rows)


def test_as_a_command(rows, tmp_path):
    out = {kind: tmp_path / f"remedies.{kind}" for kind in ("csv", "tex", "png")}
    places = [f"--csv={out['csv']}", f"--tex={out['tex']}", f"--figure={out['png']}"]
    remedies.main(["--rows", table_rows.as_json(rows), *places])
    assert pd.read_csv(out["csv"])["method"].tolist()[0] == "plain"
    assert out["png"].stat().st_size > 10_000
    assert out["tex"].read_text().count(r"\midrule") == 1
