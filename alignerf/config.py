"""Write a scene's complete config: `python -m alignerf.config`.

A config says only what differs from the defaults. The complete config, written beside
the results, tells how these were made. `--check FILE` looks at a config without
planning, `--schema` prints the schema of `workflow/schemas/config.schema.yaml`.
"""

import argparse
import copy

import yaml

from alignerf.experiment import check, jobs, schema
from alignerf.experiment.keys import config as config_keys
from alignerf.files import atomic, faults, yaml_files

HEAD = "# Every key of a config, made by `python -m alignerf.config --schema`.\n"


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--config", help="JSON: the complete config of a scene")
    parser.add_argument("--out", help="YAML, written")
    parser.add_argument("--check", help="a config's file")
    parser.add_argument("--schema", action="store_true", help="print it")
    args = parser.parse_args(argv)
    if (args.config is None) != (args.out is None):
        parser.error("--config and --out go together")
    if not (args.config or args.check or args.schema):
        parser.error("nothing to do: --config with --out, --check or --schema")
    if args.schema:
        print(schema_text(), end="")
    if args.check:
        config = yaml_files.read(args.check)
        check.checked({} if config is None else config, [args.check])
    if args.config:
        config = jobs.read(args.config)
        check.checked(copy.deepcopy(config))
        with atomic.replace_file(args.out) as path:
            path.write_text(as_yaml(config))


def schema_text():
    """The schema as YAML, as editors read it."""
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "config",
        "description": "A config says only what differs from the defaults.",
    }
    return HEAD + as_yaml(head | schema.root(config_keys.Config))


def as_yaml(value):
    """YAML without aliases, in the order of the keys."""

    class Plain(yaml.SafeDumper):
        def ignore_aliases(self, data):
            return True

    return yaml.dump(
        value, Dumper=Plain, sort_keys=False, width=88, default_flow_style=None
    )


if __name__ == "__main__":
    faults.run(main)
