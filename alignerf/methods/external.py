"""External: another program trains and renders, by the commands in `external`.

Its trainings are values as ours are, and so it has rounds as a plain method has.
"""

import os
import shlex
from typing import ClassVar

from alignerf.captures import base as captures
from alignerf.experiment import jobs
from alignerf.experiment.checks import placeholders
from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys.key import PATH, Keys, key
from alignerf.methods import rounds

# Words that only start a program, as `env A=1` and `bash -c`.
STARTERS = ("env", "nice", "bash", "sh", "python", "python3", "conda", "run")
# What stands in braces in a command.
OF_TRAIN = ("data", "model", "cores", "seed", "steps", "scene", "round")
OF_COMMAND = {"train": OF_TRAIN, "render": (*OF_TRAIN, "renders", "depth")}


class External(Keys):
    """Another program, which trains and renders: docs/howto/any_trainer.md."""

    train: str | None = key(
        None,
        "command that trains; {data}, {model}, {cores}, {seed}, {steps}, {scene} and "
        "{round} stand for a folder or a number; no shell reads it",
        pattern=r"\S",
    )
    render: str | None = key(
        None,
        "command that renders all views as <view>.png below {renders} and, if it can, "
        "their depth as <view>.npy or .npz below {depth}; the others of train too",
        pattern=r"\S",
    )
    renders: PATH | None = key(
        None,
        "instead of both commands: folder of finished renders, <view>.png below; "
        "{scene} stands for the scene's name",
    )
    depth: PATH | None = key(None, "beside renders: folder of their depth; {scene} too")
    gpu: int = key(0, "accelerators of each command", least=0, most=64)
    mem_mb: int | None = key(
        None, "memory of each command; null asks for the usual", least=1, most=10**9
    )

    def faults(self):
        """Both commands, or a folder instead; what stands in braces has a meaning."""
        for name, known in OF_COMMAND.items():
            command = getattr(self, name)
            if self.renders and command:
                yield name, "not beside renders: nothing is trained"
            elif not (self.renders or command):
                yield "", f"{name} is missing; both commands, or renders"
            elif command and (reason := fault_of(command, known)):
                yield name, reason
        if self.depth and not self.renders:
            yield "depth", "only beside renders: a command writes below {depth}"
        if not self.renders and "renders" not in placeholders.names(self.render):
            yield "render", "{renders} is missing, the folder of its images"


def fault_of(command, known):
    """That it has no words, or a place in braces without a meaning; or None."""
    try:
        words = shlex.split(command)
        placeholders.check(command, known)
    except ValueError as error:
        return f"{error}; quotes are as in a shell"
    return None if words and words[0].strip() else "no program in it"


class Commands(Keys):
    """The commands of a training by another program, and the numbers in them."""

    train: str | None = key(None)
    render: str | None = key(None)
    renders: str | None = key(None)
    depth: str | None = key(None)
    seed: int | None = key(None)
    steps: int | None = key(None)


class Job(jobs.Text, Keys):
    """A training by another program."""

    ours: ClassVar = False
    part: ClassVar = None
    moves: ClassVar = frozenset()
    weights: ClassVar = None
    external: Commands = key()


class Other(rounds.Rounds):
    """A method with `external`."""

    key, Keys, order = "external", External, 6
    what = "another program trains and renders: in rounds, as ours are trained"
    beside = ("published", "lengths", *rounds.KEYS)
    ours = False
    example = "external: { train: 't {data}', render: 'r {renders}' }"

    def check(self, config, name):
        method, where = config.methods[name], f"methods.{name}"
        chosen = method.external
        if chosen.renders and method.rounds != 0:
            what = "0 was expected: finished renders are not trained anew"
            fault(f"{where}.rounds", what)
        unknown = any(scene.steps is None for scene in config.scenes.values())
        for what in OF_COMMAND if unknown else ():
            if "steps" in placeholders.names(getattr(chosen, what) or ""):
                fault(f"{where}.external.{what}", "{steps} needs training.steps")
        crops = any(captures.of(one).parent(one) for one in config.scenes.values())
        if crops and config.reference.method == name:
            what = "not with an external reference: its program trains no crops"
            fault("crops", what)
        super().check(config, name)

    def job(self, experiment, scene, name):
        """Its commands, and their numbers; not what it asks for of the machine."""
        commands = commands_of(experiment.methods[name])
        text = " ".join(filter(None, commands.values()))
        chosen = experiment.scenes[scene]
        used = ("seed", "steps")
        used = {key: getattr(chosen, key) for key in used if f"{{{key}}}" in text}
        return Job(external=Commands(**commands, **used))

    def baseline(self, experiment, name):
        """The first with the same commands; of finished renders the reference."""
        known = experiment.methods
        if known[name].external.renders:
            return experiment.config.reference.method
        return next(
            other
            for other in known
            if known[other].external
            and commands_of(known[other]) == commands_of(known[name])
        )

    def subject(self, experiment, name):
        return [program(experiment.methods[name])]


def commands_of(method):
    """The commands of an external method, or the folders that stand for them."""
    return method.external.model_dump(exclude={"gpu", "mem_mb"})


def program(method):
    """What tables call the program: its file's name, or where renders come from."""
    command = method.external.train
    if not command:
        return "finished renders"
    words = [part for word in shlex.split(command) for part in word.split()[:1]]
    names = [os.path.basename(w) for w in words if not (w[0] == "-" or "=" in w)]
    return next((name for name in names if name not in STARTERS), words[0])


METHOD = Other()
