"""Run the benchmarks: `python -m tools.bench`, or `make bench`.

Prints a table for each and writes results/bench/<name>.json and .csv.
"""

import argparse
import importlib
import os
import pathlib
import sys
import time

from alignerf.io import faults, owned
from tools.bench import cases, report

ROOT = pathlib.Path(__file__).resolve().parents[2]
USUAL = ("speed", "memory")
# They take hours, or gigabytes: only where they are asked for.
LONG = ("clusters", "pairs", "photos", "planning")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peer", help="checkout of google-research/multinerf")
    parser.add_argument("--only", nargs="+", choices=USUAL + LONG, default=USUAL)
    parser.add_argument("--repeats", type=int, default=7, help="odd: a median of")
    parser.add_argument("--quick", action="store_true", help="tiny sizes: does it run")
    parser.add_argument("--data", type=pathlib.Path, default=_data())
    parser.add_argument(
        "--results",
        type=pathlib.Path,
        default=ROOT / "results",
        help="of pairs: those of a run",
    )
    parser.add_argument("--method", default="plain", help="of pairs: of that run")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "results" / "bench")
    args = parser.parse_args(argv)
    if args.repeats < 1:
        raise ValueError(f"--repeats: {args.repeats} is less than 1")
    options = cases.Options(
        peer=args.peer,
        repeats=args.repeats,
        quick=args.quick,
        data=args.data,
        out=args.out,
        results=args.results,
        method=args.method,
    )
    owned.claim(args.out)
    header = report.hardware()
    print(" | ".join(f"{key} {value}" for key, value in header.items()), flush=True)
    for name in args.only:
        start = time.perf_counter()
        rows = importlib.import_module(f"tools.bench.{name}").run(options)
        took = {"took_s": round(time.perf_counter() - start, 1)}
        print(report.show(name, rows), took, flush=True)
        report.write(args.out, name, header | took, rows)


def _data():
    """Where the real scenes are: as in the tests, ALIGNERF_DATA says."""
    return pathlib.Path(os.environ.get("ALIGNERF_DATA", ROOT / "../shared/data"))


if __name__ == "__main__":
    sys.exit(faults.run(main))
