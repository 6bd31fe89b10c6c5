"""The jobs of the rules: for each rule of the workflow one function makes its `Step`.

A function takes the experiment and the wildcards of a job. Rules ask `Rules`, whose
attributes are named after them.
"""

import functools

from alignerf.experiment import cluster, layout
from alignerf.experiment.sources import sources_of
from alignerf.experiment.steps import scenes, trainings


class Rules:
    """`Rule`s by their names.

    experiments: `plan.Experiments`, or one Experiment. local: marks a path in no
    storage, for Snakemake.
    """

    def __init__(self, experiments, local):
        self.experiments, self.local = experiments, local

    def __getattr__(self, name):
        step = vars(scenes).get(name) or vars(trainings)[name]
        found = Rule(functools.partial(self.of_scene, step), self.local)
        setattr(self, name, found)
        return found

    def of_scene(self, step, wildcards):
        """The `Step` of a job, by the experiment of its scene."""
        return step(self.experiments.of(wildcards.scene), wildcards)


class Rule:
    """What Snakemake asks of a rule, for the wildcards of each job."""

    def __init__(self, make, local):
        self.make, self.local = make, local
        self.last = None, None

    def step(self, wildcards):
        """The step of a job; of a training, nothing changes what it was last time."""
        if not hasattr(wildcards, "training"):
            return self.make(wildcards)
        if self.last[0] != (key := tuple(wildcards)):
            self.last = key, self.make(wildcards)
        return self.last[1]

    def inputs(self, wildcards):
        step = self.step(wildcards)
        found = {name: outputs(path) for name, path in step.inputs.items() if path}
        own = {name: self.local(path) for name, path in step.own.items() if path}
        return found | own

    def command(self, wildcards):
        return self.step(wildcards).command

    def sources(self, wildcards):
        return sources_of(*self.step(wildcards).modules)

    def threads(self, wildcards):
        return self.step(wildcards).threads

    def gpu(self, wildcards):
        return self.step(wildcards).gpu

    def memory_mb(self, wildcards, attempt):
        asked = self.step(wildcards).memory_mb
        return asked or cluster.usual_mb(wildcards, attempt)


def outputs(path):
    """The outputs of rules that a path, or several, are or lie in."""
    return layout.output_of(path) if isinstance(path, str) else layout.outputs_of(path)
