"""The shipped configs whose names are targets: the paper's tables, figures, the trade.

`snakemake table1` needs no --configfile: beside the demo, these are part of every plan
that names no config.
"""

import pydantic

from alignerf.experiment import check, plan
from alignerf.experiment.checks.common import fault
from alignerf.io import provenance, yaml_files

FOLDER = provenance.PIPELINE / "workflow" / "config"
DEMO = FOLDER / "demo.yaml"
TABLES = ("table1", "table2", "table3", "table4")
FIGURES = "figures"
NAMES = (*TABLES, FIGURES, "tradeoff")
# The target that makes all of these.
PAPER = "paper"


def configs(overrides):
    """{target: config} of all that are shipped; "" is the demo's.

    overrides: what `--config` gives. With `small: false` those alone that have a full
    size.
    """
    try:
        small = pydantic.TypeAdapter(bool).validate_python(overrides.get("small", True))
    except pydantic.ValidationError:
        fault("small", f"{overrides['small']!r} is neither true nor false")
    found = {}
    for name, path in {"": DEMO, **{n: FOLDER / f"{n}.yaml" for n in NAMES}}.items():
        config = yaml_files.read(path)
        if small or "full_size" in config:
            found[name] = merged(config, overrides)
    return found


def merged(config, overrides):
    """A config with others' keys, mappings merged as Snakemake merges them."""
    found = dict(config)
    for key, value in overrides.items():
        inside = isinstance(value, dict) and isinstance(found.get(key), dict)
        found[key] = merged(found[key], value) if inside else value
    return found


def experiments(given, files, words=()):
    """`plan.Experiments` of configs by name; files: those of a user's config.

    words: of the command line. A config that they do not ask for is left out where it
    cannot run, as without its photos. Raises ValueError, naming key and files.
    """
    asked, found = {"", *needed(words or ())}, {}
    for name, config in given.items():
        try:
            checked = check.checked(config, files, tell=name in asked)
            experiment = plan.Experiment(checked)
            for rule in (plan.check_equal, plan.check_lengths, plan.check_losses):
                check.named(files, rule, experiment)
            found[name] = experiment
        except ValueError:
            if name in asked:
                raise
    return plan.Experiments(found)


def needed(words):
    """Targets of which the words of a command line make something."""
    if PAPER in words:
        return NAMES
    # The figures are of a scene of Table 1, too.
    return [*words, *["table1"] * (FIGURES in words)]
