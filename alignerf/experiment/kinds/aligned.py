"""Aligned on the way: the training puts its cameras and photos right (`align`)."""

from alignerf.experiment.kinds import learnt


def takes(method):
    """A method with `align`."""
    return bool(method["align"])


trainings = learnt.trainings


def moves(method, round):
    return [key for key in ("cameras", "photos") if method["align"][f"{key}_at"]]


def words(experiment, name):
    what = moves(experiment.methods[name], 0)
    return [f"{' and '.join(what)} aligned on the way"]
