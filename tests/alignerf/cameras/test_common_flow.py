"""What all views' flows share is told from what each has."""

import numpy as np
import pytest

from alignerf.cameras import common_flow


def field(height=60, width=80):
    y, x = np.mgrid[:height, :width].astype(float)
    half = np.hypot(width, height) / 2
    return (x + 0.5 - width / 2) / half, (y + 0.5 - height / 2) / half


def test_what_all_flows_share_is_told_from_what_each_has(rng):
    x, y = field()
    square = x**2 + y**2
    flows = []
    for _ in range(12):
        own = rng.normal(scale=1.0, size=2)
        zoom = rng.normal(scale=0.5)
        flow = np.stack(
            [
                own[0] + 0.4 + zoom * x + 0.8 * x * square,
                own[1] + zoom * y + 0.8 * y * square,
            ],
            axis=-1,
        )
        flow[:5, :5] = np.nan
        flows.append(flow)
    found = common_flow.of_flows(np.stack(flows))
    assert found.distortion_px == pytest.approx(0.8, abs=0.02)
    assert found.distortion_error_px < 0.02
    assert found.shift_px[0] == pytest.approx(0.4, abs=4 * found.shift_error_px[0])
    assert 0.1 < found.shift_error_px[0] < 0.6


def test_a_view_without_flow_adds_nothing():
    nothing = np.full((3, 60, 80, 2), np.nan)
    known = np.ones_like(nothing)
    assert common_flow.of_flows([*nothing, *known]) == common_flow.of_flows(known)
    found = common_flow.of_flows(nothing)
    assert found.shift_px == (0.0, 0.0)
    assert np.isnan(common_flow.of_flows(nothing[:2]).distortion_error_px)
