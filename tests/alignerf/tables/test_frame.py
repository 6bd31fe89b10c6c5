"""Rows as tables read them: costs of the whole way, and what does not go together."""

import re

import numpy as np
import pandas as pd
import pytest

from alignerf.tables import columns, frame
from tests import table_cases

DB = {"standard": [20.0, 22.0], "oracle": [21.0, 25.0]}


@pytest.fixture
def scene(tmp_path):
    """A scene's tables: a training in two rounds, one that starts from it, and renders.

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
    given = second._replace(
        folder="given/round0",
        method="given",
        round=0,
        way=[],
        flows=[],
        files={"scores": first.files["scores"]},
    )
    table_cases.collect(scene, [first, second, warm, given])
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
    assert list(rows) == [("plain", 0), ("plain", 1), ("warm", 1), ("given", 0)]
    alone = {"train_time_s": 20.0, "steps": 5, "rays_seen": 50, "params": 7}
    assert costs_of(rows["plain", 0]) == alone | {
        "data_time_s": 0.0,
        "total_time_s": 20.0,
    }
    # Rendering and flow of round 0 belong to the way; those of its own do not.
    twice = {"train_time_s": 40.0, "steps": 10, "rays_seen": 100}
    data = {"data_time_s": 2.75, "total_time_s": 42.75}
    assert costs_of(rows["plain", 1]) == twice | {"params": 7} | data
    # Cameras corrected, and the parameters of the last.
    data = {"data_time_s": 4.25, "total_time_s": 44.25}
    assert costs_of(rows["warm", 1]) == twice | {"params": 9} | data
    assert rows["given", 0][["total_time_s", "data_time_s", "steps"]].isna().all()


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
    assert [one["path"] for one in warm["trainings"]] == [
        str(scene / name / "timing.json") for name in ("plain/round0", "warm/round1")
    ]
    assert rows["given", 0]["trainings"] == []
    assert set(found["scene"]) == {"yard"}


def test_a_view_without_seconds_leaves_the_costs_empty(scene):
    table = pd.read_csv(scene / "trainings.csv")
    table.loc[table["folder"] == "plain/round0", "align_time_s"] = np.nan
    table.to_csv(scene / "trainings.csv", index=False)
    rows = rows_of(scene)
    assert np.isfinite(rows["plain", 0]["total_time_s"])
    second = rows["plain", 1]
    assert np.isnan([second[key] for key in ("data_time_s", "total_time_s")]).all()
    assert second["train_time_s"] == 40.0


def test_all_test_sets_have_all_metrics_and_those_needed_are_named(scene):
    found = frame.read(scene)
    assert set(columns.METRICS) <= set(found)
    own = next(lines for _, lines in frame.rows_of(found))
    assert frame.psnr_by_set(own, ["oracle"])["oracle"].tolist() == DB["oracle"]
    reason = "yard: plain after round 0: no test set 'warped'"
    with pytest.raises(ValueError, match=reason):
        frame.psnr_by_set(own, ["standard", "warped"])


def swap(old, new):
    return lambda text: text.replace(old, new)


@pytest.mark.parametrize(
    ("name", "of_text", "reason"),
    [
        ("trainings", swap(",plain/round0,5", ",,5"), None),
        ("trainings", lambda text: "", "no row"),
        ("trainings", lambda text: text.splitlines()[0] + "\n", "no row"),
        ("trainings", swap("folder,", "place,"), "no column folder"),
        ("trainings", swap(",params", ",parameters"), "no column params"),
        ("trainings", swap(",20.0,", ",x,"), "column train_time_s: not numbers"),
        ("scores", without("warm,1,oracle,v1"), None),
        ("scores", swap(",20.0", ",x"), "column value: not numbers"),
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
    assert len(rows_of(scene)) == 4
