"""What the verdict reads of crops, and of another program's renders."""

import json
import math

import numpy as np
import pandas as pd

from alignerf.verdict import evidence


def table(folder, **flows):
    rows = [
        {"view": view, "flow_median_px": flow_px, "camera_median_px": flow_px / 2}
        for view, flow_px in flows.items()
    ]
    pd.DataFrame(rows).to_csv(folder / "decomposition_photos_train.csv", index=False)


def test_a_photo_has_the_median_of_its_crops(tmp_path):
    table(tmp_path, a_w0=1.0, a_w1=3.0, b_w_w0=5.0)
    np.testing.assert_array_equal(evidence.of_photos(tmp_path, "train", "flow"), [2, 5])
    np.testing.assert_array_equal(
        evidence.of_photos(tmp_path, "train", "camera"), [1, 2.5]
    )


def test_a_photo_without_valid_flow_spoils_no_other(tmp_path):
    table(tmp_path, a_w0=1.0, b_w0=math.nan, c_w0=3.0)
    flows = evidence.of_photos(tmp_path, "train", "flow")
    assert evidence.median(flows) == 2
    low, high = evidence.interval_of_median(flows)
    assert 1 <= low <= high <= 3
    assert math.isnan(evidence.median(flows[:0]))
    assert all(map(math.isnan, evidence.interval_of_median(flows[:1])))
    # One photo of nine that is far off moves no median, and the mean by 100.
    assert evidence.interval_of_median(np.array([1.0] * 8 + [900.0])) == (1.0, 1.0)


def test_without_crops_there_are_none():
    assert evidence.read_crops(None) is None


SHIFTS = {"flow_train_px": 1.2, "flow_test_px": None, "photo_px": 2.0}


def test_how_another_program_s_renders_were_put_together(tmp_path):
    """And what it was before, which is another file of the user's."""
    assert evidence.read_judged({"width": 4}) is None
    path = tmp_path / "first" / "verdict.json"
    path.parent.mkdir()
    path.write_text(json.dumps({"evidence": SHIFTS}))
    told = {"depth": "far", "cameras": "x", "layout": "x", "way": "taken"}
    found = evidence.read_judged({"external_renders": told}, path)
    assert (found.depth, found.before) == ("far", ("first", 2.4, None))
