"""Write a scene's complete config: `python -m alignerf.config`.

A config says only what differs from the defaults. The complete config, written beside
the results, tells how these were made. `--check FILE` looks at a config and says what
it asks for, `--schema` prints the schema of `workflow/schemas/config.schema.yaml`.
"""

import yaml
from pydantic import json_schema

from alignerf.experiment import check
from alignerf.experiment.keys import config as config_keys
from alignerf.experiment.tables import shipped
from alignerf.io import atomic, faults, json_files, yaml_files

HEAD = "# Every key of a config, made by `python -m alignerf.config --schema`.\n"


OPTIONS = {
    "[config]": "JSON: the complete config of a scene",
    "[out]": "YAML, written",
    "[check]": "a config's file",
    "[schema]": ("print it", faults.FLAG),
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    if (args.config is None) != (args.out is None):
        raise ValueError("--config and --out go together")
    if not (args.config or args.check or args.schema):
        raise ValueError("nothing to do: --config with --out, --check or --schema")
    if args.schema:
        print(schema_text(), end="")
    if args.check:
        config = yaml_files.read(args.check)
        config = {"": {} if config is None else config}
        print(told(shipped.experiments(config, [args.check]).by_name[""]))
    if args.config:
        config = json_files.of_config(args.config)
        check.checked(config)
        with atomic.replace_file(args.out) as path:
            path.write_text(as_yaml(config))


def told(experiment):
    """What a config that is right asks for, in a line."""
    counts = {
        "scene": len(experiment.captures()),
        "method": len(experiment.methods),
        "training": sum(len(experiment.trainings(one)) for one in experiment.scenes),
    }
    return "ok: " + ", ".join(
        f"{n} {what}{'s' * (n != 1)}" for what, n in counts.items()
    )


class ForEditors(json_schema.GenerateJsonSchema):
    """Keys in the order of their classes; a kind may be left out."""

    def sort(self, value, parent_key=None):
        return value

    def field_title_should_be_set(self, schema):
        return False

    def tagged_union_schema(self, schema):
        return {"anyOf": super().tagged_union_schema(schema)["oneOf"]}

    def dict_schema(self, schema):
        found = super().dict_schema(schema)
        # A mapping of anything has its keys checked where it is used.
        patterns = "patternProperties" in found
        return found | {"additionalProperties": not patterns}


def schema_text():
    """The schema as YAML, as editors read it."""
    made = config_keys.Config.model_json_schema(schema_generator=ForEditors)
    # Else in the order in which the classes were first asked for.
    made["$defs"] = dict(sorted(made["$defs"].items()))
    return HEAD + as_yaml({"$schema": ForEditors.schema_dialect} | made)


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
