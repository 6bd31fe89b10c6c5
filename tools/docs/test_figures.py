"""The figure of the pages shows what its CSV says."""

import io

import pandas as pd
from PIL import Image

from tools.docs import figures

BUDGET = """# commit: none
scene,method,test_set,seconds,psnr_db
courtyard,plain training,oracle,20,24.1
courtyard,plain training,oracle,80,24.9
courtyard,AligNeRF,oracle,30,24.0
"""


def test_methods_by_their_seconds(tmp_path, monkeypatch):
    drawn = []
    costs = figures.plots.costs
    monkeypatch.setattr(
        figures.plots,
        "costs",
        lambda table, path: (drawn.append(table), costs(table, path)),
    )
    path = tmp_path / "budget.png"
    figures.draw_budget(pd.read_csv(io.StringIO(BUDGET), comment="#"), path)
    (table,) = drawn
    assert table["total_time_s"].tolist() == [20, 80, 30]
    # AligNeRF takes longer than the first and is worse.
    assert table["pareto"].tolist() == [True, True, False]
    with Image.open(path) as image:
        assert image.size[0] > 400
