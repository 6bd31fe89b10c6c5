"""Remedies at equal time, from curves that are known."""

import numpy as np
import pandas as pd
import pytest

from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import columns, costs, plots
from alignerf.tables.across import remedies
from tests import table_cases
from tests.table_cases import made, one

SHARES = (0.5, 1, 2, 4)
BASE_S = 100.0
SETS = ("standard", "oracle")


@pytest.fixture
def scene(tmp_path):
    """(name, seed, share, {method: (dB of views, seconds)}) -> its scene."""

    def make(name, seed, share, of_methods, *, test_sets=SETS, width_px=200):
        folder = tmp_path / (f"{name}_x{share}" + f"_seed{seed}" * bool(seed))
        facts = {"width_px": width_px, "height_px": 150, "pixel_angle_mrad": 2.0}
        table_cases.put(folder / "facts.json", facts)
        rows = [
            table_cases.row(
                {test_set: db + place for place, test_set in enumerate(test_sets)},
                *(method, round),
                costs={"total_time_s": seconds},
                # A fixed angle, whose pixels grow with the size.
                own={"flow_px": width_px / 400},
            )
            for round, (method, (db, seconds)) in enumerate(of_methods.items())
        ]
        # What stands before its size.
        fields = {"alike": name, "capture": name.split("-")[0], "seed": seed}
        return table_cases.scored(folder.name, rows, share=share, **fields)

    return make


def curves(share, *, plain_db=20.0, gain_db=1.5, cost=2.0):
    """dB rise by 1 with each doubling; a remedy has more, and takes longer."""
    views = np.array([-2.0, 0.0, 2.0]) + plain_db + np.log2(share)
    return {
        "plain": (views, BASE_S * share),
        "fix": (views + gain_db, cost * BASE_S * share),
    }


@pytest.fixture
def scenes(scene):
    return [
        scene("wrong", seed, share, curves(share, plain_db=20 + seed))
        for seed in (0, 2)
        for share in SHARES
    ]


def test_scores_are_read_off_at_equal_time(scenes, tmp_path):
    table = made(remedies.make_table, scenes, tmp_path)
    assert list(table.columns) == columns.names("remedies")
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


def test_between_two_lengths_the_line_is_over_the_logarithm(scene, tmp_path):
    scenes = [
        scene("wrong", 0, share, curves(share, cost=2.0 * 2**0.25)) for share in SHARES
    ]
    table = made(remedies.make_table, scenes, tmp_path)
    line = one(table, budget=2, method="fix", test_set="standard")
    assert line["gain_db"] == pytest.approx(1.5 - 1.25)


def test_nothing_is_extrapolated(scene, tmp_path):
    """Too dear for the shortest budget, and not trained long enough for the longest."""
    scenes = [scene("wrong", 0, s, curves(s, cost=3.0)) for s in SHARES]
    table = made(remedies.make_table, scenes, tmp_path)
    fix = table[table["method"] == "fix"]
    assert set(fix["budget"]) == {2, 4}
    scenes = [scene("other", 0, s, curves(s, cost=0.5)) for s in SHARES]
    table = made(remedies.make_table, scenes, tmp_path)
    assert set(table[table["method"] == "fix"]["budget"]) == {1, 2}
    # Seconds vary: a little too short counts as long enough.
    scenes = [scene("third", 0, s, curves(s, cost=0.96)) for s in SHARES]
    table = made(remedies.make_table, scenes, tmp_path)
    assert one(table, budget=4, method="fix", test_set="oracle")["gain_db"] == 1.5


def test_budgets_that_plain_training_lacks_are_left_out(scene, tmp_path):
    scenes = [scene("wrong", 0, share, curves(share)) for share in (0.25, 0.5, 1)]
    table = made(remedies.make_table, scenes, tmp_path)
    assert set(table["budget"]) == {1}


def test_conditions_and_photos_without_truth_stand_apart(scenes, scene, tmp_path):
    fox = [
        scene("fox", 0, share, curves(share), test_sets=("standard", "aligned_pose"))
        for share in SHARES
    ]
    table = made(remedies.make_table, [*scenes, *fox], tmp_path)
    assert list(dict.fromkeys(table["condition"])) == ["wrong_x0.5", "fox_x0.5"]
    assert set(table[table["condition"] == "fox_x0.5"]["test_set"]) == {
        "standard",
        "aligned_pose",
    }
    drawn = made(costs.points, [*scenes, *fox])
    fox = drawn[drawn["condition"] == "fox_x0.5"]
    assert set(fox["test_set"]) == {"standard"}
    fix = drawn[(drawn["condition"] == "wrong_x0.5") & (drawn["method"] == "fix")]
    assert set(fix["test_set"]) == {"oracle"}
    assert fix["total_time_s"].tolist() == [2 * BASE_S * share for share in SHARES]
    np.testing.assert_allclose(fix["psnr_db"], 23.5 + np.log2(SHARES))
    tex = remedies.to_latex(table)
    assert r"fox\_x0.5, standard: 1.7, 3.3, 6.7 min" in tex
    assert r"& 22.50 &" in tex
    assert r"\textbf{+0.50}" in tex


