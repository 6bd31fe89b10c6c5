"""A scene's files become two tables, and these its rows: nothing is lost or made up."""

import numpy as np
import pandas as pd
import pytest

from alignerf.io import faults
from alignerf.tables import collect, columns, frame
from tests import table_cases

DB = {"standard": [20.0, 22.0], "warped": [21.0, 25.0]}


@pytest.fixture
def scene(tmp_path):
    return tmp_path / "yard"


def lines_of(scene, rows):
    """trainings.csv of these rows, by folder."""
    table_cases.collect(scene, rows)
    return pd.read_csv(scene / "trainings.csv").set_index("folder")


def test_what_is_written_is_read_to_the_last_bit(scene, rng):
    names, method = ["007", "NA", "b c"], "1"
    psnr_db = rng.uniform(15, 25, 3) / 3
    timing = {"train_time_s": rng.uniform(), "compile_time_s": rng.uniform()}
    # A hash of digits is no number, and what is not known is null.
    timing |= {"lock": "0012345678901234", "commit": None}
    row = table_cases.written(
        scene, {"standard": psnr_db}, method, published="NA", timing=timing
    )
    for name in ("scores", "parts"):
        table = pd.read_csv(row.files[name]).assign(view=names)
        table.to_csv(row.files[name], index=False)
    views = table_cases.collect(scene, [row])
    read = views.iloc[0]
    assert (read["method"], read["round"], read["published"]) == (method, 0, "NA")
    assert views["view"].tolist() == names
    assert views["psnr_db"].tolist() == psnr_db.tolist()
    assert read["train_time_s"] == timing["train_time_s"]
    (line,) = frame.read_trainings(scene).to_dict("records")
    assert line["compile_time_s"] == timing["compile_time_s"]
    told = {"commit": None, "lock": "0012345678901234", "device": "cpu"}
    path = str(scene / "1/round0/timing.json")
    told |= {"environment": None, "path": path}
    assert frame.origins(scene) == [told]
    assert views[columns.PARTS].eq(0.25).all(axis=None)
    # Empty where it could not be had.
    assert views["lpips_vgg"].isna().all()
    head = (scene / "scores.csv").read_text().splitlines()[0]
    assert head == ",".join(columns.names("scores"))
    head = (scene / "trainings.csv").read_text().splitlines()[0]
    assert head == ",".join(columns.names("trainings"))


def test_a_view_that_stands_twice_is_named(scene):
    row = table_cases.written(scene, DB)
    table = pd.read_csv(row.files["scores"])
    pd.concat([table, table[:1]]).to_csv(row.files["scores"], index=False)
    with pytest.raises(ValueError, match=r"metrics\.csv: .* stands twice"):
        table_cases.collect(scene, [row])


def test_seconds_are_told_apart_and_whole_numbers_stay_whole(scene):
    row = table_cases.written(scene, DB)
    unknown = {"steps": None, "train_time_s": None}
    other = table_cases.written(scene, DB, "other", timing=unknown)
    lines = lines_of(scene, [row, other])
    line = lines.loc["plain/round0"]
    seconds = {
        # Of the views: loading and compiling count no more than a training's.
        "render_time_s": 4 * 0.5,
        "align_time_s": 0.75,
        "correct_time_s": 1.5,
        "memory_mib": 1.5,
    }
    assert line[[*seconds]].to_dict() == seconds
    assert lines.loc["other/round0", ["train_time_s", "steps"]].isna().all()
    costs = frame.read(scene).groupby("method")[["total_time_s", "steps"]].first()
    assert costs.loc["other"].isna().all()
    assert ",5,50,7,20.0,5.0," in (scene / "trainings.csv").read_text()


def test_a_view_without_a_number_leaves_its_sums_empty(scene):
    row = table_cases.written(scene, DB)
    text = "view,median_px,time_s\nt,,0.25\nu,3,\n"
    table_cases.put(scene / "plain/round0/displacement/train.csv", text)
    line = lines_of(scene, [row]).loc["plain/round0"]
    assert np.isnan(line["align_time_s"])


