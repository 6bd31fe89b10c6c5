"""Tables across scenes: each is a rule and a target of its name."""

from collections.abc import Callable
from typing import NamedTuple

from alignerf.experiment import arguments, check
from alignerf.experiment.tables import rows, scenes


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


def every(experiment):
    """All of them."""
    published = rows.published_table()
    printed = {
        "published": published,
        "published-table": experiment.config["published_table"],
    }
    comparison = of_scenes("comparison", scenes.compared)
    return [
        of_scenes(
            "regimes", scenes.regimes, beside=("testset/displacement.csv",)
        )._replace(stem=experiment.config["regimes"]),
        of_scenes("remedies", scenes.remedies, beside=("facts.json",)),
        of_scenes("tradeoff", scenes.compared, of="comparison"),
        comparison._replace(
            options=lambda experiment: [
                *comparison.options(experiment),
                *arguments.options(printed),
            ],
            beside=("ranking", "_ranking.csv"),
            published=(published,),
        ),
    ]


def of_scenes(name, scenes_of, beside=(), of=None):
    """A table of `alignerf.tables` whose command reads the rows of several scenes.

    scenes_of: function of the experiment, to `Scene`s; ValueError for a config of which
    there is no such table. beside: files of each scene that it reads besides. of: the
    table whose rows it has, if not its own.
    """

    def checked(experiment):
        return check.or_exit(scenes_of, experiment)

    def inputs(experiment):
        return [
            path
            for scene in checked(experiment)
            for path in (
                *scenes.files(scene.scene, of or name),
                *(f"results/{scene.scene}/{path}" for path in beside),
            )
        ]

    module = f"alignerf.tables.across.{name}"
    return Across(
        *(name, name, module),
        inputs=inputs,
        options=lambda experiment: ["--scenes", rows.as_json(checked(experiment))],
        configs=lambda experiment: configs_of(experiment.captures()),
        sources=(module,),
    )


def configs_of(names):
    """The complete configs of scenes."""
    return [f"results/{name}/config.yaml" for name in names]
