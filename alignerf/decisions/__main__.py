"""What a scene's facts call for: `python -m alignerf.decisions`.

Writes decisions.json: each key with its default, its value, the reason and the facts
behind it; prints a line for each. A config with `decide: true` takes them for all keys
that it does not say itself.
"""

import argparse
import json
from pathlib import Path

from alignerf.command import faults, whole
from alignerf.decisions import rules


def main(argv=None):
    parser = argparse.ArgumentParser(prog="alignerf.decisions", description=__doc__)
    parser.add_argument("--facts", required=True, help="facts.json of the scene")
    parser.add_argument("--out", required=True, help="decisions.json, written")
    args = parser.parse_args(argv)
    decisions = rules.decide(read_facts(args.facts))
    content = {"decisions": [decision._asdict() for decision in decisions]}
    with whole.replace_file(args.out) as path:
        path.write_text(json.dumps(content, indent=1) + "\n")
    print("\n".join(map(rules.line, decisions)))


def read_facts(path):
    """The facts of a facts.json; ValueError names a file that is none."""
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        if missing := sorted(rules.FACTS - found.keys()):
            raise ValueError(f"no {', '.join(missing)} in it")
    except (ValueError, AttributeError) as error:
        raise ValueError(f"{path}: not the facts of a scene: {error}") from None
    return found


if __name__ == "__main__":
    faults.run(main)
