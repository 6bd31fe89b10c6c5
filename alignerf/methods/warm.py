"""Warm: rounds that go on from the weights of the round before.

Round 0 is that of a plain method, which the config names.
"""

from typing import ClassVar, Literal

from alignerf import methods
from alignerf.experiment import jobs, schema, trainings
from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys import key as keys
from alignerf.methods import rounds


class WarmStart(keys.Keys):
    from_: str = keys.key(
        what="method of the same model that it starts from, at round 0", alias="from"
    )
    fraction: float = keys.key(
        0.3, "fraction of training.steps, in each round", above=0, most=1
    )
    learning_rates: list[float] = keys.learning_rates(0.01, 0.001)


class Job(jobs.Job):
    """A training that goes on from trained parameters."""

    continues: ClassVar = True
    annealed: ClassVar = False
    stage: Literal["warm"] = keys.key("warm")


class Warm(rounds.Rounds):
    """A method with `warm_start`."""

    key, Keys, order = "warm_start", WarmStart, 0
    what = (
        "each warping round goes on from the weights of the one before, instead of "
        "from scratch as in the paper"
    )
    goes_on = True
    jobs = (Job,)
    example = "{ rounds: 1, warm_start: { from: plain } }"

    def check(self, config, name):
        """It goes on from round 0 of a method that trains the same model."""
        method, where = config["methods"][name], f"methods.{name}.warm_start.from"
        start = method["warm_start"]["from"]
        source = config["methods"].get(start)
        if not source or not methods.of_method(source).from_scratch:
            fault(where, f"no method {start!r} from scratch")
        if source["model"] != method["model"]:
            fault(where, f"model {source['model']!r} instead of {method['model']!r}")
        if method["rounds"] == 0:
            fault(f"methods.{name}.rounds", "a warm start needs a round to start")
        super().check(config, name)

    def baseline(self, experiment, name):
        return experiment.methods[name]["warm_start"]["from"]

    def first(self, experiment, scene, name, job, once):
        return experiment.at(scene, self.baseline(experiment, name), 0)

    def job(self, experiment, scene, name):
        """Shorter, by rates of its own, from weights instead of from scratch."""
        start = experiment.methods[name]["warm_start"]
        job = trainings.common(experiment, scene, name)
        training = trainings.part_of(job["training"], start["fraction"])
        training["learning_rates"] = start["learning_rates"]
        return schema.check(Job, job | {"training": job["training"] | training})


METHOD = Warm()
