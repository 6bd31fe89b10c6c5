"""Warm: rounds that go on from the weights of the round before.

Round 0 is that of a plain method, which the config names.
"""

from alignerf.experiment import slices
from alignerf.experiment.kinds import plain, rounds


def takes(method):
    """A method with `warm_start`."""
    return bool(method["warm_start"])


def trainings(experiment, scene, name, once):
    """Round 0 of the method that it starts from, and every round after it."""
    method = experiment.methods[name]
    first = experiment.at(scene, method["warm_start"]["from"], 0)
    job = slices.warm(experiment, scene, name)
    return rounds.from_first(first, method, name, job, once, goes_on=True)


moves, words = rounds.moves, plain.words
