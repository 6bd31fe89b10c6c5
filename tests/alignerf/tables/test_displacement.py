"""The table of displacements: a view without a number leaves a mean empty."""

import numpy as np
import pandas as pd
import pytest

from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import displacement


@pytest.fixture
def row(tmp_path):
    """A method's row: two views, whose lengths and shares are all 0.25 and 0.75."""
    values = {name: [0.25, 0.75] for name in displacement.COLUMNS}
    pd.DataFrame(values).to_csv(tmp_path / "stats.csv", index=False)
    return table_rows.Displacement("plain", 0, str(tmp_path / "stats.csv"))


def lose(row, name, views):
    """These views have no number in a column."""
    stats = pd.read_csv(row.stats)
    stats.loc[views, name] = np.nan
    path = row.stats.replace("stats", f"{name}_{len(views)}")
    stats.to_csv(path, index=False)
    return row._replace(stats=path)


@pytest.mark.parametrize("name", ["flow_median_px", "camera_share", "remainder_p95_px"])
def test_one_view_without_a_number_leaves_the_mean_empty(row, name):
    table = displacement.make_table([row, lose(row, name, [1])])
    assert table[name].isna().tolist() == [False, True]
    rest = table.drop(columns=name)
    assert rest.notna().all(axis=None)
    tex = displacement.to_latex(table)
    assert tex.count("--") == 1
    assert "nan" not in tex


def test_a_part_that_no_row_has_is_left_out(row):
    lengths = [f"model_{length}" for length in displacement.LENGTHS]
    without = row
    for name in lengths:
        without = lose(without, name, [0, 1])
    tex = displacement.to_latex(displacement.make_table([without]))
    assert "Model" not in tex
    assert "--" not in tex
    tex = displacement.to_latex(displacement.make_table([row, without]))
    assert "Model" in tex
    assert tex.count("--") == len(lengths)
