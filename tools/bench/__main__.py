"""Speed and memory: `make bench`, with PEER=... beside google-research/multinerf.

Prints a table for each and writes results/bench/<name>.json; of what is repeated the
median, the least and the largest.
"""

import argparse
import importlib
import json
import os
import sys
from pathlib import Path

import jax
import pandas as pd

from alignerf.io import atomic, faults, owned, provenance

NAMES = ("speed", "memory")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peer", help="checkout of google-research/multinerf")
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--repeats", type=int, default=7, help="odd: a median of")
    parser.add_argument("--quick", action="store_true", help="tiny sizes: does it run")
    out = provenance.ROOT / "results" / "bench"
    parser.add_argument("--out", type=Path, default=out)
    args = parser.parse_args(argv)
    if args.repeats < 1:
        raise ValueError(f"--repeats: {args.repeats} is less than 1")
    owned.claim(args.out)
    hardware = provenance.facts() | {
        "cpu": provenance.processor(),
        "cores": len(os.sched_getaffinity(0)),
        "device": jax.devices()[0].device_kind,
        "jax": jax.__version__,
    }
    for name in args.only:
        rows = list(importlib.import_module(f"tools.bench.{name}").run(args))
        print(pd.DataFrame(rows).to_string(index=False, float_format="%.4g"))
        owned.put(args.out, [f"{name}.json"])
        with atomic.replace_file(args.out / f"{name}.json") as path:
            path.write_text(json.dumps({"hardware": hardware, "rows": rows}, indent=1))


if __name__ == "__main__":
    sys.exit(faults.run(main))
