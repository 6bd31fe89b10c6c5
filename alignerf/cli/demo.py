"""Run the demo, the paper's analysis on a built-in scene: `make run`."""

import sys

from alignerf.cli import configs, workflow
from alignerf.experiment import targets
from alignerf.io import faults, provenance


def main(argv=None):
    args = configs.parser("demo", __doc__, "--cores").parse_args(argv)
    pages = ", ".join(map(targets.page_of, targets.demo_scenes()))
    show = provenance.typed("make show", "why-blurry show")
    print(f"page, when it is finished: {pages}; its tables: {show}", flush=True)
    if code := workflow.run(None, args.cores):
        sys.exit(code)


if __name__ == "__main__":
    faults.run(main)
