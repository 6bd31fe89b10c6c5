"""Learnt: the training learns its cameras with the scene (`refine`)."""

from alignerf.experiment import slices
from alignerf.experiment.trainings import from_photos


def takes(method):
    """A method with `refine`."""
    return bool(method["refine"])


def trainings(experiment, scene, name, once):
    job = slices.full(experiment, scene, name)
    truth = experiment.truth_of(scene)
    own = experiment.input_cameras(scene, name)
    return [once(from_photos(scene, f"{name}/round0", job, truth=truth, **own))]


def moves(method, round):
    return ["cameras"]


def words(experiment, name):
    return ["cameras learnt"]
