"""A job of a rule as a value, and the words of its command."""

import types
from collections.abc import Mapping
from typing import NamedTuple

from alignerf.io.environment import extensions


class Step(NamedTuple):
    """What a job runs, what it reads, and what it asks for.

    command: a module and its options. inputs: {name: path, or several}, below results/;
    None is left out. own: the same of a user's files, which lie in no storage. records:
    modules of registries' records that the job runs. memory_mb: None takes the usual.
    """

    command: list
    inputs: dict
    own: Mapping = types.MappingProxyType({})
    records: tuple | list = ()
    threads: int = 1
    gpu: int = 0
    memory_mb: int | None = None

    @property
    def modules(self):
        """All that it runs."""
        return [self.command[0], *self.records]


def words(module, **options):
    """A command: the module, and `--name value` of each option that has a value.

    A list stands as its entries, True as the name alone.
    """
    command = [module]
    for name, value in options.items():
        if value is None or value is False or value == []:
            continue
        command.append(f"--{name.replace('_', '-')}")
        entries = value if isinstance(value, list | tuple) else [value]
        command += [] if value is True else map(str, entries)
    return command


def estimator_of(experiment):
    """The module of the flow's estimator, if it is another package's."""
    return extensions.modules("estimators", experiment.config.flow.estimator)


def flow_options(experiment):
    """Options of the estimator's settings, without the name of `files`.

    Images that the run itself makes have no flows from elsewhere: with estimator
    `files`, theirs are estimated by the default one.
    """
    flow = experiment.config.flow
    return {
        "match_blur": flow.match_blur,
        "no_match_blur": not flow.match_blur,
        "tolerance_px": flow.tolerance_px,
        "method": None if flow.estimator == "files" else flow.estimator,
        "blur_by": flow.blur_by,
    }
