"""Rules are held to the cases into which faults were planted: planted.csv beside this.

`tools.bench.limits` has collected their evidence; docs/evidence/verdict.md tells of it.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from alignerf.causes.shared import at_stake
from tools.bench import limits

TABLE = pd.read_csv(Path(__file__).with_name("planted.csv"), comment="#")

# The captures of the second look, most of which fail without a fault.
UNSOUND = ("cup", "brighton", "bust", "fruit", "batmobile", "milk", "kangaroo", "mouse")


@pytest.fixture(scope="module")
def outcomes():
    rows = TABLE.to_dict("records")
    return [limits.judged(limits.of_row(row)) for row in rows], limits.is_strong(TABLE)


def test_what_costs_enough_is_named_first(outcomes):
    found, strong = outcomes
    named = [
        one.first_is_right
        for one, is_strong in zip(found, strong, strict=True)
        if is_strong and one.there
    ]
    assert len(named) > 200
    assert np.mean(named) >= 0.93


def test_little_else_is_named(outcomes):
    """Most of it on captures that fail without a fault."""
    found, _ = outcomes
    assert np.mean([len(one.false) for one in found]) <= 0.16
    poor = TABLE["capture"].isin(UNSOUND)
    sound = [one for one, is_poor in zip(found, poor, strict=True) if not is_poor]
    assert np.mean([len(one.false) for one in sound]) <= 0.05
    clean = [one for one in sound if not one.there]
    assert np.mean([not one.false for one in clean]) >= 0.95


def test_a_splat_s_own_size_poses_and_length_are_told():
    """By their names in docs/evidence/splats.md."""
    splats = TABLE[TABLE["trainer"].notna()].set_index("name")
    assert {*splats["trainer"]} == {"gsplat", "OpenSplat"}
    for name, cause in (
        ("fox_given", None),
        ("fox_p3", "camera"),
        ("chair_phone", "lens_shift"),
        ("fox_lens", "lens_distortion"),
        ("fox_tenth", "undertrained_renders"),
    ):
        row = splats.loc[name].to_dict() | {"capture": name.split("_")[0]}
        found = limits.judged(limits.of_row(row)).found
        assert found[:1] == [cause] * bool(cause), name


def test_costs_of_captures_that_were_left_out_lie_in_the_range():
    """Docs say: 70 % of them."""
    cases, inside = limits.sized(TABLE), []
    for capture in cases["capture"].unique():
        own = cases["capture"] == capture
        fits = limits.stakes(cases[~own])
        for row in cases[own & cases["cause"].isin([*fits])].itertuples():
            low, _, high = at_stake.of_fit(fits[row.cause], row.size)
            inside.append(low <= row.cost_db <= high)
    assert len(inside) > 150
    assert np.mean(inside) >= 0.65


def test_what_is_at_stake_follows_the_cases():
    """`python -m tools.bench.limits stakes` makes it: new limits ask for it, too."""
    found = limits.stakes(limits.sized(TABLE))
    assert limits.as_yaml(found) == at_stake.FITS.read_text()
    for name, fit in found.items():
        assert fit["sizes"] == sorted(fit["sizes"]), name
        assert fit["db"] == sorted(fit["db"]), name
        assert fit["low"] <= 1 <= fit["high"], name
