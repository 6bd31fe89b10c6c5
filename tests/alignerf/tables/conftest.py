"""A row of the misalignment table, with its files."""

import json

import pandas as pd
import pytest

from alignerf.experiment.tables import rows as table_rows

VIEWS = ["a", "b", "c"]
NETS = ("alex", "squeeze", "vgg")


@pytest.fixture
def entry(tmp_path, rng):
    """One method's row after one warping round, with its files."""
    write_scores(tmp_path / "base.csv", rng)
    write_scores(tmp_path / "metrics.csv", rng)
    for number, seconds in enumerate((10.0, 20.0)):
        timing = {
            "train_time_s": seconds,
            "steps": 5,
            "rays_seen": 50,
            "params": number,
        }
        (tmp_path / f"train{number}.json").write_text(json.dumps(timing))
    (tmp_path / "render.json").write_text(json.dumps({"time_s": 3.0, "views": 7}))
    (tmp_path / "flow.csv").write_text("view,time_s\na,0.5\nb,0.25\n")
    return table_rows.Misalignment(
        method="my_method",
        field="grid 2^15",
        round=1,
        metrics=str(tmp_path / "metrics.csv"),
        base="plain",
        base_metrics=str(tmp_path / "base.csv"),
        trainings=[str(tmp_path / f"train{number}.json") for number in (0, 1)],
        data=[str(tmp_path / "render.json"), str(tmp_path / "flow.csv")],
    )


def write_scores(path, rng):
    rows = [
        {
            "view": view,
            "test_set": test_set,
            "psnr_db": rng.uniform(15, 25),
            "ssim": rng.uniform(),
            **{f"lpips_{net}": rng.uniform() for net in NETS},
        }
        for view in VIEWS
        for test_set in ("standard", "standard_valid", "warped", "control")
    ]
    pd.DataFrame(rows).to_csv(path, index=False)
