"""External: another program trains and renders, by the commands in `external`.

Its trainings are values as ours are, and so it has rounds as a plain method has.
"""

import os
import shlex

from alignerf.experiment import slices
from alignerf.experiment.kinds import plain, rounds
from alignerf.experiment.trainings import from_photos

STARTERS = ("env", "nice", "bash", "sh", "python", "python3", "conda", "run")


def takes(method):
    """A method with `external`."""
    return bool(method["external"])


def trainings(experiment, scene, name, once):
    """Round 0, and every round that there may be after it."""
    job = slices.external(experiment, scene, name)
    first = once(from_photos(scene, f"{name}/round0", job))
    return rounds.from_first(first, experiment.methods[name], name, job, once)


def program(method):
    """What tables call the program: its file's name, or where renders come from.

    What only starts the program, as `env A=1` and `bash -c`, does not say what it is.
    """
    command = method["external"]["train"]
    if not command:
        return "finished renders"
    words = [part for word in shlex.split(command) for part in word.split()[:1]]
    names = [os.path.basename(w) for w in words if not (w[0] == "-" or "=" in w)]
    return next((name for name in names if name not in STARTERS), words[0])


moves, words = rounds.moves, plain.words
