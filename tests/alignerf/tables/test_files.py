"""Commands that make tables: what no table can be made of is named, nothing is left."""

import json
import math

import pytest

from alignerf import tabulate
from alignerf.experiment import sweep
from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import controls, misalignment, ranking, round_times, tradeoff
from alignerf.tables import files as table_files
from tests import table_cases

SCORES = "view,test_set,psnr_db,ssim,lpips_alex,lpips_squeeze,lpips_vgg\n"


@pytest.fixture
def entry(tmp_path):
    """What any table's row may name, with all its files whole."""
    sets = (*sorted(controls.NEEDED), "oracle")
    rows = [f"{view},{name},20,0.5,0.5,,\n" for view in "ab" for name in sets]
    timing = {f"{key}time_s": 1.0 for key in ("train_", "compile_", "view_", "")}
    timing |= {"params": 1, "steps": 1, "rays_seen": 1, "views": 2, "device": "cpu"}
    files = {
        "metrics.csv": SCORES + "".join(rows),
        "timing.json": json.dumps(timing),
        "flow.csv": "view,time_s\na,0.5\n",
        "wall.tsv": "s\tmax_rss\n9\t1\n",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    metrics, timing, flow, wall = (str(tmp_path / name) for name in files)
    labels = {"method": "plain", "field": "mlp 8", "round": 1, "base": "plain"}
    walls = table_rows.Walls(wall, wall, wall)
    return labels | {
        "variant": "base",
        "changes": {},
        "metrics": metrics,
        "base_metrics": metrics,
        "aligned_pose": None,
        "base_aligned_pose": None,
        "trainings": [timing],
        "data": [flow],
        "training": timing,
        "rendering": timing,
        "alignment": flow,
        "test_rendering": timing,
        "test_alignment": flow,
        "walls": walls,
    }


KINDS = {
    misalignment: table_rows.Misalignment,
    controls: table_rows.Scores,
    ranking: table_rows.Scores,
    round_times: table_rows.Times,
    tradeoff: sweep.Point,
}


def row_of(module, entry):
    """A row of the table that a module makes."""
    kind = KINDS[module]
    return kind(**{name: entry[name] for name in kind._fields})


def make(module, entry, out, *more):
    """Write a table into the folder `out`; returns its name."""
    name = module.__name__.rpartition(".")[2]
    entries = [entry, entry | {"method": "other", "variant": "other"}]
    rows = [row_of(module, entry) for entry in entries]
    if module is not tradeoff:
        table_cases.make(name, rows, out, *more)
        return name
    paths = {f"--{kind}": str(out / f"{name}.{kind}") for kind in ("csv", "tex")}
    paths |= {"--rows": table_rows.as_json(rows), "--figure": str(out / "t.png")}
    module.main([*(part for pair in paths.items() for part in pair), *more])
    return name


@pytest.mark.parametrize(
    ("module", "name"),
    [
        (misalignment, "metrics.csv"),
        (misalignment, "flow.csv"),
        (controls, "metrics.csv"),
        (ranking, "metrics.csv"),
        (round_times, "flow.csv"),
        (round_times, "wall.tsv"),
        (tradeoff, "metrics.csv"),
    ],
)
def test_an_empty_file_is_named(tmp_path, entry, module, name):
    make(module, entry, tmp_path / "whole")
    header = (tmp_path / name).read_text().splitlines(keepends=True)[0]
    for text in ("", header):
        (tmp_path / name).write_text(text)
        with pytest.raises(ValueError, match=f"{name}: "):
            make(module, entry, tmp_path / "out")
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("module", KINDS)
def test_a_table_without_its_latex_is_not_left(tmp_path, entry, module, monkeypatch):
    def fail(table):
        raise ValueError("no LaTeX")

    monkeypatch.setattr(module, "to_latex", fail)
    with pytest.raises(ValueError, match="no LaTeX"):
        make(module, entry, tmp_path / "out")
    assert not [path for path in tmp_path.glob("out/*") if path.is_file()]


def test_a_table_that_fails_leaves_none_of_the_others(tmp_path, entry):
    """What is whole is not mistaken for what belongs together."""
    rows = {
        "controls": [row_of(controls, entry)],
        "round_times": [row_of(round_times, entry)._replace(training="nowhere.json")],
    }
    options = table_rows.options_of(rows)
    with pytest.raises(ValueError, match="nowhere"):
        tabulate.main([*options, "--out", str(tmp_path / "out")])
    assert not (tmp_path / "out").exists()


def test_a_table_that_is_not_known_is_named(tmp_path, capsys):
    with pytest.raises(SystemExit):
        tabulate.main(["--rows", "scores", "[]", "--out", str(tmp_path)])
    assert "no table 'scores'" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "[1]", "{}", "3"])
def test_a_timing_that_is_none_is_named(tmp_path, text):
    path = tmp_path / "timing.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"timing\.json: not the JSON"):
        table_files.read_timing(path, "time_s")


@pytest.mark.parametrize("module", KINDS)
def test_where_a_table_comes_from_lies_beside_it(tmp_path, entry, module):
    config = tmp_path / "config.yaml"
    config.write_text("seed: 0\nscenes: {yard: {seed: 3}}\n")
    name = make(module, entry, tmp_path / "out", "--configs", str(config))
    found = json.loads((tmp_path / "out" / f"{name}.provenance.json").read_text())
    assert (found["seeds"], list(found["configs"])) == ([3], [str(config)])
    assert len(found["rows"]) == 2
    names_trainings = module not in (controls, ranking)
    assert found["device"] == ["cpu"] * names_trainings
    for row in found["rows"]:
        assert len(row["trainings"]) == names_trainings
        for training in row["trainings"]:
            assert training["path"] == entry["training"]
            assert (training["commit"], training["lock"]) == (None, None)


@pytest.mark.parametrize("module", KINDS)
def test_a_table_without_its_provenance_is_not_left(tmp_path, entry, module):
    config = tmp_path / "config.yaml"
    config.write_text("seed: 0\n")
    with pytest.raises(ValueError, match=r"config\.yaml: not a scene's config"):
        make(module, entry, tmp_path / "out", "--configs", str(config))
    assert not [path for path in tmp_path.glob("out/*") if path.is_file()]


def test_seconds_of_views_are_all_or_none(tmp_path):
    path = tmp_path / "flow.csv"
    path.write_text("view,time_s\na,0.5\nb,1\n")
    assert table_files.views_time_s(path) == 1.5
    path.write_text("view,time_s\na,0.5\nb,\n")
    assert math.isnan(table_files.views_time_s(path))
