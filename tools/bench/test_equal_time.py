"""Scores at equal time, from curves that are known."""

import numpy as np
import pytest

from tools.bench import equal_time


def test_scores_are_read_off_over_the_logarithm_and_not_beyond(rng):
    """dB rise by 1 with each doubling of the time, of every view."""
    seconds = 100 * 2.0 ** np.arange(3)
    views = rng.normal(20, 2, 5)
    psnr_db = views + np.log2(seconds / 100)[:, None]
    for time_s in rng.uniform(100, 400, 20):
        found = equal_time.interpolated(seconds, psnr_db, time_s)
        assert found == pytest.approx(views + np.log2(time_s / 100))
    # Seconds vary: a little too short counts as long enough.
    assert equal_time.interpolated(seconds, psnr_db, 415.0) == pytest.approx(views + 2)
    for time_s in (90.0, 430.0):
        assert np.isnan(equal_time.interpolated(seconds, psnr_db, time_s)).all()
