"""The held-out photo: all of it, and where the warped test set's flow is valid."""

from alignerf.testsets.base import QUALITY, Quantity, TestSet, photo

TEST_SETS = [
    TestSet(
        name="standard",
        pixels="all",
        meaning="the held-out photo as it is",
        needs="",
        make=photo,
        tables=(*QUALITY, "ranking", "controls"),
        order=0,
        score=Quantity("standard", 0),
        # Moved cameras see a test view elsewhere than its given camera.
        fair_for=frozenset({"photos"}),
        preference=20,
        against="on held-out photos",
    ),
    TestSet(
        name="standard_valid",
        pixels="valid",
        meaning="the photo",
        needs="testset",
        make=lambda view: (view.photo, view.valid),
        tables=("controls",),
        order=10,
        control_of="standard",
        difference=Quantity("pixel_choice", 30, "pixels", is_no_alignment=True),
    ),
]
