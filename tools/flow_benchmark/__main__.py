"""How right and how fast the flow estimators are, where the flow is known.

    python -m tools.flow_benchmark [--csv CSV] [--middlebury DIR]
        [--scene DIR --renders METHOD/round0 ... [--split test]]
        [--methods NAME ...]

Data: Middlebury's sequences, scikit-image's stereo pair, photographs warped by smooth
random flows and blurred on the render's side, and renders of trained models of a
scene whose truth is known. What is not there is left out, which the log says.
Middlebury's are those of --middlebury, else of $ALIGNERF_DATA/flow: a folder of
<sequence>/{frame10.png, frame11.png, flow10.flo}.
"""

import argparse
import itertools
import logging
import os
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from alignerf.io import atomic, faults, progress, provenance
from flow.estimation import estimate
from tools.flow_benchmark import pairs as benchmark_pairs

log = logging.getLogger("alignerf")

# Names a folder of real data, which the sequences are in as `flow`.
DATA = "ALIGNERF_DATA"
WITHIN_PX = {"within_025": 0.25, "within_050": 0.5, "within_100": 1.0}
SCORES = ("epe_px", *WITHIN_PX)
COLUMNS = ("data", "method", "match_blur", "pairs", *SCORES, "mpx_per_s", "note")


def main(
    csv,
    *,
    methods,
    middlebury=None,
    scene=None,
    renders=(),
    split="test",
    configs=(),
):
    """Score methods with and without blur matching; returns the table.

    csv: path, written, with its provenance beside it. methods: names.
    middlebury, scene: folders, or None; renders: the scene's, see
    `benchmark_pairs.scene`. configs: the scene's, for the table's provenance. Raises
    ValueError or OSError.
    """
    sources = find_sources(middlebury, scene, renders, split)
    pairs = list(itertools.chain.from_iterable(sources))
    cv2.setNumThreads(1)
    jobs = list(itertools.product(methods, (False, True)))
    rows = []
    for method, match_blur in progress.over(jobs, "flow benchmark", unit="job"):
        rows += score_method(pairs, method, match_blur)
    table = pd.DataFrame(rows, columns=COLUMNS)
    order = {data: i for i, data in enumerate(dict.fromkeys(p.data for p in pairs))}
    table = table.sort_values("data", key=lambda c: c.map(order), kind="stable")
    write(table, csv, configs)
    return table


def write(table, csv, configs):
    """Write the CSV and its provenance, or neither."""
    origin = provenance.describe([], configs, devices=[provenance.processor()])
    beside = provenance.path_beside(csv)
    with atomic.replace_file(csv) as path, atomic.replace_file(beside) as told:
        table.to_csv(path, index=False, float_format="%.6g")
        told.write_text(provenance.as_json(origin))


def find_sources(middlebury, scene, renders, split):
    """Iterables of pairs; says what is left out, and why."""
    if (folder := middlebury or middlebury_of_data()) is not None:
        yield benchmark_pairs.middlebury(folder)
    try:
        yield list(benchmark_pairs.stereo())
    except (OSError, ImportError) as error:
        log.info("left out: the stereo pair, %s", error)
    yield benchmark_pairs.synthetic()
    if scene is not None:
        yield benchmark_pairs.scene(scene, renders, split)
    else:
        log.info("left out: renders of a scene, no --scene")


def middlebury_of_data():
    """Middlebury's folder in that of the data; None, and a line, where none is."""
    data = os.environ.get(DATA)
    if data and (folder := Path(data) / "flow").is_dir():
        return folder
    why = f"{data} holds no folder flow" if data else f"{DATA} is not set"
    log.warning(
        "left out: Middlebury's sequences, %s (give --middlebury DIR, or %s: a folder "
        "that holds flow/<sequence>)",
        *(why, DATA),
    )
    return None


def score_method(pairs, method, match_blur):
    """Rows of a method, one per kind of data."""
    rows = []
    for data, group in itertools.groupby(
        sorted(pairs, key=lambda pair: pair.data), key=lambda pair: pair.data
    ):
        group = list(group)
        row = {"data": data, "method": method, "match_blur": match_blur}
        rows.append(row | {"pairs": len(group)} | means(group, method, match_blur))
    return rows


def means(pairs, method, match_blur):
    """Scores, each the mean over pairs, and speed: all their pixels by all seconds.

    Seconds of one core, so that others' work on the machine does not count.

    A pair that the method refuses leaves the scores empty rather than better, and
    the note says which.
    """
    scores, time_s = [], 0.0
    for pair in pairs:
        started = time.process_time()
        try:
            found_px = estimate.estimate(
                pair.render, pair.photo, method=method, match_blur=match_blur
            )
        except ValueError as error:
            return {"note": f"{pair.name}: {error}"}
        time_s += time.process_time() - started
        scores.append(score(found_px, pair.true_px, pair.known))
    mean = dict(zip(SCORES, np.mean(scores, axis=0), strict=True))
    pixels = sum(pair.known.size for pair in pairs)
    return mean | {"mpx_per_s": pixels / 1e6 / time_s, "note": ""}


def score(found_px, true_px, known):
    """Mean end-point error in px over known pixels, and the shares within WITHIN_PX."""
    if not known.any():
        raise ValueError("no pixel has a known flow")
    miss_px = np.linalg.norm(found_px[known] - true_px[known], axis=-1)
    return [miss_px.mean(), *((miss_px <= px).mean() for px in WITHIN_PX.values())]


def parse(arguments=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="tools.flow_benchmark", description=__doc__)
    csv = Path("results/flow_benchmark.csv")
    parser.add_argument("--csv", type=Path, default=csv, help="written")
    parser.add_argument("--middlebury", type=Path, help=f"else ${DATA}/flow")
    parser.add_argument("--scene", type=Path, help="with truth/ and renders")
    parser.add_argument(
        "--renders", nargs="+", default=[], help="METHOD/round<k> of the scene"
    )
    parser.add_argument(
        "--configs", nargs="*", default=[], help="YAML: the scene's complete config"
    )
    parser.add_argument("--split", choices=("train", "test"), default="test")
    names = list(estimate.METHODS)
    parser.add_argument("--methods", nargs="+", choices=names, default=names)
    options = parser.parse_args(arguments)
    if (options.scene is None) == bool(options.renders):
        parser.error("--scene and --renders go together")
    return options


def run(arguments=None):
    """The command line; returns its exit code."""
    return faults.exit_code(main, **vars(parse(arguments)))


if __name__ == "__main__":
    sys.exit(run())
