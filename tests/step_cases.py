"""Jobs of the rules, as Snakemake asks for them."""

from types import SimpleNamespace

from alignerf.experiment import steps


def inputs(rule, experiment, scene, **wildcards):
    """{name: path} of a job's inputs."""
    asked = getattr(steps.Rules(experiment, lambda path: path, None), rule)
    return asked.inputs(SimpleNamespace(scene=scene, **wildcards))


def options(rule, experiment, scene, **wildcards):
    """{option: its words} of a job's command."""
    asked = getattr(steps.Rules(experiment, lambda path: path, None), rule)
    _, *words = asked.command(SimpleNamespace(scene=scene, **wildcards))
    found = {}
    for word in words:
        if word.startswith("--"):
            name = word.removeprefix("--")
            found[name] = []
        else:
            found[name].append(word)
    return {
        name: values[0] if len(values) == 1 else values
        for name, values in found.items()
    }
