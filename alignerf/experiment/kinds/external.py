"""External: another program trains and renders, by the commands in `external`.

Its trainings are values as ours are, and so it has rounds as a plain method has.
"""

import os
import shlex

from alignerf.experiment import slices
from alignerf.experiment.kinds import plain, rounds
from alignerf.experiment.trainings import from_photos


def takes(method):
    """A method with `external`."""
    return bool(method["external"])


def trainings(experiment, scene, name, once):
    """Round 0, and every round that there may be after it."""
    job = slices.external(experiment, scene, name)
    first = once(from_photos(scene, f"{name}/round0", job))
    return rounds.from_first(first, experiment.methods[name], name, job, once)


def program(method):
    """What tables call the program: its file's name, or where renders come from."""
    command = method["external"]["train"]
    if not command:
        return "finished renders"
    words = [w for w in shlex.split(command) if "=" not in w and w[0] != "-"]
    names = [os.path.basename(word) for word in words]
    # Whoever only starts the program does not say what it is.
    starters = ("env", "python", "python3", "bash", "sh", "nice")
    return next((name for name in names if name not in starters), names[0])


words = plain.words
