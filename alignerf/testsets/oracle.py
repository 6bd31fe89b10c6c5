"""Ground truth, where it is known: all of it, what is still, and what moves."""

from alignerf.testsets.base import QUALITY, Quantity, TestSet, oracle

TEST_SETS = [
    TestSet(
        name="oracle",
        pixels="all",
        meaning="ground truth: the undisplaced scene at the pose of the training",
        needs="truth",
        make=oracle,
        tables=(*QUALITY, "controls"),
        order=90,
        control_of="standard",
        score=Quantity("oracle", 100),
        difference=Quantity("oracle_gain", 110, "oracle gain"),
        fair_for=frozenset({"cameras", "photos"}),
        preference=10,
        against="against ground truth",
    ),
    TestSet(
        name="oracle_still",
        pixels="others",
        meaning="with `motion: two_states`: the same, where nothing moves",
        needs="moving",
        make=lambda view: (view.oracle, ~view.moving),
        tables=("misalignment",),
        order=100,
    ),
    TestSet(
        name="oracle_moving",
        pixels="moving",
        meaning="the same where something moves, and 3 px around it",
        needs="moving",
        make=lambda view: (view.oracle, view.moving),
        tables=("misalignment",),
        partial=True,
        order=110,
    ),
]
