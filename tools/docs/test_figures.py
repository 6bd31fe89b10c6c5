"""The figures of the pages show what their CSVs say."""

import pytest

from tools.docs import figures

MADE = """# commit: none
capture,size,flow_px,flow_mrad,remedy,aligned_gain_db,aligned_low_gain_db,\
aligned_high_gain_db,twice_gain_db,twice_low_gain_db,twice_high_gain_db
fox,400x300,2,5,plain training,,,,,,
fox,400x300,2,5,warped,0.5,0.4,0.7,-0.2,-0.3,0
fox,200x150,1,5,plain training,,,,,,
fox,200x150,1,5,warped,0.1,0,0.2,,,
oak,200x150,3,9,plain training,,,,,,
"""

BUDGET = """# commit: none
scene,method,test_set,seconds,psnr_db
courtyard,plain training,oracle,20,24.1
courtyard,plain training,oracle,80,24.9
courtyard,AligNeRF,oracle,30,24.0
"""


def test_gains_by_size_and_nothing_where_nothing_was_measured(tmp_path, monkeypatch):
    path = tmp_path / "docs/measured/resolution.csv"
    path.parent.mkdir(parents=True)
    path.write_text(MADE)
    (tmp_path / "docs/measured/budget.csv").write_text(BUDGET)
    (tmp_path / "docs/pictures").mkdir()
    drawn = {}
    monkeypatch.setattr(
        "matplotlib.axes.Axes.errorbar",
        lambda axes, x, y, ends, label, **_: drawn.update(
            {label: (pytest.approx(list(x)), list(y), ends.round(9).tolist())}
        ),
    )
    figures.main(["--root", str(tmp_path)])
    # Beside the size, so that no interval hides another.
    near = 1.03**-2
    assert drawn == {
        "warped, against as many steps": (
            [200 * near, 400 * near],
            [0.1, 0.5],
            [[0.1, 0.1], [0.1, 0.2]],
        ),
        "warped, against twice the steps": (
            [400 * near * 1.03],
            [-0.2],
            [[0.1], [0.2]],
        ),
    }
    for name in ("resolution", "budget"):
        assert (tmp_path / f"docs/pictures/{name}.png").stat().st_size > 10_000
