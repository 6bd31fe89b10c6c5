"""The program's own test sets, of own.yaml."""

from pathlib import Path

import yaml

from alignerf.testsets.base import Quantity, TestSet

# Masks of an `evaluate.View`, by what `pixels` says of them.
MASKS = {
    "all": "everywhere",
    "valid": "valid",
    "matched": "overfit_valid",
    "moving": "moving",
    "others": "still",
}
# What a scene has to have for an image; None: the set's own.
NEEDS = {"photo": "", "oracle": "truth", None: "testset"}
# Images of control sets, of a `control_sets.View`.
DRAWN = {
    "control": lambda view: view.round_trip(),
    "placebo": lambda view: view.warp(view.photo, view.placebo_px()),
    "crossfit": lambda view: view.warp(view.photo, view.crossfit_px),
    "aligned": lambda view: view.aligned,
    "overfit": lambda view: view.warp(view.aligned, view.invented_px),
    "overfit_crossfit": lambda view: view.warp(
        view.aligned, view.held_out_px(view.aligned)
    ),
}


def read():
    """All of them."""
    text = Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")
    every = enumerate(yaml.safe_load(text).items())
    # Those of other files may stand between them.
    return [of_entry(name, order=10 * k, **one) for k, (name, one) in every]


def of_entry(name, *, pixels, image=None, fair_for=(), **entry):
    """The test set of an entry."""

    def make(view):
        shown = getattr(view, image) if image else view.of_testset(name)
        return shown, getattr(view, MASKS[pixels])

    for key in ("score", "difference"):
        if key in entry:
            entry[key] = Quantity(*entry[key])
    # A view has no such pixel where no flow is valid, or nothing moves.
    partial = pixels in ("valid", "matched", "moving")
    entry = {"needs": NEEDS[image], "partial": partial} | entry
    entry |= {"draw": DRAWN.get(name), "fair_for": frozenset(fair_for)}
    return TestSet(name=name, pixels=pixels, make=make, **entry)


TEST_SETS = read()
