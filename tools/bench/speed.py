"""Training and rendering rays/s, ours beside multinerf's, of the same architecture.

`make bench`, with PEER=... beside google-research/multinerf, prints rows and adds them
to results/bench/speed.csv: of each rate the median, the least and the largest.
The peer's batches are drawn and cast to rays beforehand (it has a thread for that);
ours are drawn within the step. A step of the peer's computes the statistics that it
always does, and its rendering percentiles of depth; ours gives a depth too.
"""

import argparse
import sys
from pathlib import Path
from typing import Any, NamedTuple

from alignerf.io import faults, owned, provenance
from alignerf.training import renderer
from tools.bench import cases, measure, multinerf, ours, theirs

FILE = "speed.csv"


class Case(NamedTuple):
    """A job and photos; model: the peer's, in the words of `cases`, if it has one."""

    name: str
    job: Any
    photos: cases.Photos
    model: dict | None

    @classmethod
    def of(cls, name, model, batch_rays, size):
        """Of a model of `cases`, on views of a size."""
        job = cases.make_job(model, batch_rays=batch_rays)
        return cls(name, job, cases.orbit(width=size[0], height=size[1]), model)


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
    owned.put(args.out, [FILE])
    modules = multinerf.load(args.peer) if args.peer else None
    every = [
        Case.of("small MLP", cases.SMALL, 1024, (64, 64)),
        Case.of("published size", cases.PUBLISHED, 128, (32, 16)),
    ]
    if args.quick:
        every = [Case.of("tiny", cases.TINY, 16, (8, 8))]
    for case in every:
        for row in rows(case, modules, repeats=args.repeats):
            print(row)
            measure.append(args.out / FILE, measure.RATES, row)


def rows(case: Case, modules=None, *, repeats, least_s=0.0):
    """Rows of a case: training and rendering; modules: the peer's.

    Without repeats all is compiled, and there are none.
    """
    height, width = case.photos.images.shape[1:3]
    arms = {"ours": Ours(case)}
    count = arms["ours"].train.parameters
    batch_rays = case.job.rays_per_step
    note = f"{count:,} parameters, batch {batch_rays}, views {width}x{height}"
    if modules and case.model:
        peer = arms["multinerf"] = Peer(modules, case)
        note += f", multinerf {peer.choice}"
        if peer.train.parameters != count:
            raise ValueError(
                f"{case.name}: the peer has {peer.train.parameters}, {note}"
            )
    for what, work in (("train", batch_rays), ("render", width * height)):
        calls = {name: getattr(arm, what) for name, arm in arms.items()}
        times = measure.interleave(calls, repeats, least_s=least_s)
        if repeats:
            yield measure.rates(f"{what}ing, {case.name}", times, work, note=note)


class Ours:
    """Our training and rendering as calls without arguments."""

    def __init__(self, case):
        self.train = ours.Training(case.job, case.photos)
        self.render = self.train.view(case.photos, 0)


class Peer:
    """The peer's; of its two ways of resampling, the faster one here."""

    def __init__(self, modules, case):
        trainings = {}
        for gather in (False, True):
            made = theirs.make(
                modules,
                name=f"{case.name}_{gather}".replace(" ", "_"),
                **case.model,
                batch_rays=case.job.rays_per_step,
                steps=250_000,
                gather=gather,
                chunk_rays=renderer.CHUNK_RAYS,
            )
            trainings[gather] = theirs.Training(made, case.photos)
        times = measure.interleave(trainings, 3)
        best = min(trainings, key=lambda gather: min(times[gather]))
        self.choice = f"use_gpu_resampling={best}"
        self.train = trainings[best]
        variables, rays = self.train.variables(), self.train.view(0)
        self.render = lambda: self.train.peer.render(variables, rays)


if __name__ == "__main__":
    sys.exit(faults.run(main))
