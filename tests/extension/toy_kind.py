"""A toy kind of method: cameras are put right once, and the training goes on."""

from alignerf.experiment import slices
from alignerf.experiment.keys import key as keys
from alignerf.experiment.trainings import corrected, from_photos

KEY = "goes_on"


class Keys(keys.Keys):
    """After the baseline's flow has put the cameras right, it trains on."""

    share: float = keys.key(0.5, "of the steps", above=0, most=1)


def takes(method):
    """A method with `goes_on`."""
    return bool(method[KEY])


def check(config, name):
    """Raises ValueError for what does not go with it."""
    if config["methods"][name]["rounds"] != 0:
        raise ValueError(f"config: methods.{name}.{KEY}: not beside rounds")


def moves(method, round):
    """Cameras have moved."""
    return ["cameras"]


def trainings(experiment, scene, name, once):
    """One training, from the weights and with the cameras of the baseline's."""
    first = experiment.at(scene, experiment.baseline(name), 0)
    job = slices.full(experiment, scene, name) | {"stage": "warm"}
    share = experiment.methods[name][KEY]["share"]
    job["training"] |= slices.part_of(job["training"], share)
    training = from_photos(
        *(scene, f"{name}/round0", job),
        cameras=corrected(first),
        initial=first.model,
        after=(first,),
        flows=(first,),
    )
    return [once(training)]


def words(experiment, name):
    """What tables say of it besides its field."""
    return ["cameras put right once"]
