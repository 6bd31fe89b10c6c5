"""Renders from test cameras that optical flow has fitted to the photo, or the oracle.

Moved cameras of a method see a test view elsewhere than its given camera says. A camera
that is fitted to the view on one half of its pixels scores the other half fairly.
"""

from alignerf.testsets.base import Quantity, TestSet, oracle, photo

TEST_SETS = [
    TestSet(
        name="aligned_pose",
        pixels="all",
        meaning="the photo; the render's camera is moved to fit it, see below",
        needs="",
        make=photo,
        tables=("misalignment", "comparison", "controls"),
        moved=True,
        order=120,
        control_of="standard",
        difference=Quantity("pose_gain", 120, "pose gain"),
        fair_for=frozenset({"cameras", "photos"}),
        preference=30,
        against="on held-out photos, by cameras moved to fit them",
    ),
    TestSet(
        name="aligned_pose_overfit",
        pixels="all",
        meaning="ground truth; the render's camera is moved to fit it",
        needs="truth",
        make=oracle,
        tables=("controls",),
        moved=True,
        order=130,
        control_of="oracle",
        difference=Quantity("pose_overfit", 130, "pose overfit"),
    ),
]
