"""Tables across scenes, or of a sweep: each is a rule and a target of its name."""

from collections.abc import Callable
from typing import NamedTuple

from alignerf.experiment import arguments, sweep
from alignerf.experiment.tables import regimes, rows


class Across(NamedTuple):
    """One table: made by `alignerf.tables.<name>`, below results/.

    stem: what its files are called. rows, configs: functions of the experiment, the
    rows and the scenes' complete configs; ValueError where the config has none.
    beside: the option and the suffix of what is made beside the table. options: more
    words for its command line, and the files that it reads.
    """

    name: str
    stem: str
    rows: Callable
    configs: Callable
    beside: tuple[str, str] = ("figure", ".png")
    options: tuple = ()
    published: tuple = ()


def every(experiment):
    """All of them, in the order of the page of columns."""
    published = rows.published_table()
    more = arguments.options(
        {
            "published": published,
            "published-table": experiment.config["published_table"],
        }
    )
    ranking = ("ranking", "_ranking.csv")
    return [
        Across("regimes", regimes.name(experiment), regimes.scenes, of_scenes),
        Across("remedies", "remedies", regimes.remedies, of_scenes),
        Across("tradeoff", "tradeoff", sweep.rows, sweep.configs),
        Across(
            *("comparison", "comparison", regimes.comparison, of_scenes, ranking),
            options=tuple(more),
            published=(published,),
        ),
    ]


def of_scenes(experiment):
    """The complete configs of all scenes."""
    return [f"results/{scene}/config.yaml" for scene in experiment.scenes]
