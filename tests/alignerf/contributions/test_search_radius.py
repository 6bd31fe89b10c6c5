"""The search radius follows from the misalignment that was measured."""

import numpy as np
import pytest

from alignerf.contributions import search_radius
from flow.estimation import folders
from flow.warping import files


@pytest.mark.parametrize(
    ("lengths_px", "wanted"),
    [
        ([0.0], 1),
        ([0.2, 0.9], 1),
        ([3.0, 3.0], 3),
        ([3.01], 4),
        ([2.5] * 99 + [40.0], 3),
        ([2.5, 4.5], 5),
        ([15.2, 15.9], 16),
        ([500.0, 400.0], 16),
    ],
)
def test_radius_of_measured_lengths(lengths_px, wanted, caplog):
    assert search_radius.radius_from(lengths_px) == wanted
    assert bool(caplog.records) == (max(lengths_px) > 16 and wanted == 16)


def test_a_reach_beyond_the_largest_radius_is_said(caplog):
    assert search_radius.radius_from([3.0, 21.25]) == 16
    (record,) = caplog.records
    assert (record.name, record.levelname) == ("alignerf", "WARNING")
    assert "16 px" in record.getMessage()
    assert "21.2 px" in record.getMessage()


def test_radius_reaches_nearly_every_pixel_and_no_further(rng):
    for _ in range(50):
        lengths_px = rng.gamma(2.0, 1.5, size=rng.integers(1, 60))
        radius_px = search_radius.radius_from(lengths_px)
        assert (lengths_px <= radius_px).mean() >= 0.95
        assert radius_px == 1 or lengths_px.max() > radius_px - 1


@pytest.mark.parametrize("lengths_px", [[], [1.0, np.nan], [np.inf], [-0.1, 2.0]])
def test_lengths_that_are_none_are_refused(lengths_px):
    with pytest.raises(ValueError, match="misalignment"):
        search_radius.radius_from(lengths_px)


def test_lengths_are_read_from_what_the_alignment_writes(tmp_path):
    rows = []
    for view, length_px in (("a", 2.0), ("b", 5.5)):
        flow_px = np.zeros((4, 6, 2), np.float32)
        flow_px[..., 1] = length_px
        valid = np.ones((4, 6), bool)
        found = files.statistics(flow_px, valid, view=view)
        rows.append({"view": view, **found, "blur_sigma_px": 0.0, "time_s": 1.0})
    path = tmp_path / "displacement.csv"
    files.write_rows(path, folders.COLUMNS, rows)
    assert search_radius.read_lengths_px(path).tolist() == [2.0, 5.5]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("view,median_px\na,1\n", "no column p95_px"),
        ("view,p95_px\n", "no row"),
        ("view,p95_px\na,1\nb,\n", "not finite"),
        ("view,p95_px\na,far\n", "p95_px: not numbers"),
        ("", "no row"),
        ('view,p95_px\n"a,1\n', "EOF inside string"),
    ],
)
def test_a_bad_table_is_named(tmp_path, content, told):
    path = tmp_path / "displacement.csv"
    path.write_text(content)
    with pytest.raises(ValueError, match=rf"displacement\.csv: .*{told}"):
        search_radius.read_lengths_px(path)
