"""What other packages add goes the whole way, from a training to the export."""

import csv
import json
import os

import numpy as np
import pytest
import yaml

from alignerf.io import archives
from tests.extension import installed

CONFIG = """
scenes:
  tiny:
    source: courtyard
    poses: truth
    test_every: 4
    perturb_px: 0.5
    courtyard: { views: 8, width: 48, height: 36, supersample: 1, lens_sigma_px: 0 }
models:
  base:
    samples: [16, 8]
    proposal: &field
      { kind: grid, levels: 4, log2_hashmap_size: 10, max_resolution: 64, width: 8 }
    field: { <<: *field, view_widths: [8] }
  looked: { kind: one_look }
methods:
  plain: { model: base }
  twice: { model: base, goes_on: { share: 0.25 } }
  robust: { model: base, trimmed: {} }
  look: { model: looked }
training: { steps: 60, batch_rays: 256, warmup_steps: 6 }
flow: { estimator: shift, tolerance_px: 4.0 }
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """In which the toys are installed."""
    site = installed.install(tmp_path_factory.mktemp("site"))
    return {"PYTHONPATH": os.pathsep.join([str(site), str(installed.ROOT)])}


@pytest.fixture(scope="module")
def scene(tmp_path_factory, snakemake, environment):
    """The folder of the scene's results, after the whole chain."""
    folder = tmp_path_factory.mktemp("chain")
    (folder / "toys.yaml").write_text(CONFIG)
    options = (
        "--cores",
        "2",
        "--configfile",
        folder / "toys.yaml",
        "--",
        "tiny",
        "export",
    )
    code, output = snakemake(folder, *options, more=environment)
    assert code == 0, output[-3000:]
    return folder / "results" / "tiny"


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def test_a_method_is_trained_costed_and_exported(scene):
    timing = json.loads((scene / "twice/round0/timing.json").read_text())
    assert (timing["stage"], timing["steps"]) == ("full", 15)
    table = rows_of(scene / "tables/misalignment.csv")
    row = next(row for row in table if row["method"] == "twice")
    assert row["field"] == "grid 2^10, cameras corrected once"
    assert row["difference_to"] == "plain"
    # Of both trainings, and of what the flow and the cameras took between them.
    assert row["steps"] == "75"
    plain = next(row for row in table if row["method"] == "plain")
    assert float(row["total_time_s"]) > float(plain["total_time_s"])
    assert float(row["data_time_s"]) > 0
    # It learnt with cameras that were corrected, and these go out.
    given = archives.read(scene / "cameras.npz", ["camtoworlds"])
    learnt = archives.read(scene / "twice/round0/learnt/cameras.npz", ["camtoworlds"])
    assert not np.array_equal(given["camtoworlds"], learnt["camtoworlds"])
    assert (scene / "twice/export/cameras/transforms.json").is_file()
    assert not (scene / "plain/export").exists()


def test_a_loss_is_trained_by_and_named(scene):
    table = rows_of(scene / "tables/misalignment.csv")
    row = next(row for row in table if row["method"] == "robust")
    assert row["field"] == "grid 2^10, trimmed loss"
    plain, own = (scene / f"{name}/round0/timing.json" for name in ("plain", "robust"))
    losses = [json.loads(path.read_text())["final"]["loss"] for path in (plain, own)]
    assert losses[0] != losses[1]


def test_a_preflight_knows_what_it_takes(scene):
    rates = json.loads((scene / "preflight.json").read_text())["rates"]
    assert min(rate["step_s"] for rate in rates.values()) > 0
    assert {"plain/round0", "twice/round0"} <= rates.keys()


def test_a_system_is_trained_and_shown(scene):
    timing = json.loads((scene / "look/round0/timing.json").read_text())
    assert (timing["stage"], timing["steps"]) == ("full", 60)
    table = rows_of(scene / "tables/misalignment.csv")
    row = next(row for row in table if row["method"] == "look")
    assert row["field"] == "one_look 16"
    assert np.isfinite(float(row["psnr_db"]))


def test_a_test_set_is_scored_and_shown(scene):
    scored = rows_of(scene / "plain/round0/metrics.csv")
    of_view = {row["test_set"]: row for row in scored if row["view"] == "view_004"}
    # A render of so short a training is blurred, and so is what it is compared with.
    blurred, standard = (float(of_view[n]["psnr_db"]) for n in ("blurred", "standard"))
    assert blurred > standard
    table = rows_of(scene / "tables/misalignment.csv")
    for method in ("plain", "twice", "look"):
        assert any((r["method"], r["test_set"]) == (method, "blurred") for r in table)
    assert "blurred" in (scene / "tables/misalignment.tex").read_text()


def test_an_estimator_is_what_flows_come_from(scene):
    with np.load(scene / "plain/round0/flow/test/view_004.npz") as file:
        flow_px = file["flow_px"]
    assert np.ptp(flow_px.reshape(-1, 2), axis=0).tolist() == [0.0, 0.0]
    assert np.abs(flow_px).max() > 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"plain": {"goes_on": {}}},
            "toys.yaml: methods.plain: it sets itself against a plain method",
        ),
        (
            {"twice": {"goes_on": {}, "align": {}}},
            "toys.yaml: methods.twice.align: not beside goes_on",
        ),
        (
            {"twice": {"goes_on": {}, "rounds": 1}},
            "toys.yaml: methods.twice.rounds: not beside goes_on",
        ),
        (
            {"twice": {"goes_on": {"share": 2}}},
            "toys.yaml: methods.twice.goes_on.share: 2",
        ),
    ],
)
def test_a_fault_is_one_line_with_the_key(
    tmp_path, snakemake, environment, change, message
):
    config = yaml.safe_load(CONFIG)
    config["methods"] = {"plain": {}} | change
    (tmp_path / "toys.yaml").write_text(yaml.safe_dump(config))
    options = ("-n", "--cores", "1", "--configfile", tmp_path / "toys.yaml")
    code, output = snakemake(tmp_path, *options, more=environment)
    assert code != 0
    assert message in output.strip().splitlines()[-1]
    assert "Traceback" not in output


def test_without_the_package_nothing_of_it_is_known(tmp_path, snakemake):
    (tmp_path / "toys.yaml").write_text(CONFIG)
    options = ("-n", "--cores", "1", "--configfile", tmp_path / "toys.yaml")
    code, output = snakemake(tmp_path, *options)
    assert code != 0
    assert "error: toys.yaml: " in output.strip().splitlines()[-1]
