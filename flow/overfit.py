"""What an estimator invents where nothing is displaced: `python -m flow.overfit`.

Of some views a copy of the render is made that is as sharp and as different as the
photo, and displaced nowhere (`flow.warping.controls.resharpened`). The flow to it is
the estimator's own. `flow.control_sets` does the same of all test views, and more.

    python -m flow.overfit --renders DIR --photos DIR --flow DIR --out CSV
"""

import argparse
import sys
import time
from pathlib import Path

from alignerf.files import atomic, faults, images, machine
from flow.estimation import arguments as arguments_of_flow
from flow.estimation import pairs
from flow.warping import controls, files, lengths

# Views, from the first by name to the last.
MOST_VIEWS = 8


def main(renders, photos, flow, out, *, masks=None, threads=1, **options):
    """Write the CSV, a row a view; returns the rows.

    renders, photos: folders of <view>.png; flow: of <view>.npz between them; masks: as
    of `files.masked_photo`; options: of `pairs.flow_and_validity`. Raises ValueError or
    OSError.
    """
    found = pairs.find_pairs(Path(renders), Path(photos))
    count = min(MOST_VIEWS, len(found))
    chosen = [found[i * (len(found) - 1) // max(count - 1, 1)] for i in range(count)]

    def row_of(one):
        view, *paths = one
        started = time.perf_counter()
        render, photo = map(images.read, paths)
        photo, _ = files.masked_photo(view, render, photo, masks)
        flow_px, _ = files.read_flow(Path(flow) / f"{view}.npz")
        try:
            aligned = controls.resharpened(render, photo, flow_px)
            told = pairs.flow_and_validity(render, aligned, **options)
        except ValueError as error:
            raise ValueError(f"view {view}: {error}") from error
        invented_px, valid, sigma_px = told
        return {
            "view": view,
            "aligned": "resharpened",
            **lengths.statistics(invented_px, valid, view=view),
            "blur_sigma_px": sigma_px,
            "time_s": round(time.perf_counter() - started, 4),
        }

    rows = list(machine.map_in_threads(row_of, chosen, threads=threads))
    with atomic.replace_file(out) as path:
        files.write_rows(path, controls.COLUMNS, rows)
    return rows


def parse(arguments=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog="flow.overfit",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for name in ("renders", "photos", "flow", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--masks", type=Path, help="where photos count, if it is there")
    parser.add_argument("--threads", type=int, default=1, help="views at once")
    arguments_of_flow.add(parser)
    options = vars(parser.parse_args(arguments))
    del options["kernel"]
    return options


def run(arguments=None):
    """The command line; returns its exit code."""
    return faults.exit_code(main, **parse(arguments))


if __name__ == "__main__":
    sys.exit(run())
