"""Kinds of method: what each trains, stage by stage. One module for each kind.

A kind has `takes(method)`: whether a method's keys make it one; `trainings(experiment,
scene, name, once)`: the trainings of the method's rounds, round 0 first, where `once`
gives the equal training that another method has made already; and `words(experiment,
name)`: what tables say of the method besides its field. `moves(method, round)` gives
what the method has changed by a round, as `moves` below; without it that is nothing.
That of another package also has `KEY`, its key of a method; `Keys`, the class of what
stands there; and, if it likes, `check(config, name)`, which raises ValueError.
docs/develop/extending.md shows one.
"""

from alignerf.experiment.kinds import (
    adjusted,
    aligned,
    external,
    given,
    learnt,
    plain,
    staged,
    warm,
)
from alignerf.files.environment import extensions

OF_OTHERS = tuple(extensions.of_group("kinds").values())
# A method is of the first kind that takes it. `plain` takes all.
EVERY = (*OF_OTHERS, given, external, staged, warm, learnt, aligned)
EVERY += (adjusted, plain)


def of_method(method):
    """The kind of a method of the config."""
    return next(kind for kind in EVERY if kind.takes(method))


def words(experiment, name):
    """What tables say of a method besides its field."""
    adjusts = ["cameras adjusted"] * bool(experiment.methods[name].get("adjust"))
    return [*adjusts, *of_method(experiment.methods[name]).words(experiment, name)]


def moves(method, round=None):
    """What a method changes of what it learns from: `cameras`, `photos`, both, neither.

    round: what it has changed by then; None: by its last.
    """
    own = getattr(of_method(method), "moves", lambda *_: ())(method, round)
    return frozenset([*own, *["cameras"] * bool(method.get("adjust"))])
