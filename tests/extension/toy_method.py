"""A toy method: cameras are corrected once, and the training goes on."""

from alignerf.experiment import schema, trainings
from alignerf.experiment.keys import key as keys
from alignerf.methods import base, warm


class Settings(keys.Keys):
    """After the baseline's flow has put the cameras right, it trains on."""

    share: float = keys.key(0.5, "of the steps", above=0, most=1)


class GoesOn(base.Method):
    """A method with `goes_on`."""

    key, Keys = "goes_on", Settings

    def trainings(self, experiment, scene, name, once):
        """One training, from the weights and with the cameras of the baseline's."""
        first = experiment.at(scene, experiment.baseline(name), 0)
        job = trainings.common(experiment, scene, name)
        share = experiment.methods[name]["goes_on"]["share"]
        job["training"] |= trainings.part_of(job["training"], share)
        training = trainings.from_photos(
            *(scene, f"{name}/round0", schema.check(warm.Job, job)),
            cameras=trainings.corrected(first),
            initial=first.model,
            after=(first,),
            flows=(first,),
        )
        return [once(training)]

    def moves(self, method, round):
        return frozenset(["cameras"])

    def words(self, experiment, name):
        return ["cameras corrected once"]


METHOD = GoesOn()
