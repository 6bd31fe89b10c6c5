"""What removing a cause is estimated to bring, in dB of held-out PSNR.

By faults that were planted: at_stake.yaml beside this is fitted by `tools.bench.limits`
to what each of them cost. docs/explain/verdict.md tells of it.
"""

import functools
import math
from pathlib import Path

import numpy as np

from alignerf.io import yaml_files

FITS = Path(__file__).with_name("at_stake.yaml")
# What is less, nobody sees; from so wide a range on, tenths say nothing.
LITTLE_DB, WIDE_DB = 0.3, 2.0


@functools.cache
def fits():
    """{name of a cause: {sizes, db, low, high}}: see `of_fit`."""
    return yaml_files.read(FITS)


def of(name, size):
    """(low, middle, high) in dB of a cause; None where nothing like it was planted.

    size: `base.Finding.size`; None of an unknown one.
    """
    fit = fits().get(name)
    return of_fit(fit, size) if fit and not math.isnan(size) else None


def of_fit(fit, size):
    """(low, middle, high) in dB: `db` at `sizes`, 0 at 0; `low` to `high` times it."""
    middle = float(np.interp(size, [0.0, *fit["sizes"]], [0.0, *fit["db"]]))
    return fit["low"] * middle, middle, fit["high"] * middle


def said(one):
    """What is at stake in words, with no more digits than its range allows.

    one: a `base.Finding`.
    """
    if one.at_stake is None:
        return "At stake: unknown."
    low, _, high = one.at_stake
    if high < LITTLE_DB:
        return f"At stake: under {LITTLE_DB} dB."
    digits = 0 if high - low >= WIDE_DB else 1
    ends = [f"{end:.{digits}f}" for end in (low, high)]
    if not float(ends[0]):
        return f"At stake: up to about {ends[1]} dB."
    return f"At stake: about {' to '.join(dict.fromkeys(ends))} dB."
