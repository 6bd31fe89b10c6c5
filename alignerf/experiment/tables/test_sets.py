"""Test sets: what a render is compared with, on which pixels, in which tables.

Each is one entry here. `alignerf.evaluate` scores them, tables show them in this order,
and docs/reference/files.md lists them.
"""

import functools
import sys
from collections.abc import Callable
from typing import NamedTuple

from alignerf.files.environment import extensions


class TestSet(NamedTuple):
    """What a render is compared with.

    pixels, meaning: in Markdown. needs: what a scene must have for it: `testset`, the
    warped test set; `truth`; `moving`, masks of what moves. make: from an
    `evaluate.View` to (image [h, w, 3] uint8, mask [h, w] of the pixels that count).
    tables: those that show it. moved: it is the render that differs, seen by a camera
    that was moved to fit the image; PSNR alone is scored.
    """

    name: str
    pixels: str
    meaning: str
    needs: str
    make: Callable
    tables: tuple[str, ...] = ()
    moved: bool = False


def photo(view):
    """The photo as it is."""
    return view.photo, view.everywhere


def oracle(view):
    """The undisplaced scene at the given pose."""
    return view.oracle, view.everywhere


def folder(name, mask):
    """An image beside the warped test set, on the pixels of a view's `mask`."""
    return lambda view: (view.of_testset(name), getattr(view, mask))


NEEDS = ("", "testset", "truth", "moving")
TABLES = {"misalignment", "regimes", "comparison", "remedies", "ranking", "controls"}
QUALITY = ("misalignment", "regimes", "comparison")
EVERY = (
    TestSet(
        *("standard", "all", "the held-out photo as it is", "", photo),
        (*QUALITY, "remedies", "ranking", "controls"),
    ),
    TestSet(
        *("standard_valid", "valid", "the photo", "testset"),
        lambda view: (view.photo, view.valid),
        ("controls",),
    ),
    TestSet(
        "warped",
        "valid",
        "the photo warped onto the reference model's render",
        "testset",
        folder("warped", "valid"),
        (*QUALITY, "ranking", "controls"),
    ),
    TestSet(
        "control",
        "all",
        "the photo warped by that flow and back by its inverse; nothing is displaced, "
        "only the interpolation acts",
        "testset",
        folder("control", "everywhere"),
        (*QUALITY, "ranking", "controls"),
    ),
    TestSet(
        "placebo",
        "all",
        "the photo warped by a random smooth flow of at most half a pixel, one for "
        "each view's name: what any warp does",
        "testset",
        folder("placebo", "everywhere"),
        ("controls",),
    ),
    TestSet(
        "crossfit",
        "valid",
        "the photo warped by a flow that was estimated without the pixel",
        "testset",
        folder("crossfit", "valid"),
        ("regimes", "ranking", "controls"),
    ),
    TestSet(
        "aligned",
        "matched",
        "an image that belongs where the reference model's render is: the oracle, or a "
        "stand-in, see below",
        "testset",
        folder("aligned", "overfit_valid"),
        ("controls",),
    ),
    TestSet(
        "overfit",
        "matched",
        "`aligned`, warped by the flow that the estimator invents between it and the "
        "render",
        "testset",
        folder("overfit", "overfit_valid"),
        ("controls",),
    ),
    TestSet(
        "overfit_crossfit",
        "matched",
        "`aligned`, warped by a held-out flow: what is displaced in truth",
        "testset",
        folder("overfit_crossfit", "overfit_valid"),
        ("controls",),
    ),
    TestSet(
        "oracle",
        "all",
        "courtyard only: the undisplaced scene at the pose that training was given, so "
        "what a method should have shown",
        "truth",
        oracle,
        (*QUALITY, "remedies", "controls"),
    ),
    TestSet(
        "oracle_still",
        "others",
        "courtyard with `motion: two_states`: the oracle, where no moving object is "
        "seen in either state",
        "moving",
        lambda view: (view.oracle, ~view.moving),
        ("misalignment",),
    ),
    TestSet(
        "oracle_moving",
        "moving",
        "the same where one is seen, and 3 px around it",
        "moving",
        lambda view: (view.oracle, view.moving),
        ("misalignment",),
    ),
    TestSet(
        "aligned_pose",
        "all",
        "the photo. The render's camera is moved to fit it by the flow, see below",
        "",
        photo,
        ("misalignment", "comparison", "remedies", "controls"),
        moved=True,
    ),
    TestSet(
        "aligned_pose_overfit",
        "all",
        "courtyard only: the oracle. The render's camera is moved to fit the oracle",
        "truth",
        oracle,
        ("controls",),
        moved=True,
    ),
)


@functools.cache
def every():
    """All of them, those of other packages last."""
    others = extensions.of_group("test_sets").values()
    names = [one.name for one in EVERY]
    extensions.check_new("test_sets", [one.name for one in others], names)
    for one in others:
        wrong = [one.needs] * (one.needs not in NEEDS) + sorted({*one.tables} - TABLES)
        if wrong or one.moved:
            what = f"unknown word {wrong[0]!r}" if wrong else "moved is not for others"
            sys.exit(f"error: alignerf.test_sets: {one.name}: {what}")
    return (*EVERY, *others)


def shown_in(table):
    """Names of those that a table shows, in its order."""
    return [one.name for one in every() if table in one.tables]


def markdown():
    """The list for docs/reference/files.md."""
    lines = [("test set", "pixels", "what a render is compared with", "shown in")]
    lines.append(["---"] * 4)
    for one in EVERY:
        tables = ", ".join(one.tables) or "`metrics.csv`"
        lines.append((f"`{one.name}`", one.pixels, one.meaning, tables))
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
