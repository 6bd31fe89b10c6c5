"""The seconds of a round are told apart, and add up."""

import json

import pandas as pd
import pytest

from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import round_times
from tests import table_cases


def write_round(folder, walls):
    """Files of one round; returns its row."""
    for name in ("render", "displacement"):
        (folder / name).mkdir(parents=True)
    (folder / "timing.json").write_text(
        json.dumps({"train_time_s": 20.0, "compile_time_s": 5.0})
    )
    (folder / "render/train.json").write_text(
        json.dumps({"views": 4, "view_time_s": 0.5, "time_s": 3.0})
    )
    (folder / "displacement/train.csv").write_text("view,time_s\na,0.25\nb,0.5\n")
    (folder / "render/test.json").write_text(
        json.dumps({"views": 3, "view_time_s": 0.5, "time_s": 2.0})
    )
    (folder / "displacement/test.csv").write_text("view,time_s\nc,0.125\n")
    for stage, wall_s in walls.items():
        (folder / f"{stage}.tsv").write_text(f"s\th:m:s\tmax_rss\n{wall_s}\t0\t1.5\n")
    row = table_rows.Times(
        method="a_b",
        round=len(walls) // 2,
        training=str(folder / "timing.json"),
        walls=table_rows.Walls(**{k: str(folder / f"{k}.tsv") for k in walls}),
    )
    if row.round == 0:
        return row
    return row._replace(
        rendering=str(folder / "render/train.json"),
        alignment=str(folder / "displacement/train.csv"),
        test_rendering=str(folder / "render/test.json"),
        test_alignment=str(folder / "displacement/test.csv"),
    )


def test_parts_add_up_to_the_processes(tmp_path):
    first = write_round(tmp_path / "first", {"train": 28.0})
    later = write_round(
        tmp_path / "later", {"train": 30.0, "render": 6.0, "align": 2.0}
    )
    csv, tex = table_cases.make("round_times", [first, later], tmp_path)
    table = pd.read_csv(csv)
    parts = table[list(round_times.PARTS)]
    # All but the seconds of the test views, which the same processes took.
    assert table["total_time_s"].tolist() == [28.0, 36.375]
    assert parts.sum(axis=1).tolist() == [28.0, 36.375]
    assert parts.iloc[1].tolist() == [20.0, 5.0, 5.0, 2.0, 2.5, 0.75, 1.125]
    assert parts.iloc[0].isna().tolist() == [False] * 3 + [True] * 4
    tex = tex.read_text()
    assert r"a\_b & 0 & 20.0 & 5.0 & 3.0 & -- & -- & -- & -- & 28.0 \\" in tex


def test_a_training_that_went_on_has_no_negative_rest(tmp_path):
    """The process knows its own seconds, timing.json those of all before it too."""
    row = round_times.line_of(write_round(tmp_path / "first", {"train": 12.0}))
    assert row["train_rest_time_s"] == 0.0
    assert row["total_time_s"] == 25.0


def test_a_benchmark_that_is_none_is_named(tmp_path):
    path = tmp_path / "train.tsv"
    path.write_text("h:m:s\n0:00:01\n")
    with pytest.raises(ValueError, match=r"train\.tsv: not the benchmark of one run"):
        round_times.wall_s(path)


def test_a_view_without_seconds_leaves_the_round_s_empty(tmp_path):
    walls = {"train": 30.0, "render": 6.0, "align": 2.0}
    row = write_round(tmp_path / "later", walls)
    (tmp_path / "later/displacement/train.csv").write_text("view,time_s\na,0.25\nb,\n")
    table = round_times.make_table([row])
    empty = ["align_time_s", "align_rest_time_s", "total_time_s"]
    assert list(table.columns[table.isna().any()]) == empty
    assert round_times.to_latex(table).count("--") == len(empty)


def test_a_round_without_its_files_is_refused(tmp_path):
    walls = {"train": 30.0, "render": 6.0, "align": 2.0}
    row = write_round(tmp_path / "later", walls)
    for broken in (
        row._replace(alignment=None),
        row._replace(walls=row.walls._replace(render=None)),
    ):
        with pytest.raises(ValueError, match="no table"):
            round_times.line_of(broken)
