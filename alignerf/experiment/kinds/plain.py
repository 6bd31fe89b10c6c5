"""Plain: trained in one go on the photos as taken; then in rounds, if there are any."""

from alignerf.experiment import slices
from alignerf.experiment.kinds import rounds
from alignerf.experiment.trainings import from_photos


def takes(method):
    """Any method: what is left when no other kind takes it."""
    return True


def trainings(experiment, scene, name, once):
    """Round 0, and every round that there may be after it."""
    job = slices.full(experiment, scene, name)
    first = once(from_photos(scene, f"{name}/round0", job))
    return rounds.from_first(first, experiment.methods[name], name, job, once)


moves = rounds.moves


def words(experiment, name):
    changes = experiment.methods[name]["changes"]
    if changes == "photos":
        return []
    then = ", then photos" if changes == "cameras_then_photos" else ""
    return [f"cameras put right{then}"]
