"""The graph of the rules, as Mermaid: `python -m tools.docs.rulegraph`.

It is what `snakemake --rulegraph mermaid-js` prints, without colors, and without the
arrows from a rule to another that a longer way leads to as well.
"""

import re
import subprocess
import sys

COMMAND = ("snakemake", "--rulegraph", "mermaid-js")
# Rounds are a loop, which begins with it.
FIRST = "train"


def main():
    command = [sys.executable, "-m", *COMMAND]
    print(reduced(subprocess.run(command, stdout=-1, text=True, check=True).stdout))


def reduced(text):
    """A rule graph of Snakemake's with as few arrows as lead from rule to rule."""
    names = dict(re.findall(r"(id\d+)\[(\w+)\]", text))
    found = re.findall(r"(id\d+) --> (id\d+)", text)
    arrows = {(names[one], names[to]) for one, to in found if one != to}
    back = {(one, to) for one, to in arrows if to == FIRST and leads(arrows, to, one)}
    ahead = arrows - back
    needed = {arrow for arrow in ahead if not leads(ahead - {arrow}, *arrow)}
    lines = [f"  {one} --> {to}" for one, to in sorted(needed)]
    lines += [f"  {one} -. next round .-> {to}" for one, to in sorted(back)]
    return "\n".join(["flowchart LR", *lines])


def leads(arrows, start, end):
    """Whether arrows lead from a rule to another."""
    seen, now = set(), {start}
    while now:
        seen |= now
        now = {to for one, to in arrows if one in now} - seen
    return end in seen


if __name__ == "__main__":
    main()
