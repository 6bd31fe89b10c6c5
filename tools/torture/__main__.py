"""`make torture`: the attack on the program, and its report.

Parts: inputs (a finished chain's files, folders of photos, configs and jobs), folders
(grown from the seed), names, arguments, numbers, kills, machines (disks, signals,
memory), surfaces (splats, the Python API, YAML, plug-ins, what is removed). Writes
report.csv, with counts by outcome, and findings.txt; exits with 1 where anything was
found. It ends within 20 minutes on two cores: each part tries its cases in an order by
the seed until its share of the minutes is used.
"""

import argparse
import os
import re
import sys
import time
import traceback
from pathlib import Path

import pandas as pd

from alignerf.io import atomic, owned, provenance
from tools.torture import chains, clock, parts

# What a finding is, by its words; the first that fits, worst first.
OUTCOMES = {
    "destroyed": r"\bchanged\b|is gone|removed",
    "silently_wrong": r"accepted|taken|\bleft\b|\bput\b|differs|in the page",
    "heavy": r"\d s\b|MiB",
    "traceback": "",
}
REPORT = ("report.csv", "report.provenance.json", "findings.txt")


def main(argv=None):
    args = parse(argv)
    os.environ["PYTHONPATH"] = str(parts.ROOT)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    owned.check(args.out)
    owned.put(args.out, REPORT)
    atomic.sweep(args.out)
    chains.take_interrupts()
    chosen = args.only or list(parts.PARTS)
    shares = {name: parts.SHARES[name] for name in chosen}
    limit = clock.Clock(args.minutes, shares)
    needed = {*chosen} - parts.ALONE
    reference = reference_of(args.out / "reference") if needed else None
    with atomic.scratch_folder(args.out) as args.work:
        return attack(reference, args, limit, shares)


def attack(reference, args, limit, shares):
    """Try all parts, and report; 1 where anything was found."""
    print(f"seed {args.seed}", flush=True)
    rows, said = [], []
    for name in shares:
        limit.begin(name)
        started = time.monotonic()
        for row in rows_of(name, reference, args, limit):
            took = round((time.monotonic() - started) / 60, 1)
            rows.append([name, row.what, row.cases, row.of, *counted(row.found), took])
            said += [f"{name}, {row.what}: {line}" for line in row.found or ()]
            tried = f"{row.cases:,} of {row.of:,} cases"
            print(f"{name}, {row.what}: {tried}, {rows[-1][4]} findings", flush=True)
            # What ends the torture leaves the report of what was tried.
            write(rows, said, args.out)
    print(f"{len(said)} findings: {args.out / 'findings.txt'}")
    return int(bool(said))


def counted(found):
    """How many findings, and of each of OUTCOMES; '' where nothing was tried."""
    if found is None:
        return [""] * (1 + len(OUTCOMES))
    of_kind = [
        next(kind for kind, words in OUTCOMES.items() if re.search(words, line))
        for line in found
    ]
    return [len(found), *map(of_kind.count, OUTCOMES)]


def rows_of(name, reference, args, limit):
    """The rows of a part; a fault of the part itself is one, and others go on."""
    try:
        yield from parts.PARTS[name](reference, args, limit)
    except Exception:
        print(traceback.format_exc(), file=sys.stderr)
        last = " / ".join(traceback.format_exc().splitlines()[-3:])
        yield parts.Row("the part itself", 1, 1, [f"it failed: {last}"])


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="tools.torture", description=__doc__)
    parser.add_argument("--only", nargs="*", choices=parts.PARTS, help="these parts")
    parser.add_argument(
        "--minutes", type=float, default=20, help="of the whole; 0: try everything"
    )
    today = int(time.strftime("%Y%m%d"))
    parser.add_argument(
        "--seed", type=int, default=today, help="(default: the date, another each day)"
    )
    parser.add_argument("--cases", type=int, default=300, help="folders a source")
    out = parts.ROOT / "results" / "torture"
    parser.add_argument("--out", type=Path, default=out)
    parser.add_argument(
        "--ways", type=int, default=4, help="tried on each input of each stage"
    )
    parser.add_argument(
        "--arguments", type=int, default=100, help="spoilt ones of each command"
    )
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--training-kills", type=int, default=16, help="of each kind")
    parser.add_argument("--names", type=int, default=2000, help="of folders and views")
    args = parser.parse_args(argv)
    args.work = args.out = args.out.absolute()
    return args


def reference_of(folder):
    """A finished chain: made once, and kept while the sources are the same.

    Tables name the commit that their trainings are of.
    """
    made = folder / "results" / chains.SCENE / "index.html"
    told = folder / "commit.txt"
    now = f"{provenance.commit()}"
    if made.exists() and told.exists() and told.read_text() == now:
        return chains.Chain(parts.ROOT, folder)
    chain = chains.make(parts.ROOT, folder)
    chains.finish(chain)
    told.write_text(now)
    owned.put(folder.parent, (f"reference/{one}" for one in owned.files_of(folder)))
    return chain


def write(rows, said, out):
    """The table, and all findings in words."""
    columns = ["part", "what", "cases", "of", "findings", *OUTCOMES, "minutes"]
    pd.DataFrame(rows, columns=columns).to_csv(out / "report.csv", index=False)
    text = "".join(f"{line}\n" for line in said)
    (out / "findings.txt").write_text(text, errors="backslashreplace")
    path = provenance.path_beside(out / "report.csv")
    path.write_text(provenance.as_json(provenance.facts()))


if __name__ == "__main__":
    sys.exit(main())
