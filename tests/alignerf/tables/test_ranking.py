"""Kendall's tau-b at its edges; whole tables of it are in test_controls."""

import math

import pytest

from alignerf.tables import ranking


@pytest.mark.parametrize(
    ("first", "second", "tau"),
    [
        ([1.0, 2.0, 3.0], [10.0, 20.0, 30.0], 1.0),
        ([1.0, 2.0, 3.0], [30.0, 20.0, 10.0], -1.0),
        ([1.0, 2.0], [3.0, 4.0], 1.0),
        ([1.0, 2.0], [4.0, 3.0], -1.0),
        ([1.0, 1.0], [3.0, 4.0], math.nan),
        ([1.0, 2.0], [3.0, 3.0], math.nan),
        ([1.0], [3.0], math.nan),
        # Of the pair that is tied in the second, neither order counts.
        ([1.0, 2.0, 3.0], [1.0, 1.0, 2.0], 2 / math.sqrt(6)),
    ],
)
def test_tau_of_few_rows_and_of_ties(first, second, tau):
    assert ranking.tau_b(first, second) == pytest.approx(tau, nan_ok=True)
