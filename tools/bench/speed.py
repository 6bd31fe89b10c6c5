"""Training and rendering rays/s, ours beside the peer's, of the same architecture.

The peer's batches are drawn and cast to rays beforehand (it has a thread for that);
ours are drawn within the step. A step of the peer's computes the statistics that it
always does, and its rendering percentiles of depth; ours gives a depth too.
"""

import jax

from alignerf.training import renderer
from tools.bench import cases, measure, multinerf, ours, theirs

# Name, model, rays of a step, sides of a rendered view, goal of the training's ratio.
CASES = [
    ("small", cases.SMALL, 1024, (64, 64), 3.0),
    ("published", cases.PUBLISHED, 128, (32, 16), 2.0),
]
ON_GPU = [("published", cases.PUBLISHED, 16384, (256, 256), 1.5)]
# The peer computes in float32; its column is the same beside both of ours.
PRECISIONS = ("float32", "bfloat16")
QUICK = [("tiny", cases.TINY, 16, (8, 8), None)]


def run(options):
    """Rows: training and rendering in float32, then ours in bfloat16."""
    if options.quick:
        chosen = QUICK
    else:
        chosen = ON_GPU if jax.default_backend() == "gpu" else CASES
    modules = multinerf.load(options.peer) if options.peer else None
    return [row for case in chosen for row in _rows(case, modules, options)]


def _rows(case, modules, options):
    """The rows of a case: each precision of ours beside the same peer."""
    name, model, batch, (width, height), goal = case
    photos = cases.orbit(width=width, height=height)
    precisions = PRECISIONS[:1] if options.quick else PRECISIONS
    arms = {
        key: Ours(cases.with_precision(model, key), photos, batch) for key in precisions
    }
    first = arms["float32"]
    note = f"{first.parameters:,} parameters, batch {batch}"
    if modules:
        peer = Peer(modules, name, model, photos, batch)
        # In the middle: a neighbour of both of ours.
        arms = {"float32": first, "peer": peer} | arms
        if peer.parameters != first.parameters:
            raise ValueError(f"{name}: the peer has {peer.parameters}, ours {note}")
        note += f", peer {peer.choice}"
    train, render = (
        measure.interleave(
            {key: getattr(arm, what) for key, arm in arms.items()}, options.repeats
        )
        for what in ("train", "render")
    )
    work = batch * training_flops(first.train.params, model["samples"])
    rows = []
    for key in precisions:
        size = f"{name}, {key}"
        # On a CPU the goal is that of float32.
        held = goal and (key == "float32" or jax.default_backend() == "gpu")
        least = measure.Goal("ratio", ">=", goal) if held else None
        rows += [
            measure.rates(
                f"train {size}", beside(train, key), batch, goal=least, note=note
            ),
            _share(size, train[key], work, key, options),
            measure.rates(f"render {size}", beside(render, key), width * height),
        ]
    return rows


def beside(times, key):
    """The times of an arm as ours, beside the peer's."""
    return {"ours": times[key], "peer": times.get("peer")}


def _share(size, times, work, precision, options):
    """The training's share of the FLOP/s that one large matrix product reaches."""
    peak = measure.matmul_peak(256 if options.quick else 4096, precision)
    return measure.Row(
        what=f"train {size}, share of matrix peak",
        unit="1",
        ours=measure.spread(work / s / peak for s in times),
        note=f"peak measured here: {peak:.3g} FLOP/s",
    )


class Ours:
    """Our training and rendering as calls without arguments."""

    def __init__(self, model, photos, batch):
        self.train = ours.Training(cases.make_job(model, batch_rays=batch), photos)
        self.parameters = self.train.parameters
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
        self.parameters = self.train.parameters
        variables, rays = self.train.variables(), self.train.view(0)
        self.render = lambda: self.train.peer.render(variables, rays)


def training_flops(params, samples):
    """FLOPs of the matrix products of one ray's training step.

    Two a kernel entry and sample forward, two for the kernel's gradient, two for the
    input's, where the input is not the encoding, which has no gradient.
    """
    proposal, field = (params["model"][key] for key in cases.FIELDS)
    early, last = sum(samples[:-1]), samples[-1]
    return early * _network_flops(proposal) + last * _network_flops(field)


def _network_flops(network):
    width, encoded = network["Dense_0"]["kernel"].shape
    total = 0
    for path, kernel in jax.tree_util.tree_leaves_with_path(network):
        if path[-1].key != "kernel":
            continue
        columns, rows = kernel.shape
        first, after_skip = rows == encoded, rows == encoded + width
        constant = encoded if first or after_skip else 0
        total += columns * (6 * rows - 2 * constant)
    return total
