"""Kinds of method: what each trains, stage by stage. One module for each kind.

A kind has `takes(method)`: whether a method's keys make it one; `trainings(experiment,
scene, name, once)`: the trainings of the method's rounds, round 0 first, where `once`
gives the equal training that another method has made already; and `words(experiment,
name)`: what tables say of the method besides its field.
"""

from alignerf.experiment.kinds import aligned, external, learnt, plain, staged, warm

# A method is of the first kind that takes it. `plain` takes all.
EVERY = (external, staged, warm, learnt, aligned, plain)


def of_method(method):
    """The kind of a method of the config."""
    return next(kind for kind in EVERY if kind.takes(method))
