"""Whether another warping round is worth its training: `python -m flow.rounds`.

A round brings the renders nearer to the photos: the median flow of the training views
falls. Where it no longer does, there is nothing left that warping could align.
"""

import argparse
import csv
import json
import sys
from pathlib import Path

import numpy as np

from flow import files

# Falls by less are within what a training's random numbers change.
LEAST_FALL = 0.02


def decide(before_px, after_px, *, least_fall=LEAST_FALL):
    """(whether to go on, why): by the views' median flows of two rounds.

    before_px, after_px: [n] of the same views, None for no round before. The mean
    over the views must fall by a share of at least `least_fall`.
    """
    after = float(np.mean(after_px))
    if before_px is None:
        return after > 0, f"median flow {after:.3f} px without warping"
    before = float(np.mean(before_px))
    fall = (before - after) / before if before > 0 else 0.0
    change = f"median flow {before:.3f} -> {after:.3f} px ({-fall:+.1%})"
    goes_on = fall >= least_fall
    return (
        goes_on,
        f"{change}: a fall of {least_fall:.0%} is {'' if goes_on else 'not '}reached",
    )


def read_medians(path):
    """{view: median flow in px} of a CSV of `flow.align`."""
    try:
        with open(path, newline="") as file:
            found = {r["view"]: float(r["median_px"]) for r in csv.DictReader(file)}
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: no columns view and median_px ({error})") from None
    if not found or not np.isfinite(list(found.values())).all():
        raise ValueError(f"{path}: no finite median_px in every view")
    return found


def main(after, before, out):
    """Write the decision as JSON: go_on, reason. Raises ValueError or OSError."""
    now = read_medians(after)
    then = before and read_medians(before)
    if then and then.keys() != now.keys():
        raise ValueError(f"{after}: its views are not those of {before}")
    goes_on, reason = decide(then and [then[view] for view in now], list(now.values()))
    with files.replacing(out) as path:
        path.write_text(json.dumps({"go_on": goes_on, "reason": reason}) + "\n")


def run(arguments=None):
    """The command line; returns its exit code."""
    parser = argparse.ArgumentParser(prog="flow.rounds", description=__doc__)
    parser.add_argument("--after", type=Path, required=True, help="CSV of this round")
    parser.add_argument("--before", type=Path, help="CSV of the round before")
    parser.add_argument("--out", type=Path, required=True, help="JSON, written")
    try:
        main(**vars(parser.parse_args(arguments)))
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(run())
