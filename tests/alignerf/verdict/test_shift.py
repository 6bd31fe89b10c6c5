"""One limit under which nothing is told of a shift, for the verdict and the page."""

import math

import pytest

from alignerf.page import pictures
from alignerf.verdict import shift
from tests.alignerf.verdict.test_causes import WELL


@pytest.mark.parametrize(
    ("overfit_px", "wanted"),
    [(None, 0.25), (math.nan, 0.25), (0.1, 0.25), (0.49, 0.49)],
)
def test_it_is_what_the_estimator_invents_and_a_quarter_at_the_least(
    overfit_px, wanted
):
    assert shift.told_px(overfit_px) == wanted
    assert pictures.limit_of({"overfit_px": overfit_px}) == wanted


def test_a_scene_is_misaligned_from_there_on():
    for px, wanted in ((0.99, False), (1.01, True)):
        flow_px = px * shift.told_px(WELL.overfit_px)
        assert shift.misaligned(WELL._replace(flow_train_px=flow_px)) is wanted
