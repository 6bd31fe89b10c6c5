"""Warp the photos of a folder onto the renders of another.

For each render: flow to the photo of the same name and back, where both agree, the
photo warped onto the render (if it is asked for), and the misalignment in pixels.

    python -m flow.align --renders DIR --photos DIR --flow-out DIR --stats-out CSV
        [--warped-out DIR] [--splits train test]

With splits, `{split}` in a path stands for each in turn.
"""

import argparse
import sys
from functools import partial
from pathlib import Path

from alignerf.files import faults, split_paths
from flow.estimation import arguments as arguments_of_flow
from flow.estimation import estimate, external, folders


def main(*, splits, flow_out, stats_out, warped_out=None, **options):
    """`folders.align`; of each split in turn, where there are some.

    options: its other arguments. Raises ValueError or OSError.
    """
    split_paths.check(splits, (flow_out, warped_out, stats_out))
    targets = {"flow": flow_out} | ({"warped": warped_out} if warped_out else {})
    for split in splits or [split_paths.MARK]:

        def of_split(value, split=split):
            return split_paths.fill(value, split) if isinstance(value, Path) else value

        folders.align(
            **{name: of_split(value) for name, value in options.items()},
            targets={kind: of_split(folder) for kind, folder in targets.items()},
            stats_out=of_split(stats_out),
            before_end=partial(split_paths.note, stats_out, of_split(stats_out)),
        )


def parse(arguments=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="flow.align", description=__doc__)
    for name in ("renders", "photos", "flow-out", "stats-out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--warped-out", type=Path, help="folder of warped photos")
    arguments_of_flow.add(parser, (*estimate.METHODS, external.METHOD))
    parser.add_argument("--flows", type=Path, help="folder of flows made elsewhere")
    parser.add_argument("--depth", type=Path, help="of the renders, for occlusions")
    parser.add_argument("--masks", type=Path, help="where photos count, if it is there")
    parser.add_argument("--threads", type=int, default=1, help="views at once")
    splits = {"nargs": "+", "choices": ("train", "test"), "default": ()}
    parser.add_argument("--splits", **splits, help="what {split} stands for")
    options = parser.parse_args(arguments)
    if (options.flows is None) == (options.method == external.METHOD):
        parser.error(
            f"--flows goes with --method {external.METHOD}, and it with --flows"
        )
    return options


def run(arguments=None):
    """The command line; returns its exit code."""
    return faults.exit_code(main, **vars(parse(arguments)))


if __name__ == "__main__":
    sys.exit(run())
