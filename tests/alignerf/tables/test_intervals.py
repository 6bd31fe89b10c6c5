"""Intervals of means over views: they hold the mean as often as they say."""

import numpy as np
import pytest

from alignerf.tables import intervals


def coverage(draw, mean, *, cases=600):
    """Share of simulated samples whose interval holds the mean."""
    ends = [intervals.mean_interval(draw(), draws=2000) for _ in range(cases)]
    return np.mean([low <= mean <= high for low, high in ends])


@pytest.mark.parametrize("n", [6, 12, 40])
def test_normal_samples_are_covered_in_19_of_20_cases(rng, n):
    # Three standard errors of a share of 0.95 among 600 are 0.027.
    assert coverage(lambda: rng.normal(3.0, 2.0, n), 3.0) == pytest.approx(
        0.95, abs=0.03
    )


def test_plain_percentiles_would_hold_too_seldom(rng):
    """The reason for the widened tails, and that the test above can fail."""
    chosen = rng.integers(6, size=(2000, 6))

    def holds():
        means = rng.normal(size=6)[chosen].mean(axis=1)
        low, high = np.quantile(means, [0.025, 0.975])
        return low <= 0 <= high

    assert np.mean([holds() for _ in range(600)]) < 0.915


def test_a_skewed_sample_is_covered_nearly_as_often(rng):
    assert coverage(lambda: rng.gamma(4.0, size=12), 4.0) > 0.9


def test_it_moves_and_stretches_with_the_values(rng):
    values = rng.normal(size=7)
    low, high = intervals.mean_interval(values)
    assert low < values.mean() < high
    moved = intervals.mean_interval(3.0 * values + 5.0)
    np.testing.assert_allclose(moved, (3.0 * low + 5.0, 3.0 * high + 5.0))


def test_it_is_the_same_every_time(rng):
    values = rng.normal(size=9)
    assert intervals.mean_interval(values) == intervals.mean_interval(list(values))
    other = intervals.mean_interval(values, seed=1)
    assert other != intervals.mean_interval(values)
    np.testing.assert_allclose(other, intervals.mean_interval(values), atol=0.15)


def test_it_narrows_with_the_number_of_views(rng):
    widths = [
        np.diff(intervals.mean_interval(rng.normal(size=n)))[0] for n in (10, 100, 1000)
    ]
    assert widths[0] > 2 * widths[1] > 4 * widths[2]


def test_pairing_takes_out_what_the_views_fraction(rng):
    views = rng.normal(0.0, 5.0, 8)
    first, second = (views + rng.normal(0, 0.1, 8) for _ in range(2))
    single = np.diff(intervals.mean_interval(first + 1.0))[0]
    low, high = intervals.mean_interval(first + 1.0 - second)
    assert 0 < low < 1 < high + 0.3
    assert single > 10 * (high - low)


def test_few_views():
    assert np.isnan(intervals.mean_interval([])).all()
    assert np.isnan(intervals.mean_interval([20.0])).all()
    assert intervals.mean_interval([20.0, 21.0]) == (20.0, 21.0)
    assert intervals.mean_interval([20.0, 20.0, 20.0]) == (20.0, 20.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_view_without_a_number_leaves_no_interval(bad):
    assert np.isnan(intervals.mean_interval([20.0, bad, 22.0])).all()


@pytest.mark.parametrize("spread", [0.0, 0.3, 1.0, 3.0])
def test_pooled_interval_holds_the_mean_as_often_as_it_says(spread):
    """Seeds' and views' parts drawn from normals, views' of deviation 1."""
    rng = np.random.default_rng(0)
    hits = 0
    for _ in range(300):
        groups = [rng.normal(s, 1.0, 6) for s in rng.normal(0, spread, 3)]
        low, high = intervals.pooled_interval(groups, draws=1000)
        hits += low < 0 < high
    # Three deviations of a share of 300 about 0.95.
    assert hits / 300 > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 300)


def test_pooled_interval_of_one_seed_is_that_of_its_views():
    values = np.array([0.1, 0.4, -0.2, 0.3])
    assert intervals.pooled_interval([values]) == intervals.mean_interval(values)
    assert np.isnan(intervals.pooled_interval([values, [np.nan, 1.0]])).all()
    assert np.isnan(intervals.pooled_interval([values, [1.0]])).all()