def test_a_training_in_loop_has_a_line_and_no_scores(scene):
    last = table_cases.written(scene, DB, round=1, base="plain")
    first = table_cases.written(scene, DB)
    way = first._replace(method=None, round=None, folder="pretrain/base", files={})
    read = table_cases.collect(scene, [way, first, last])
    assert set(read["method"]) == {"plain"}
    assert set(pd.read_csv(scene / "scores.csv")["round"]) == {0, 1}


def test_scores_of_moved_cameras_stand_beside_the_others(scene):
    row = table_cases.written(scene, DB)
    moved = table_cases.written(scene / "moved", {"aligned_pose": [23.0, 24.0]})
    both = row._replace(files=row.files | {"aligned_pose": moved.files["scores"]})
    read = table_cases.collect(scene, [both])
    assert table_cases.psnr(read, "aligned_pose").tolist() == [23.0, 24.0]
    assert table_cases.psnr(read, "standard").tolist() == DB["standard"]


SCORES = "view,test_set,psnr_db\n"
NO_TABLE = "not the table that it should be"


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("scores", "", f"{NO_TABLE}: no row"),
        ("scores", SCORES, f"{NO_TABLE}: no row"),
        ("scores", "view,psnr_db\na,1\n", f"{NO_TABLE}: no column test"),
        ("scores", "view,test_set\na,b\n", f"{NO_TABLE}: no column psnr"),
        ("scores", SCORES + "a,standard,x\n", "column psnr_db: not numbers"),
        ("parts", "view,flow_median_px\na,1\n", f"{NO_TABLE}: no column"),
        ("timing", "", "not the JSON that it should be"),
        ("timing", "[1]", "not the JSON that it should be"),
        ("timing", '{"steps": 3}', "not the JSON that it should be"),
        ("process", "h:m:s\n0:00:01\n", f"{NO_TABLE}: no column"),
        ("render", "{}", "not the JSON that it should be"),
        ("align", "view,time_s\n", f"{NO_TABLE}: no row"),
        ("align", "view\na\n", f"{NO_TABLE}: no column time_s"),
        ("corrections", "{}", "not the JSON that it should be"),
    ],
)
def test_what_is_damaged_is_named_and_nothing_written(
    scene, capsys, name, text, reason
):
    row = table_cases.written(scene, DB)
    table_cases.collect(scene, [row])
    before = {path: path.read_bytes() for path in scene.glob("*.csv")}
    path = scene / "damaged"
    path.write_text(text)
    damaged = row._replace(files=row.files | {name: str(path)})
    assert faults.exit_code(table_cases.collect, scene, [damaged]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith(f"error: {path}: ")
    assert pd.Series([error]).str.contains(reason).all()
    assert {path: path.read_bytes() for path in scene.glob("*.csv")} == before


def test_a_file_that_is_not_there_is_named(scene):
    row = table_cases.written(scene, DB)
    for name, path in row.files.items():
        files = row.files | {name: f"{path}.none"}
        with pytest.raises((ValueError, OSError), match=r"\.none"):
            table_cases.collect(scene, [row._replace(files=files)])
    files = {key: path for key, path in row.files.items() if key != "align"}
    with pytest.raises(ValueError, match="no table is given"):
        table_cases.collect(scene, [row._replace(files=files)])
    assert not list(scene.glob("*.csv"))


def test_both_are_written_or_none(scene, monkeypatch):
    row = table_cases.written(scene, DB)
    whole = pd.DataFrame.to_csv

    def fail(table, path, **options):
        if "folder" in table:
            raise OSError("disk full")
        whole(table, path, **options)

    monkeypatch.setattr(pd.DataFrame, "to_csv", fail)
    with pytest.raises(OSError, match="disk full"):
        table_cases.collect(scene, [row])
    assert not [path for path in scene.iterdir() if path.is_file()]


def test_the_benchmark_of_a_run_too_short_to_measure_is_empty(tmp_path):
    path = tmp_path / "train.tsv"
    path.write_text("s\th:m:s\tmax_rss\n0.1\t0:00:00\t-\n")
    assert np.isnan(collect.memory_mib(path))
    wanted = ["method", "round", "test_set", "view", "metric", "value"]
    assert columns.names("scores") == wanted
