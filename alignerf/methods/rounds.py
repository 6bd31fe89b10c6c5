"""Rounds: each trains on photos that the round before warped, or with its cameras."""

from alignerf.experiment import jobs, schema, trainings
from alignerf.experiment.checks.common import fault
from alignerf.methods import base

KEYS = ("rounds", "max_rounds", "changes")


def corrects(method):
    """[what each round after the first changes]: `photos` or `cameras`.

    With `rounds: auto`, of all rounds that there may be.
    """
    last = method["rounds"] if method["rounds"] != "auto" else method["max_rounds"]
    if method["changes"] == "cameras_then_photos":
        return ["cameras"] * (last - 1) + ["photos"]
    return [method["changes"]] * last


def after(before, folder, job, what):
    """The round after a training: on photos that it warped, or with its cameras."""
    if what == "cameras":
        learns = {"cameras": trainings.corrected(before)}
    else:
        warped, valid = f"{before.path.warped}/train", f"{before.path.flow}/train"
        learns = {"photos": warped, "valid": valid, "cameras": before.cameras}
    taken = trainings.from_photos(before.scene, folder, job)
    return taken._replace(after=(before,), flows=(before,), **learns)


class Rounds(base.Method):
    """A method that trains again, round by round."""

    beside = (*base.Method.beside, *KEYS)

    def check(self, config, name):
        """There are the rounds that change the cameras, and one for the photos."""
        method, where = config["methods"][name], f"methods.{name}.changes"
        changes, rounds = method["changes"], method["rounds"]
        if changes == "cameras" and rounds == 0:
            fault(where, "cameras need a round to be corrected for")
        if changes == "cameras_then_photos" and (rounds == "auto" or rounds < 2):
            fault(where, "cameras_then_photos needs a number of rounds, 2 or more")

    def first(self, experiment, scene, name, job, once):
        """Round 0."""
        return once(trainings.from_photos(scene, f"{name}/round0", job))

    def job(self, experiment, scene, name):
        """What each round's training is told."""
        return schema.check(jobs.Full, trainings.common(experiment, scene, name))

    def trainings(self, experiment, scene, name, once):
        """Round 0, and every round that there may be after it."""
        job = self.job(experiment, scene, name)
        chain = [self.first(experiment, scene, name, job, once)]
        for what in corrects(experiment.methods[name]):
            before = chain[-1]
            training = after(before, f"{name}/round{len(chain)}", job, what)
            if self.goes_on:
                training = training._replace(initial=before.model)
            chain.append(once(training))
        return chain

    def moves(self, method, round):
        return frozenset(corrects(method)[:round])

    def words(self, experiment, name):
        changes = experiment.methods[name]["changes"]
        if changes == "photos":
            return []
        then = ", then photos" if changes == "cameras_then_photos" else ""
        return [f"cameras corrected{then}"]
