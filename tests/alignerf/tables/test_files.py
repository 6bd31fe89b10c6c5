"""Commands that make tables: what no table can be made of is named, nothing is left."""

import json

import pytest

from alignerf.tables import controls, misalignment, ranking, round_times, tradeoff
from alignerf.tables import files as table_files

SCORES = "view,test_set,psnr_db,ssim,lpips_alex,lpips_squeeze,lpips_vgg\n"


@pytest.fixture
def entry(tmp_path):
    """An entry that fits every table, with all its files whole."""
    sets = (*sorted(controls.NEEDED), "oracle")
    rows = [f"{view},{name},20,0.5,0.5,,\n" for view in "ab" for name in sets]
    timing = {key: 1.0 for key in ("train_time_s", "compile_time_s", "view_time_s")}
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
    return labels | {
        "variant": "base",
        "changes": {},
        "metrics": metrics,
        "base_metrics": metrics,
        "trainings": [timing],
        "data": [flow],
        "training": timing,
        "rendering": timing,
        "alignment": flow,
        "walls": dict.fromkeys(("train", "render", "align"), wall),
    }


def make(module, entry, out):
    """Run a table's command; `out` is the folder that it writes into."""
    paths = {"--csv": out / "t.csv", "--tex": out / "t.tex"}
    if module is tradeoff:
        paths["--figure"] = out / "t.png"
    options = [str(part) for pair in paths.items() for part in pair]
    entries = [entry, entry | {"method": "other", "variant": "other"}]
    module.main(["--rows", json.dumps(entries), *options])


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


@pytest.mark.parametrize(
    "module", [misalignment, controls, ranking, round_times, tradeoff]
)
def test_a_table_without_its_latex_is_not_left(tmp_path, entry, module, monkeypatch):
    def fail(table):
        raise ValueError("no LaTeX")

    monkeypatch.setattr(module, "to_latex", fail)
    with pytest.raises(ValueError, match="no LaTeX"):
        make(module, entry, tmp_path / "out")
    assert not [path for path in tmp_path.glob("out/*") if path.is_file()]


@pytest.mark.parametrize("text", ["", "[1]", "{}", "3"])
def test_a_timing_that_is_none_is_named(tmp_path, text):
    path = tmp_path / "timing.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"timing\.json: not the timing"):
        table_files.read_timing(path, "time_s")
