"""Controls of the warped test set: photos warped by flows that align less, or nothing.

control        the photo warped by the flow and back: only interpolation acts
placebo        the photo warped by a random smooth flow of at most half a pixel
crossfit       the photo warped by a flow that has not seen the pixel it warps
"""

from alignerf.testsets.base import QUALITY, Quantity, TestSet, folder

TEST_SETS = [
    TestSet(
        name="control",
        pixels="all",
        meaning="the photo warped by that flow and back: resampling alone",
        needs="testset",
        make=folder("control", "everywhere"),
        tables=(*QUALITY, "ranking", "controls"),
        order=30,
        draw=lambda view: view.round_trip(),
        control_of="standard",
        difference=Quantity("resampling", 40, is_no_alignment=True),
    ),
    TestSet(
        name="placebo",
        pixels="all",
        meaning="the photo warped by a random smooth flow of at most half a pixel",
        needs="testset",
        make=folder("placebo", "everywhere"),
        tables=("controls",),
        order=40,
        draw=lambda view: view.warp(view.photo, view.placebo_px()),
        control_of="standard",
        difference=Quantity("placebo", 50, "(placebo)"),
    ),
    TestSet(
        name="crossfit",
        pixels="valid",
        meaning="the photo warped by a flow estimated without the pixel",
        needs="testset",
        make=folder("crossfit", "valid"),
        tables=("ranking", "controls"),
        order=50,
        draw=lambda view: view.warp(view.photo, view.crossfit_px),
        control_of="standard_valid",
        difference=Quantity("crossfit", 80),
    ),
]
