"""The lists of the reference that the program itself tells: keys, options, commands.

Each function gives Markdown. `keys` reads the schema of a config, `options` a module's
own parser, `make` and `targets` the heads of Makefile and Snakefile.
"""

import argparse
import contextlib
import functools
import importlib
import re
from unittest import mock

import yaml

from alignerf import config

TOP = "Config"
# What no table cell may hold as it is.
UNSAFE = str.maketrans({"|": r"\|", "\n": " ", "<": "&lt;", ">": "&gt;"})


def keys(name):
    """A table of a class of the config's schema: key, values, default, meaning."""
    if name != TOP and name not in schema()["$defs"]:
        raise ValueError(f"workflow/schemas/config.schema.yaml: no class {name}")
    of = schema() if name == TOP else schema()["$defs"][name]
    lines = [("key", "values", "default", "meaning"), ("---",) * 4]
    for key, own in of["properties"].items():
        said = " ".join(own.get("description", "").split()).translate(UNSAFE)
        lines.append((f"`{key}`", values(own), default(own), said))
    return rows(lines)


def classes():
    """Names that `keys` takes."""
    return [TOP, *schema()["$defs"]]


@functools.cache
def schema():
    return yaml.safe_load(config.schema_text())


def values(own):
    """What a key may be, in words."""
    if "anyOf" in own:
        return " or ".join(dict.fromkeys(map(values, own["anyOf"])))
    if "$ref" in own:
        name = own["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "const" in own or "enum" in own:
        allowed = own.get("enum", [own.get("const")])
        return ", ".join(f"`{one}`" for one in allowed)
    if own["type"] == "array":
        return f"list of {values(own['items'])}" if "items" in own else "list"
    if own["type"] == "object":
        inside = next(iter(own.get("patternProperties", {}).values()), None)
        return f"name: {values(inside)}" if inside else "mapping"
    words = {"string": "text", "boolean": "true, false", "integer": "whole number"}
    return words.get(own["type"], own["type"]) + bounds(own)


def bounds(own):
    """`, 1 to 64` of a number; nothing where it has none."""
    low, above = own.get("minimum"), own.get("exclusiveMinimum")
    high, below = own.get("maximum"), own.get("exclusiveMaximum")
    first = f"above {above}" if above is not None else low
    last = f"below {below}" if below is not None else high
    ends = [f"{end:g}" if isinstance(end, float) else end for end in (first, last)]
    if None in ends:
        told = [end for end in ends if end is not None]
        return f", {'from' if ends[1] is None else 'to'} {told[0]}" if told else ""
    return f", {ends[0]} to {ends[1]}"


def default(own):
    """A default as YAML, in one line; nothing where the key is needed or a class."""
    if "default" not in own:
        return ""
    text = yaml.safe_dump(
        own["default"], default_flow_style=True, width=1000, sort_keys=False
    )
    text = text.removesuffix("...\n").strip()
    return f"`{text}`"


def options(module):
    """A table of a module's options: how each is written, and what it means."""
    lines = [("option", "meaning"), ("---",) * 2]
    for action in parser_of(module)._actions:
        if action.dest == "help":
            continue
        name = action.option_strings[-1] if action.option_strings else action.dest
        if action.option_strings and action.nargs != 0:
            name += f" {action.metavar or action.dest.upper()}"
        said = [action.help, action.choices and f"one of {', '.join(action.choices)}"]
        meaning = "; ".join(filter(None, said)).translate(UNSAFE)
        lines.append((f"`{name}`", meaning))
    return rows(lines)


def parser_of(module):
    """The parser that a module's `main` makes; nothing is run."""
    made = []

    def stop(parser, *_, **__):
        made.append(parser)
        raise SystemExit

    main = importlib.import_module(module).main
    patched = mock.patch.object(argparse.ArgumentParser, "parse_args", stop)
    with patched, contextlib.suppress(SystemExit):
        main([])
    if not made:
        raise ValueError(f"{module}: main makes no parser")
    return made[0]


def make(makefile):
    """The commands of a Makefile's head, as it says them."""
    return told(makefile.read_text(), r"# (make .+?)  +(.+)")


def targets(snakefile):
    """The commands of a Snakefile's head."""
    return told(snakefile.read_text(), r"#   (snakemake --cores N(?: \w+)?)  +(.+)")


def told(text, pattern):
    lines = [("command", "what"), ("---",) * 2]
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        if found := re.fullmatch(pattern, line):
            command, what = found.groups()
            lines.append((f"`{command}`", what.translate(UNSAFE)))
    return rows(lines)


def rows(lines):
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
