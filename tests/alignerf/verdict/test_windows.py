"""Windows as the verdict reads them: photo by photo."""

import math

import numpy as np
import pandas as pd

from alignerf.verdict import windows


def table(folder, **flows):
    rows = [
        {"view": view, "flow_median_px": flow_px, "camera_median_px": flow_px / 2}
        for view, flow_px in flows.items()
    ]
    pd.DataFrame(rows).to_csv(folder / "decomposition_photos_train.csv", index=False)


def test_a_photo_has_the_median_of_its_windows(tmp_path):
    table(tmp_path, a_w0=1.0, a_w1=3.0, b_w_w0=5.0)
    np.testing.assert_array_equal(windows.of_photos(tmp_path, "train", "flow"), [2, 5])
    np.testing.assert_array_equal(
        windows.of_photos(tmp_path, "train", "camera"), [1, 2.5]
    )


def test_a_photo_without_valid_flow_spoils_no_other(tmp_path):
    table(tmp_path, a_w0=1.0, b_w0=math.nan, c_w0=3.0)
    flows = windows.of_photos(tmp_path, "train", "flow")
    assert windows.median(flows) == 2
    low, high = windows.interval_of_median(flows)
    assert 1 <= low <= high <= 3
    assert math.isnan(windows.median(flows[:0]))
    assert all(map(math.isnan, windows.interval_of_median(flows[:1])))


def test_without_windows_there_are_none():
    assert windows.read(None) is None
