"""A toy method: cameras are corrected once, and a shorter training follows."""

from alignerf.experiment import jobs, trainings
from alignerf.experiment.keys import key as keys
from alignerf.methods import base


class Settings(keys.Keys):
    """After the baseline's flow has put the cameras right, it trains anew."""

    share: float = keys.key(0.5, "of the steps", above=0, most=1)


class GoesOn(base.Method):
    """A method with `goes_on`."""

    key, Keys = "goes_on", Settings

    def trainings(self, experiment, scene, name, once):
        """One training, with the cameras that the baseline's flow has corrected."""
        first = experiment.at(scene, experiment.baseline(name), 0)
        job = trainings.common(experiment, scene, name)
        share = experiment.methods[name].goes_on.share
        steps = round(share * job["training"].steps)
        job["training"] = trainings.retimed(job["training"], steps)
        training = trainings.from_photos(
            *(scene, f"{name}/round0", jobs.Full(**job)),
            cameras=trainings.corrected(first),
            after=(first,),
        )
        return [once(training)]

    def moves(self, method, round):
        return frozenset(["cameras"])

    def words(self, experiment, name):
        return ["cameras corrected once"]


METHOD = GoesOn()
