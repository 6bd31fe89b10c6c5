"""Training and rendering rays/s, ours beside the peer's, of the same architecture.

`make bench`, with PEER=... beside google-research/multinerf, prints a table and writes
results/bench/speed.json: of each rate the median, the least and the largest.
The peer's batches are drawn and cast to rays beforehand (it has a thread for that);
ours are drawn within the step. A step of the peer's computes the statistics that it
always does, and its rendering percentiles of depth; ours gives a depth too.
"""

import argparse
import json
import os
import sys
from pathlib import Path

import jax
import pandas as pd

from alignerf.io import atomic, faults, owned, provenance
from alignerf.training import renderer
from tools.bench import cases, measure, multinerf, ours, theirs

# Name, model, rays of a step, sides of a rendered view.
CASES = [
    ("small", cases.SMALL, 1024, (64, 64)),
    ("published", cases.PUBLISHED, 128, (32, 16)),
]
QUICK = [("tiny", cases.TINY, 16, (8, 8))]


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peer", help="checkout of google-research/multinerf")
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
    rows = list(run(args))
    print(pd.DataFrame(rows).to_string(index=False, float_format="%.4g"))
    owned.put(args.out, ["speed.json"])
    with atomic.replace_file(args.out / "speed.json") as path:
        path.write_text(json.dumps({"hardware": hardware, "rows": rows}, indent=1))


def run(options):
    """Rows: training and rendering of each case."""
    modules = multinerf.load(options.peer) if options.peer else None
    for name, model, batch, (width, height) in QUICK if options.quick else CASES:
        photos = cases.orbit(width=width, height=height)
        arms = {"ours": Ours(model, photos, batch)}
        count = arms["ours"].train.parameters
        note = f"{count:,} parameters, batch {batch}"
        if modules:
            peer = arms["peer"] = Peer(modules, name, model, photos, batch)
            note += f", peer {peer.choice}"
            if peer.train.parameters != count:
                raise ValueError(
                    f"{name}: the peer has {peer.train.parameters}, {note}"
                )
        for what, work in (("train", batch), ("render", width * height)):
            calls = {key: getattr(arm, what) for key, arm in arms.items()}
            times = measure.interleave(calls, options.repeats)
            yield measure.rates(f"{what} {name}", times, work, note=note)


class Ours:
    """Our training and rendering as calls without arguments."""

    def __init__(self, model, photos, batch):
        self.train = ours.Training(cases.make_job(model, batch_rays=batch), photos)
        self.render = self.train.view(photos, 0)


class Peer:
    """The peer's; of its two ways of resampling, the faster one here."""

    def __init__(self, modules, name, model, photos, batch):
        trainings = {}
        for gather in (False, True):
            made = theirs.make(
                modules,
                name=f"{name}_{gather}",
                **model,
                batch_rays=batch,
                steps=250_000,
                gather=gather,
                chunk_rays=renderer.CHUNK_RAYS,
            )
            trainings[gather] = theirs.Training(made, photos)
        times = measure.interleave(trainings, 3)
        best = min(trainings, key=lambda gather: min(times[gather]))
        self.choice = f"use_gpu_resampling={best}"
        self.train = trainings[best]
        variables, rays = self.train.variables(), self.train.view(0)
        self.render = lambda: self.train.peer.render(variables, rays)


if __name__ == "__main__":
    sys.exit(faults.run(main))
