"""Rounds: each trains on photos that the round before warped, or with its cameras."""

from alignerf.experiment import jobs, trainings
from alignerf.experiment.checks.common import fault
from alignerf.methods import base

KEYS = ("rounds", "changes")


def after(before, folder, job, what):
    """The round after a training: on photos that it warped, or with its cameras."""
    if what == "cameras":
        learns = {"cameras": trainings.corrected(before)}
    else:
        valid = f"{before.path.flow}/train"
        learns = {"photos": trainings.warped(before), "valid": valid}
        learns["cameras"] = before.cameras
    taken = trainings.from_photos(before.scene, folder, job)
    return taken._replace(after=(before,), **learns)


class Rounds(base.Method):
    """A method that trains again, round by round."""

    beside = (*base.Method.beside, *KEYS)

    def check(self, config, name):
        """There is a round that changes the cameras."""
        method = config.methods[name]
        if method.changes == "cameras" and method.rounds == 0:
            fault(f"methods.{name}.changes", "cameras need a round to be corrected for")

    def job(self, experiment, scene, name):
        """What each round's training is told."""
        return jobs.Full(**trainings.common(experiment, scene, name))

    def trainings(self, experiment, scene, name, once):
        """Round 0, and every round after it."""
        job, method = self.job(experiment, scene, name), experiment.methods[name]
        chain = [once(trainings.from_photos(scene, f"{name}/round0", job))]
        for k in range(method.rounds):
            folder = f"{name}/round{k + 1}"
            chain.append(once(after(chain[-1], folder, job, method.changes)))
        return chain

    def moves(self, method, round):
        return frozenset([method.changes] if method.rounds and round != 0 else [])

    def words(self, experiment, name):
        changes = experiment.methods[name].changes
        return [] if changes == "photos" else ["cameras corrected"]
