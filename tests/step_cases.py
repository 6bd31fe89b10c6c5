"""Jobs of the rules, as Snakemake asks for them."""

import collections

from alignerf.experiment import steps


def inputs(rule, experiment, scene, **wildcards):
    """{name: path} of a job's inputs."""
    return rule_of(rule, experiment).inputs(named(scene=scene, **wildcards))


def options(rule, experiment, scene, **wildcards):
    """{option: its words} of a job's command."""
    asked = rule_of(rule, experiment)
    _, *words = asked.command(named(scene=scene, **wildcards))
    found = {}
    for word in words:
        if word.startswith("--"):
            name = word.removeprefix("--")
            found[name] = []
        else:
            found[name].append(word)
    return {k: v[0] if len(v) == 1 else v for k, v in found.items()}


def rule_of(name, experiment):
    return getattr(steps.Rules(experiment, lambda path: path), name)


def named(**wildcards):
    """A list of wildcards with names."""
    return collections.namedtuple("Wildcards", wildcards)(**wildcards)
