"""Kendall's tau-b between test sets, at its edges and over views."""

import math

import numpy as np
import pandas as pd
import pytest
import scipy.stats

from alignerf.tables import ranking
from tests import table_cases
from tests.table_cases import made

VIEWS = 6
SETS = (*ranking.TEST_SETS, "oracle", ranking.OPTIONAL)


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


def ranked(oracle, other):
    """The table of rows whose oracle and other means are these, each view alike."""
    rows = [
        table_cases.row(
            dict.fromkeys(SETS, np.full(VIEWS, of_other))
            | {"oracle": np.full(VIEWS, of_oracle)},
            round=number,
        )
        for number, (of_oracle, of_other) in enumerate(zip(oracle, other, strict=True))
    ]
    return made(ranking.make_table, rows)


def test_tau_counts_pairs_in_the_same_order():
    assert ranked([1, 2, 3, 4], [5, 6, 7, 8])["tau"].tolist() == [1.0] * 5
    assert ranked([1, 2, 3, 4], [8, 7, 6, 5])["tau"].tolist() == [-1.0] * 5
    # Five pairs of six in the same order, one not.
    table = ranked([1, 2, 3, 4], [5, 7, 6, 8])
    np.testing.assert_allclose(table["tau"], (5 - 1) / 6)
    # The same for every view, so for every draw of views.
    np.testing.assert_allclose(table["tau_low"], table["tau"])
    np.testing.assert_allclose(table["tau_high"], table["tau"])
    # Tau-b: a tie in one is a pair for the other alone.
    tied = ranked([1, 2, 3, 4], [5, 5, 7, 8])
    np.testing.assert_allclose(tied["tau"], 5 / np.sqrt(6 * 5))
    tied = ranked([1, 2, 3, 4], [5, 5, 5, 5])
    assert tied["tau"].isna().all()
    assert {row[1] for row in table_cases.cells(ranking.to_latex(tied))} == {"--"}


def test_an_interval_of_tau_is_over_views(rng):
    # Noise of single views is larger than what the methods differ in.
    rows = [
        table_cases.row(
            {name: k / 2 + rng.normal(size=VIEWS) for name in SETS}, round=k
        )
        for k in range(4)
    ]
    table = made(ranking.make_table, rows)
    assert set(table["rows"]) == {4}
    assert set(table["views"]) == {VIEWS}
    assert ((table["tau_low"] <= table["tau"]) & (table["tau"] <= 1)).all()
    assert (table["tau_low"] < 0.7).all()
    pd.testing.assert_frame_equal(made(ranking.make_table, rows), table)
    tex = ranking.to_latex(table)
    assert "Ranking of 4 methods and rounds" in tex
    assert "over 6 views" in tex
    assert table_cases.cells(tex)[3][0] == "crossfit"


def test_views_that_agree_and_views_that_do_not_open_the_interval():
    """Half of the views rank one way, half the other: draws differ from each other."""
    oracle = np.array([[1.0, 1, 1, 1, 1, 1], [2, 2, 2, 2, 2, 2]])
    other = np.array([[0.0, 0, 0, 9, 9, 9], [2, 2, 2, 8, 8, 8]])
    tau, low, high = ranking.tau_of(oracle, other)
    assert (low, high) == (-1, 1)
    assert tau == 1
    one = ranking.tau_of(oracle[:, :3], other[:, :3])
    assert one == (1, 1, 1)


@pytest.mark.parametrize("rows", [3, 7])
def test_tau_is_that_of_scipy(rng, rows):
    first, second = rng.integers(0, 4, (2, 20, rows)).astype(float)
    expected = [
        scipy.stats.kendalltau(*pair).statistic
        for pair in zip(first, second, strict=True)
    ]
    np.testing.assert_allclose(ranking.tau_b(first, second), expected)


@pytest.mark.parametrize("lost", [[0], [1, 4], range(VIEWS)])
def test_views_that_a_set_has_no_pixel_of_are_left_out(rng, lost):
    noise = rng.normal(size=VIEWS)
    own = np.where(np.isin(np.arange(VIEWS), lost), np.nan, noise)
    rows = [
        table_cases.row(dict.fromkeys(SETS, noise + k) | {"warped": own + k}, round=k)
        for k in range(3)
    ]
    table = made(ranking.make_table, rows).set_index("test_set")
    assert table["views"].pop("warped") == VIEWS - len(lost)
    assert np.isnan(table["tau"].pop("warped")) == (len(lost) == VIEWS)
    assert (table["views"] == VIEWS).sum() == len(table) - 1
    assert (table["tau"].dropna() == 1).all()


def test_what_some_row_lacks_is_not_ranked_or_named():
    whole = table_cases.row({key: [20.0, 21.0] for key in SETS})
    without = table_cases.row({key: [20.0, 21.0] for key in SETS[:-1]}, round=1)
    table = made(ranking.make_table, [whole, without])
    assert table["test_set"].tolist() == [*ranking.TEST_SETS]
    lacking = table_cases.row({key: [20.0, 21.0] for key in SETS[1:]}, "other", 1)
    with pytest.raises(ValueError, match="other after round 1: no test set 'standard'"):
        made(ranking.make_table, [whole, lacking])
