"""The one limit under which a run tells nothing of a shift: `limit_px`.

The verdict, the page's legend and its colours all take it from here.
"""

import math

# Photos and renders of a scene in which nothing is wrong are 0.07 px apart. Under this
# length, in pixels of the training size, no capture is called misaligned.
ALIGNED_PX = 0.25


def limit_px(overfit_px):
    """The shortest shift that a run can tell, in pixels of the training size.

    overfit_px: the flow that the estimator invents where nothing is displaced; None or
    NaN where that is unknown.
    """
    unknown = overfit_px is None or math.isnan(overfit_px)
    return ALIGNED_PX if unknown else max(ALIGNED_PX, overfit_px)
