"""Time and memory of one large pair, in a process of its own.

    python -m tools.flow_benchmark.large_pair --method NAME --width 2560 --height 1680

Prints JSON: `time_s` of a blur-matched flow, `cpu_time_s`, the seconds of all cores for
it, and `peak_mib`, the most memory that the process held, Python and OpenCV included.
"""

import argparse
import json
import sys
import time

import cv2
import numpy as np

from alignerf.io import faults, machine
from flow.estimation import estimate


def main(method, width, height):
    """{"time_s", "cpu_time_s", "peak_mib"} of a texture against itself, moved."""
    noise = np.random.default_rng(0).integers(0, 256, (height, width + 2, 3), np.uint8)
    scene = cv2.GaussianBlur(noise, (0, 0), 2.0)
    del noise
    render = cv2.GaussianBlur(scene[:, 2:], (0, 0), 1.0)
    started, started_cpu = time.perf_counter(), time.process_time()
    estimate.estimate(render, scene[:, :-2], method=method, match_blur=True)
    times = {
        "time_s": round(time.perf_counter() - started, 2),
        "cpu_time_s": round(time.process_time() - started_cpu, 2),
    }
    return times | {"peak_mib": round(machine.peak_bytes() / 2**20)}


def run(arguments=None):
    """The command line; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="tools.flow_benchmark.large_pair", description=__doc__
    )
    parser.add_argument("--method", default=estimate.DEFAULT, choices=estimate.METHODS)
    parser.add_argument("--width", type=int, default=2560)
    parser.add_argument("--height", type=int, default=1680)
    options = vars(parser.parse_args(arguments))
    return faults.exit_code(lambda: print(json.dumps(main(**options))))


if __name__ == "__main__":
    sys.exit(run())
