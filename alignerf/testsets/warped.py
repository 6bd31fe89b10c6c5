"""The photo warped onto the reference model's render: one set for all methods."""

from alignerf.testsets.base import QUALITY, Quantity, TestSet, folder

TEST_SETS = [
    TestSet(
        name="warped",
        pixels="valid",
        meaning="the photo warped onto the reference model's render",
        needs="testset",
        make=folder("warped", "valid"),
        tables=(*QUALITY, "ranking", "controls"),
        order=20,
        control_of="standard",
        score=Quantity("warped", 10),
        difference=Quantity("gain", 20),
    )
]
