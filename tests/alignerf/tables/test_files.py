"""Commands that make tables: what no table can be made of is named, nothing is left."""

import json

import pandas as pd
import pytest

from alignerf import tabulate
from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import columns, controls
from tests import table_cases

SETS = (*sorted(controls.needed()), "oracle")
NAMES = [name for name, table in tabulate.TABLES.items() if not table.of]


@pytest.fixture
def scene(tmp_path):
    """A scene's folder with two rows."""
    scene = tmp_path / "yard"
    db = {name: [20.0, 21.0] for name in SETS}
    rows = [table_cases.written(scene, db, m, base="base") for m in ("base", "z_a")]
    table_cases.collect(scene, rows)
    return scene


def make(scene, name, *more, configs=()):
    """Write a table; returns its folder."""
    out = scene / "out"
    scenes = table_rows.as_json([table_cases.scene_like(scene.name, reference="base")])
    options = ["--scenes", scenes, "--results", scene.parent, "--out", out / name]
    options += ["--table", name, *more, "--configs", *configs]
    tabulate.main([*map(str, options)])
    return out


@pytest.mark.parametrize("name", NAMES)
def test_a_table_lies_beside_its_latex_and_where_it_comes_from(scene, name):
    config = scene / "config.yaml"
    config.write_text("seed: 0\nscenes: {yard: {seed: 3}}\n")
    out = make(scene, name, configs=[config])
    kinds = ("csv", "provenance.json", "tex")
    made = sorted(path.name for path in out.iterdir())
    assert made == [f"{name}.{kind}" for kind in kinds]
    table = pd.read_csv(out / f"{name}.csv")
    # Of no network there are weights.
    known = [one for one in columns.names(name) if one not in columns.NETWORKS]
    assert list(table.columns) == known
    if name != "ranking":
        # In the order of the config, not of the alphabet.
        assert list(dict.fromkeys(table.iloc[:, 0])) == ["base", "z_a"]
    tex = (out / f"{name}.tex").read_text()
    assert tex.count(r"\begin{tabular}") == tex.count(r"\end{tabular}") == 1
    told = json.loads((out / f"{name}.provenance.json").read_text())
    assert told["seeds"] == [3]
    assert (list(told["configs"]), told["device"]) == ([str(config)], ["cpu"])
    known = {"commit": None, "lock": None, "device": "cpu", "environment": None}
    assert told["trainings"] == [
        known | {"path": str(scene / name / "round0" / "timing.json")}
        for name in ("base", "z_a")
    ]


def test_whole_numbers_stay_such_however_large(scene):
    out = make(scene, "misalignment")
    assert ",7,5,50\n" in (out / "misalignment.csv").read_text()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("file", ["scores", "trainings"])
def test_an_empty_file_is_named(scene, name, file):
    path = scene / f"{file}.csv"
    head = path.read_text().splitlines(keepends=True)[0]
    for text in ("", head):
        path.write_text(text)
        with pytest.raises(ValueError, match=rf"{file}\.csv: .*no row"):
            make(scene, name)
        assert not (scene / "out").exists()


def fail(*_):
    raise ValueError("no LaTeX")


@pytest.mark.parametrize("name", NAMES)
def test_a_table_without_what_lies_beside_it_is_not_left(scene, name, monkeypatch):
    config = scene / "config.yaml"
    config.write_text("seed: 0\n")
    with pytest.raises(ValueError, match=r"config\.yaml: not a scene's config"):
        make(scene, name, configs=[config])
    table = tabulate.TABLES[name]._replace(latex=fail)
    monkeypatch.setitem(tabulate.TABLES, name, table)
    with pytest.raises(ValueError, match="no LaTeX"):
        make(scene, name)
    assert not [path for path in scene.glob("out/*") if path.is_file()]


def test_what_lies_beside_fails_with_the_table(scene, monkeypatch):
    beside = {".csv2": pd.DataFrame(), ".png": fail}
    table = tabulate.TABLES["controls"]._replace(beside=lambda *_: beside)
    monkeypatch.setitem(tabulate.TABLES, "controls", table)
    with pytest.raises(ValueError, match="no LaTeX"):
        make(scene, "controls")
    assert not [path for path in scene.glob("out/*") if path.is_file()]
