"""Rows as tables read them: costs of the whole way, and what does not go together."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from alignerf.tables import columns, frame
from tests import table_cases

DB = {"standard": [20.0, 22.0], "oracle": [21.0, 25.0]}


@pytest.fixture
def scene(tmp_path):
    """A scene's tables: a training in two rounds, and one that starts from it.

    `warm` begins with the photos that `plain` warped, by cameras corrected.
    """
    scene = tmp_path / "yard"
    first, second = (table_cases.written(scene, DB, round=k) for k in (0, 1))
    way = [*first.way, "warm/round1"]
    warm = table_cases.written(
        *(scene, DB, "warm", 1),
        base="plain",
        way=way,
        flows=first.way,
        corrected=first.way,
        timing={"params": 9},
        published="NeRF",
    )
    table_cases.collect(scene, [first, second, warm])
    return scene


def change(path, of_text):
    """Change a file's text."""
    before = path.read_text()
    path.write_text(of_text(before))
    assert path.read_text() != before


def without(pattern):
    """A text without the lines that match."""
    return lambda text: "".join(
        line for line in text.splitlines(True) if not re.match(pattern, line)
    )


def rows_of(scene):
    """The first line of each row, by method and round."""
    rows = frame.read(scene).drop_duplicates(frame.ROW)
    return {(row["method"], row["round"]): row for _, row in rows.iterrows()}


def costs_of(row):
    return row[frame.COSTS].to_dict()


def test_costs_are_of_all_that_leads_to_a_row(scene):
    rows = rows_of(scene)
    assert list(rows) == [("plain", 0), ("plain", 1), ("warm", 1)]
    alone = {"train_time_s": 20.0, "steps": 5, "rays_seen": 50, "params": 7}
    alone["memory_mib"] = 1.5
    assert costs_of(rows["plain", 0]) == alone | {
        "data_time_s": 0.0,
        "total_time_s": 20.0,
    }
    # Rendering and flow of round 0 belong to the way; those of its own do not.
    twice = {"train_time_s": 40.0, "steps": 10, "rays_seen": 100, "memory_mib": 1.5}
    data = {"data_time_s": 2.75, "total_time_s": 42.75}
    assert costs_of(rows["plain", 1]) == twice | {"params": 7} | data
    # Cameras corrected, and the parameters of the last.
    data = {"data_time_s": 4.25, "total_time_s": 44.25}
    assert costs_of(rows["warm", 1]) == twice | {"params": 9} | data


def test_two_methods_that_share_a_training_have_a_row_each(tmp_path):
    """As where a plain method stands beside one with rounds."""
    scene = tmp_path / "yard"
    first = table_cases.written(scene, DB)
    found = table_cases.collect(scene, [first, first._replace(method="again")])
    one, other = (own for _, own in found.groupby("method", sort=False))
    assert other["method"].iloc[0] == "again"
    for key in (*frame.COSTS, "psnr_db"):
        assert one[key].tolist() == other[key].tolist()


def test_a_row_knows_what_it_is_set_against_and_what_comes_before(scene):
    found, rows = frame.read(scene), rows_of(scene)
    warm, first = rows["warm", 1], rows["plain", 0]
    own = found[found["method"] == "warm"]
    for test_set, db in DB.items():
        assert own[own["test_set"] == test_set]["base_db"].tolist() == db
    assert (warm["baseline"], warm["published"]) == ("plain", "NeRF")
    assert pd.isna(first["published"])
    assert [one["path"] for one in frame.origins(scene)] == [
        str(scene / name / "timing.json")
        for name in ("plain/round0", "plain/round1", "warm/round1")
    ]
    assert set(found["scene"]) == {"yard"}


def test_a_view_without_seconds_leaves_the_costs_empty(tmp_path):
    scene = tmp_path / "yard"
    first, second = (table_cases.written(scene, DB, round=k) for k in (0, 1))
    table_cases.put(Path(first.files["align"]), "view,time_s\nt,1\nu,\n")
    table_cases.collect(scene, [first, second])
    rows = rows_of(scene)
    assert np.isfinite(rows["plain", 0]["total_time_s"])
    second = rows["plain", 1]
    assert np.isnan([second[key] for key in ("data_time_s", "total_time_s")]).all()
    assert second["train_time_s"] == 40.0


def test_all_test_sets_have_all_metrics_and_those_needed_are_named(scene):
    found = frame.read(scene)
    assert set(columns.METRICS) <= set(found)
    _, own = next(iter(found.groupby(frame.ROW, sort=False)))
    assert frame.psnr_by_set(own, ["oracle"])["oracle"].tolist() == DB["oracle"]
    reason = "yard: plain after round 0: no test set 'warped'"
    with pytest.raises(ValueError, match=reason):
        frame.psnr_by_set(own, ["standard", "warped"])


def swap(old, new):
    return lambda text: text.replace(old, new)


