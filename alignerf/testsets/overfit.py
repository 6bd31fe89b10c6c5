"""What a flow estimator invents where nothing is displaced.

aligned        an image that belongs where the render is: the oracle, or a copy of
               the render made as sharp and as different as the photo
overfit        that image warped by the flow invented between it and the render
overfit_crossfit
               that image warped by a held-out flow: what is displaced in truth
"""

from alignerf.testsets.base import Quantity, TestSet, folder

TEST_SETS = [
    TestSet(
        name="aligned",
        pixels="matched",
        meaning="an image aligned with the reference model's render, see below",
        needs="testset",
        make=folder("aligned", "overfit_valid"),
        tables=("controls",),
        order=60,
        draw=lambda view: view.aligned,
    ),
    TestSet(
        name="overfit",
        pixels="matched",
        meaning="`aligned`, warped by the flow found between it and the render",
        needs="testset",
        make=folder("overfit", "overfit_valid"),
        tables=("controls",),
        order=70,
        draw=lambda view: view.warp(view.aligned, view.invented_px),
        images=("overfit", "overfit_flow"),
        control_of="overfit_crossfit",
        difference=Quantity("overfit", 60, is_no_alignment=True),
    ),
    TestSet(
        name="overfit_crossfit",
        pixels="matched",
        meaning="`aligned`, warped by a flow estimated without the pixel",
        needs="testset",
        make=folder("overfit_crossfit", "overfit_valid"),
        tables=("controls",),
        order=80,
        draw=lambda view: view.warp(view.aligned, view.held_out_px(view.aligned)),
        control_of="aligned",
        difference=Quantity("oracle_offset", 90, "oracle offset"),
    ),
]
