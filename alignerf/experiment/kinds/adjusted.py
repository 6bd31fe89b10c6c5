"""Adjusted: trained as a plain method is, by cameras that bundle adjustment corrected.

With `align` or `refine` beside it, it is of these kinds, and begins with such cameras.
"""

from alignerf.experiment.kinds import learnt


def takes(method):
    """A method with `adjust`."""
    return bool(method["adjust"])


trainings = learnt.trainings


def words(experiment, name):
    return []
