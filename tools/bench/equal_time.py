"""Scores at equal time, read off the line through a method's lengths of training."""

import numpy as np

# Seconds of equal trainings differ by up to this factor from run to run.
SLACK = 1.05


def at_time(own, time_s, test_set):
    """PSNR in dB of the views [n] at a time; NaN outside the times of the trainings.

    own: lines of one method and seed, of all its lengths.
    """
    lines = own[own["test_set"] == test_set]
    if lines["share"].nunique() < own["share"].nunique():
        return np.array([np.nan])
    wide = lines.pivot(
        index=["total_time_s", "share"], columns="view", values="psnr_db"
    ).sort_index(level="total_time_s")
    return interpolated(
        wide.index.get_level_values(0).to_numpy(), wide.to_numpy(), time_s
    )


def interpolated(seconds, psnr_db, time_s):
    """dB of the views [n] at a time; psnr_db: [lengths, n] after rising seconds."""
    if not seconds[0] / SLACK <= time_s <= seconds[-1] * SLACK:
        return np.full(psnr_db.shape[1], np.nan)
    at = np.log(np.clip(time_s, seconds[0], seconds[-1]))
    return np.array([np.interp(at, np.log(seconds), view) for view in psnr_db.T])
