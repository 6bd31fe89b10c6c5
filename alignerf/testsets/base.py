"""A test set: what a render is compared with, on which pixels, and what for."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

NEEDS = ("", "testset", "truth", "moving")
TABLES = {"misalignment", "comparison", "ranking", "controls"}


class Quantity(NamedTuple):
    """A line of controls.csv: its name, its place among the others, its heading.

    is_no_alignment: it is taken off the warped test set's gain.
    """

    name: str
    order: int
    heading: str = ""
    is_no_alignment: bool = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class TestSet:
    """What a render is compared with.

    pixels, meaning: in Markdown. needs: what a scene must have for it: `testset`, the
    warped test set; `truth`; `moving`, masks of what moves. make: from an
    `evaluate.View` to (image [h, w, 3] uint8, mask [h, w] of the pixels that count).
    tables: those that show it. moved: it is the render that differs, seen by a camera
    that was moved to fit the image; PSNR alone is scored. partial: some views may have
    no pixel for it, or no camera, and means and differences leave them out. order: its
    place in tables.

    draw: of a control set, from a `control_sets.View` to its image [h, w, 3] uint8.
    images: folders beside the warped photos that are written for it, its own first.
    control_of: the test set that it is set against; difference: what the difference in
    PSNR tells. score: what its own PSNR tells.

    fair_for: what a method may change of what it learns from (`cameras`, `photos`)
    without an unfair score by this set. preference: its place among sets by which
    methods are judged, the best first; None: methods are not judged by it. against:
    what a gain by this set is measured against, in words.
    """

    # Not a class of tests, whatever pytest takes it for.
    __test__ = False

    name: str
    pixels: str
    meaning: str
    make: Callable
    needs: str = ""
    tables: tuple[str, ...] = ()
    moved: bool = False
    partial: bool = False
    order: int = 1000
    draw: Callable | None = None
    images: tuple[str, ...] = ()
    control_of: str = ""
    difference: Quantity | None = None
    score: Quantity | None = None
    fair_for: frozenset[str] = frozenset()
    preference: int | None = None
    against: str = ""
