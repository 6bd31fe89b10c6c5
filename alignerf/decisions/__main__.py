"""Decide settings by a scene's facts: `python -m alignerf.decisions`.

Writes decisions.json: each key with its default, its value, the reason and the facts
behind it; prints a line for each. A config with `decide: true` takes the decisions for
all keys that it leaves out. `--show` prints decisions.json files.
"""

import argparse
import json
from pathlib import Path

from alignerf.decisions import fill, rules
from alignerf.files import atomic, faults, json_files


def main(argv=None):
    parser = argparse.ArgumentParser(prog="alignerf.decisions", description=__doc__)
    parser.add_argument("--facts", help="facts.json of the scene")
    parser.add_argument("--out", help="decisions.json, written")
    parser.add_argument("--show", nargs="+", type=Path, help="decisions.json, printed")
    parser.add_argument("--unasked", action="store_true", help="say: not applied")
    args = parser.parse_args(argv)
    if not args.show and None in (args.facts, args.out):
        parser.error("--facts and --out, or --show")
    if args.show:
        print("\n".join(shown(args.show, not args.unasked)))
        return
    decisions = rules.decide(read_facts(args.facts))
    content = {"decisions": [decision._asdict() for decision in decisions]}
    with atomic.replace_file(args.out) as path:
        path.write_text(json.dumps(content, indent=1) + "\n")
    print("\n".join(map(rules.line, decisions)))


def shown(paths, asked):
    """Lines of files that are there already, each below its scene's name.

    asked: whether the config leaves anything to facts.
    """
    lines = []
    for path in paths:
        lines.append(f"{path.parent.name}: by its facts")
        lines += [f"  {rules.line(decision)}" for decision in fill.read(path).values()]
    if not asked:
        lines.append("This run uses none of it: its config does not say decide: true.")
    return lines


def read_facts(path):
    """The facts of a facts.json; ValueError names a file that is none."""
    facts = json_files.read(path, rules.FACTS)
    counts = rules.COUNTS
    if facts.get("downscale_decided"):
        counts = (*counts, *rules.OF_DOWNSCALE, "downscale")
    for name in counts:
        if not rules.known(facts.get(name)):
            raise ValueError(f"{path}: {name} is {facts.get(name)!r:.60}")
    return facts


if __name__ == "__main__":
    faults.run(main)
