"""External: another program trains and renders, by the commands in `external`.

Its trainings are values as ours are, and so it has rounds as a plain method has.
"""

import os
import shlex
from typing import ClassVar

import pydantic

from alignerf.captures import base as captures
from alignerf.experiment import jobs
from alignerf.experiment.checks import placeholders
from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys.key import Keys, key
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
    renders: str | None = key(
        None,
        "instead of both commands: folder of finished renders, <view>.png below; "
        "{scene} stands for the scene's name",
        pattern=r"\S",
    )
    depth: str | None = key(
        None, "beside renders: folder of their depth; {scene} too", pattern=r"\S"
    )
    gpu: int = key(0, "accelerators of each command", least=0, most=64)
    mem_mb: int | None = key(
        None, "memory of each command; null asks for the usual", least=1, most=10**9
    )

    @pydantic.model_validator(mode="after")
    def check_commands(self):
        """Both commands, or a folder instead; what stands in braces has a meaning."""
        for name, known in OF_COMMAND.items():
            command = getattr(self, name)
            if self.renders and command:
                raise ValueError(f"{name}: not beside renders: nothing is trained")
            if self.renders:
                continue
            if not command:
                raise ValueError(f"{name} is missing; both commands, or renders")
            check_command(name, command, known)
        if self.renders:
            return self
        if self.depth:
            what = "only beside renders: a command writes below {depth}"
            raise ValueError(f"depth: {what}")
        if "renders" not in placeholders.names(self.render):
            raise ValueError("render: {renders} is missing, the folder of its images")
        return self


def check_command(name, command, known):
    """ValueError where it has no words, or a place in braces without a meaning."""
    try:
        words = shlex.split(command)
        placeholders.check(command, known)
    except ValueError as error:
        raise ValueError(f"{name}: {error}; quotes are as in a shell") from None
    if not (words and words[0].strip()):
        raise ValueError(f"{name}: no program in it")


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
    folders = ("external.renders", "external.depth")

    def check(self, config, name):
        method, where = config["methods"][name], f"methods.{name}"
        chosen = method["external"]
        if chosen["renders"] and method["rounds"] != 0:
            what = "0 was expected: finished renders are not trained anew"
            fault(f"{where}.rounds", what)
        unknown = any(scene["steps"] is None for scene in config["scenes"].values())
        unknown = unknown or "steps" in config["training"]["decided"]
        for what in OF_COMMAND if unknown else ():
            if "steps" in placeholders.names(chosen[what] or ""):
                fault(f"{where}.external.{what}", "{steps} needs training.steps")
        crops = any(captures.of(one).parent(one) for one in config["scenes"].values())
        if crops and config["reference"]["method"] == name:
            what = "not with an external reference: its program trains no crops"
            fault("crops", what)
        super().check(config, name)

    def job(self, experiment, scene, name):
        """Its commands, and their numbers; not what it asks for of the machine."""
        commands = commands_of(experiment.methods[name])
        text = " ".join(filter(None, commands.values()))
        chosen = experiment.scenes[scene]
        used = {key: chosen[key] for key in ("seed", "steps") if f"{{{key}}}" in text}
        return Job(external=Commands(**commands, **used))

    def baseline(self, experiment, name):
        """The first with the same commands; of finished renders the reference."""
        known = experiment.methods
        if known[name]["external"]["renders"]:
            return experiment.config["reference"]["method"]
        return next(
            other
            for other in known
            if known[other]["external"]
            and commands_of(known[other]) == commands_of(known[name])
        )

    def subject(self, experiment, name):
        return [program(experiment.methods[name])]


def commands_of(method):
    """The commands of an external method, or the folders that stand for them."""
    asked = ("gpu", "mem_mb")
    return {key: v for key, v in method["external"].items() if key not in asked}


def program(method):
    """What tables call the program: its file's name, or where renders come from."""
    command = method["external"]["train"]
    if not command:
        return "finished renders"
    words = [part for word in shlex.split(command) for part in word.split()[:1]]
    names = [os.path.basename(w) for w in words if not (w[0] == "-" or "=" in w)]
    return next((name for name in names if name not in STARTERS), words[0])


METHOD = Other()
