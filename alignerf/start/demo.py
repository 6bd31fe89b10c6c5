"""The demo, `make run`: the embedded scene, from nothing to its verdict and page."""

import argparse
import sys

from alignerf.experiment import targets
from alignerf.files import faults, machine, provenance
from alignerf.start import configs, workflow


def main(argv=None):
    args = parse(argv)
    pages = ", ".join(map(targets.page_of, targets.demo_scenes()))
    show = provenance.typed("make show", "why-blurry show")
    print(f"page, in the end: {pages}; its tables: {show}", flush=True)
    if code := workflow.run(None, args.cores):
        sys.exit(code)


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog=configs.program("demo"), description=__doc__)
    parser.add_argument("--cores", type=configs.count, default=machine.cores())
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