@pytest.mark.parametrize(
    ("name", "of_text", "reason"),
    [
        ("trainings", swap(",plain/round0,,5", ",,,5"), None),
        ("trainings", lambda text: "", "no row"),
        ("trainings", lambda text: text.splitlines()[0] + "\n", "no row"),
        ("trainings", swap("folder,", "place,"), "no column folder"),
        ("trainings", swap(",params", ",parameters"), "no column params"),
        ("trainings", swap(",20.0,", ",x,"), "column train_time_s: not numbers"),
        ("scores", without("warm,1,oracle,v1"), None),
        ("scores", swap(",20.0", ",x"), "column value: not numbers"),
        ("scores", without("warm,"), "no scores of warm"),
        # Of an earlier version: its costs are not known.
        ("scores", without(r"\w+,\d,,,"), None),
        ("scores", lambda text: "", "no row"),
        ("scores", swap("method,", "name,"), "no column method"),
    ],
)
def test_what_does_not_go_together_is_named_by_file(scene, name, of_text, reason):
    change(scene / f"{name}.csv", of_text)
    if reason is None:
        # An empty cell is nothing wrong.
        frame.read(scene)
        return
    with pytest.raises(ValueError, match=rf"(scores|trainings)\.csv: .*({reason})"):
        frame.read(scene)


@pytest.mark.parametrize("name", ["scores", "trainings"])
def test_a_table_that_is_not_there_is_named(scene, name):
    (scene / f"{name}.csv").unlink()
    with pytest.raises(ValueError, match=rf"{name}\.csv: not found"):
        frame.read(scene)


def test_a_table_across_scenes_has_rows_of_its_own(scene):
    rows = [table_cases.written(scene, DB, "only")]
    found = table_cases.collect(scene, rows, "comparison")
    assert set(found["method"]) == {"only"}
    assert len(rows_of(scene)) == 3


def naive(views, by, at):
    """Lines of a table, a loop at a time: {(by, test set): (ssim, gain in dB)}.

    A view of the warped set has no metric where no flow is valid, and is left out.
    """
    found = {}
    views = views[(views["test_set"] != "warped") | views["ssim"].notna()]
    for key in dict.fromkeys(zip(*(views[name] for name in by), strict=True)):
        own = [r for r in views.to_dict("records") if tuple(r[n] for n in by) == key]
        scenes = dict.fromkeys(r["scene"] for r in own)
        for test_set in at:
            groups = [
                [r for r in own if (r["scene"], r["test_set"]) == (scene, test_set)]
                for scene in scenes
            ]
            if all(groups):
                ssim = np.mean([np.mean([r["ssim"] for r in g]) for g in groups])
                gains = [[r["psnr_db"] - r["base_db"] for r in g] for g in groups]
                gain_db = np.mean([np.mean(g) for g in gains])
                found[(*key, test_set)] = ssim, gain_db, sum(map(len, groups))
    return found


@pytest.mark.parametrize("case", range(8))
def test_a_summary_is_that_of_a_loop(rng, case):
    """Means over scenes of means over views; a test set that all scenes have."""
    rng = np.random.default_rng(case)
    scenes = []
    for name in "abc"[: rng.integers(1, 4)]:
        sets = ["standard", *rng.choice(["warped", "oracle"], rng.integers(3), False)]
        views, base, rows = rng.integers(1, 5), None, []
        for method, round in (("x", 0), ("y", 0), ("y", 1)):
            db = {}
            for one in sets:
                db[one] = {"psnr_db": rng.uniform(15, 25, views)}
                db[one]["ssim"] = rng.uniform(size=views)
            rows.append(table_cases.row(db, method, round, base=base))
            base = rows[0]
        scenes.append(table_cases.scored(name, rows, share=int(rng.integers(1, 3))))
    views = pd.concat(scenes, ignore_index=True)
    if case % 2:
        views.loc[rng.integers(len(views)), ["psnr_db", "ssim"]] = np.nan
    at = ["standard", "warped", "oracle"]
    for by in (frame.ROW, ["share", *frame.ROW]):
        lines = list(frame.summary(views, by, at))
        keys = ("ssim", "difference_db", "views")
        found = {
            (*(line[n] for n in by), line["test_set"]): [line[key] for key in keys]
            for line in lines
        }
        wanted = naive(views, by, at)
        assert list(found) == list(wanted)
        for key, values in wanted.items():
            np.testing.assert_allclose(found[key], values)
        for line in lines:
            ends = line["difference_low_db"], line["difference_high_db"]
            own = line["difference_db"]
            assert np.isnan(ends).all() or ends[0] <= own <= ends[1]


@pytest.mark.parametrize("column", ["round", "test_set", "value"])
def test_a_cost_with_a_cell_that_is_none_of_a_cost_names_the_file(scene, column):
    path = scene / "scores.csv"
    table = pd.read_csv(path, dtype=str)
    table.loc[table["test_set"].isna().idxmax(), column] = "nan"
    table.to_csv(path, index=False)
    with pytest.raises(ValueError, match=f"{scene}/scores.csv: "):
        frame.read(scene)
