"""Tables across scenes, or of a sweep: each is a rule and a target of its name."""

from collections.abc import Callable
from typing import NamedTuple

from alignerf.experiment import arguments, check, sources, sweep
from alignerf.experiment.tables import regimes, rows


class Across(NamedTuple):
    """One table below results/, and how it is made.

    stem: what its files are called. module: the command. sources: modules whose code
    that is. inputs, options, configs: functions of the experiment: outputs of rules
    that it waits for, words of its command line, the scenes' complete configs. All
    exit in one line where the config has nothing to make it of. beside: option and
    suffix of what is made beside the table. published: files beside the sources.
    """

    name: str
    stem: str
    module: str
    inputs: Callable
    options: Callable
    configs: Callable
    beside: tuple[str, str] = ("figure", ".png")
    published: tuple = ()
    sources: tuple = ()
    threads: int = 1


def every(experiment):
    """All of them."""
    published = rows.published_table()
    printed = {
        "published": published,
        "published-table": experiment.config["published_table"],
    }
    comparison = made_of_rows(
        *("comparison", regimes.comparison, of_scenes),
        more=arguments.options(printed),
    )
    return [
        made_of_rows("regimes", regimes.scenes, of_scenes, regimes.name(experiment)),
        made_of_rows("remedies", regimes.remedies, of_scenes),
        made_of_rows("tradeoff", sweep.rows, sweep.configs),
        comparison._replace(beside=("ranking", "_ranking.csv"), published=(published,)),
        # Its speeds are its own, so it takes the whole machine.
        Across(
            *("flow_benchmark", "flow_benchmark", "flow.benchmark"),
            arguments.benchmark_inputs,
            arguments.benchmark_options,
            lambda experiment: of_scenes(experiment, experiment.with_truth()[:1]),
            sources=("flow.benchmark", "flow.benchmark.large_pair"),
            threads=sources.WHOLE_MACHINE,
        ),
    ]


def made_of_rows(name, rows_of, configs, stem=None, *, more=()):
    """A table of `alignerf.tables` whose command reads rows, and files that they name.

    rows_of: function of the experiment; ValueError for a config that has no such rows.
    """
    module = f"alignerf.tables.{name}"

    def checked(experiment):
        return check.or_exit(rows_of, experiment)

    return Across(
        *(name, stem or name, module),
        inputs=lambda experiment: rows.files_of(checked(experiment)),
        options=lambda experiment: ["--rows", rows.as_json(checked(experiment)), *more],
        configs=lambda experiment: check.or_exit(configs, experiment),
        sources=(module,),
    )


def of_scenes(experiment, scenes=None):
    """The complete configs of scenes, or of all."""
    names = experiment.scenes if scenes is None else scenes
    return [f"results/{scene}/config.yaml" for scene in names]