def test_a_photo_is_one_view_however_many_seeds_there_are(rng):
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


def test_sizes_of_a_capture_are_set_side_by_side(scene, scenes, tmp_path, monkeypatch):
    """Its flow in pixels and as an angle, and a figure of gains by size."""
    sized = [
        scene(f"fox-{width}", seed, s, curves(s, gain_db=width / 200), width_px=width)
        for width in (400, 200)
        for seed in (0, 2)
        for s in SHARES
    ]
    table = made(remedies.make_table, [*sized, *scenes], tmp_path)
    captures = made(remedies.by_capture, [*sized, *scenes])
    for width in (200, 400):
        chosen = table[table["condition"] == f"fox-{width}_x0.5"]
        line = one(chosen, method="fix", test_set="oracle", budget=2)
        assert (line["width_px"], line["seeds"]) == (width, 2)
        # The median view's.
        assert line["flow_px"] == pytest.approx(width / 400)
        assert line["flow_mrad"] == pytest.approx(width / 200)
        assert line["gain_db"] == pytest.approx(width / 200 - 1)
    assert captures == [["fox-400_x0.5", "fox-200_x0.5"]]
    assert made(remedies.by_capture, scenes) == []
    drawn = {}
    monkeypatch.setattr(
        "matplotlib.axes.Axes.errorbar",
        lambda axes, x, y, *args, label, color, **_: drawn.update(
            {label: (list(x), list(y), color)}
        ),
    )
    path = tmp_path / "sizes.png"
    plots.sizes(table, captures, path)
    assert path.stat().st_size > 10_000
    # From small to large; the largest budget of those that all sizes have.
    assert drawn["plain"] == ([200, 400], [0, 0], "black")
    assert drawn["fix"][0] == [200, 400]
    np.testing.assert_allclose(drawn["fix"][1], [0, 1], atol=1e-9)
    assert plots.budget_of(table) == 4
    assert plots.budget_of(table[table["budget"] < 4]) == 2
    # A remedy has one colour, whichever a capture lacks.
    lacking = table[(table["method"] != "fix") | (table["width_px"] == 200)]
    plots.sizes(lacking, [["fox-400_x0.5"], ["fox-200_x0.5"]], path)
    assert drawn["fix"][2] == plots.COLOURS[0]
    assert drawn["plain"][2] == "black"


def test_the_flow_of_a_size_is_the_mean_of_its_seeds(scene, scenes, tmp_path):
    more = scene("wrong", 3, 1, curves(1)).assign(flow_px=3.5)
    size = made(remedies.make_table, [*scenes, more], tmp_path).iloc[0]
    assert (size["width_px"], size["height_px"]) == (200, 150)
    # A number of pixels is whole, in the table too.
    assert isinstance(size["width_px"], (int, np.integer))
    assert size["flow_px"] == pytest.approx((0.5 + 0.5 + 3.5) / 3)


def test_faults_are_named(scenes, scene, tmp_path):
    again = scene("wrong", 0, 1, curves(1)).assign(scene="again")
    with pytest.raises(ValueError, match=r"again: the same as another scene"):
        made(remedies.make_table, [*scenes, again], tmp_path)
    (tmp_path / "wrong_x1" / "facts.json").write_text("{}")
    with pytest.raises(ValueError, match=r"facts\.json: .*: no "):
        made(remedies.make_table, scenes, tmp_path)


def test_as_a_command(tmp_path):
    """Of files: the flow is the plain training's, and costs are of the whole way."""
    scenes = []
    for share in (1, 2):
        folder = tmp_path / f"a_x{share}"
        timing = {"train_time_s": 100.0 * share}
        rows = [
            table_cases.written(folder, {"standard": [20.0, 22.0]}, *key, timing=timing)
            for key in (("plain", 0), ("plain", 1))
        ]
        table_cases.collect(folder, rows, "remedies")
        facts = {"width_px": 9, "height_px": 8, "pixel_angle_mrad": 2.0}
        table_cases.put(folder / "facts.json", facts)
        like = {"alike": "a", "share": share}
        scenes.append(table_cases.scene_like(folder.name, **like))
    options = {kind: f"{tmp_path}/out.{kind}" for kind in ("csv", "tex")}
    options |= {"scenes": table_rows.as_json(scenes), "results": str(tmp_path)}
    options["figure"] = f"{tmp_path}/out.png"
    remedies.main([f"--{name}={value}" for name, value in options.items()])
    table = pd.read_csv(tmp_path / "out.csv")
    # Warped photos take as long as both: 202.75 s at one length.
    assert table["budget"].tolist() == [1, 2, 2]
    assert table["time_s"].tolist() == [100.0, 200.0, 200.0]
    assert set(table["flow_px"]) == {2.0}
    assert set(table["flow_mrad"]) == {4.0}
    assert (tmp_path / "out.png").stat().st_size > 10_000
    assert (tmp_path / "out.tex").read_text().count(r"\midrule") == 1
