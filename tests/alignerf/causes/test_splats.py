"""Rules are held to the splats that were judged: docs/measured/splat_verdicts.csv."""

import math

import pandas as pd
import pytest

from alignerf import causes
from alignerf.causes import base
from alignerf.io import provenance
from alignerf.verdict import report
from tests.alignerf.causes.cases import JUDGED, THEIRS

TABLE = provenance.ROOT / "docs" / "measured" / "splat_verdicts.csv"
ROWS = pd.read_csv(TABLE, comment="#").set_index("splat")
CALLED = {
    "camera": "poses",
    "lens_distortion": "lens",
    "lens_shift": "principal point",
    "undertrained_renders": "too short a training",
    "sparse": "too few photos",
    "few_views": "few photos",
}


def evidence(row):
    """The `Evidence` of a row; all else is as in a capture that is fine."""
    own = {key: row[key] for key in base.Evidence._fields if key in row}
    own |= {key: int(own[key]) for key in ("train_views", "test_views")}
    known = {key: row[f"matches_{key}"] for key in base.Matches._fields}
    known |= {key: known[key] is True for key in ("accepted", "applied")}
    return THEIRS._replace(
        **own,
        matches=base.Matches(**known),
        judged=JUDGED._replace(depth=row["depth"]),
        poses_given=True,
        reprojection_px=math.nan,
    )


@pytest.mark.parametrize("splat", ROWS.index)
def test_a_judged_splat_is_told_as_the_page_says(splat):
    row = ROWS.loc[splat]
    if row["wrong_pairs"]:
        pytest.skip("its pairs are tested in metrics")
    e = evidence(row.to_dict())
    found = causes.find(e)
    named = [
        CALLED.get(one.cause.name, one.cause.name) + " (probably)" * (not one.sure)
        for one in found
    ]
    assert "; ".join(named or ["nothing"]) == row["named"]
    assert report.state(e, found) == row["state"]


def test_most_of_them_are_right():
    """18 of 20 are the goal."""
    right = ROWS["right"].str.startswith("yes")
    assert right.mean() >= 0.8
