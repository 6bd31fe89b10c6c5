"""Seconds of training until fox's held-out views reach a PSNR: grid, mlp, peer.

The clock runs in training steps alone: it stands while test views are rendered, and
while the peer's batches are drawn (it has a thread for that). PSNR is the mean over
the test views, each on every eighth pixel of every eighth row, of 8-bit colours.
"""

import dataclasses
import functools
import time

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.scenes import cameras
from tools.bench import cases, measure, multinerf, ours, theirs

TARGET_DB = 22.0
EVERY_PX = 4
# The next look at the test views comes when the clock shows this much more, and at
# least the seconds that the last look took: the peer's takes as long as 15 steps.
LOOK_AFTER = 1.15
DOWNSCALE = 8
BATCH = 512

# The default config's with more levels, and rates and a schedule that suit the target.
GRID = cases.GRID | {
    "field": {
        "kind": "grid",
        "levels": 12,
        "log2_hashmap_size": 17,
        "max_resolution": 512,
    }
}
GRID_TRAINING = {
    "steps": 400,
    "learning_rates": [0.04, 0.004],
    "warmup_steps": 50,
    "adam_eps": 1e-15,
    "gradient_norm": None,
}
# For the mlp and the peer alike, as published but for rates and a schedule that suit
# the target.
MLP_TRAINING = {"steps": 1000, "learning_rates": [0.005, 0.0005], "warmup_steps": 100}


def run(options):
    """Two rows each for grid and mlp, beside the peer's; none without the data."""
    if options.quick:
        train = test = cases.orbit(2, 32, 32)
        limit_s, batch, mlp = 0.1, 16, cases.TINY
    elif not (options.data / "scenes" / "fox").is_dir():
        note = f"skipped: no fox in {options.data}"
        return [measure.Row("time to quality", "s", None, note=note)]
    else:
        train, test = cases.fox(options.data, DOWNSCALE)
        limit_s, batch, mlp = options.limit_s, BATCH, cases.SMALL
    jobs = {
        "grid": cases.make_job(GRID, batch_rays=batch, **GRID_TRAINING),
        "mlp": cases.make_job(mlp, batch_rays=batch, **MLP_TRAINING),
    }
    if options.quick:
        del jobs["grid"]
    # The grid is soon there: several trainings of it, from other random numbers.
    seeds = {"grid": range(min(3, options.repeats)), "mlp": range(1)}
    found = {
        name: [
            climb(Ours(job.model_copy(update={"seed": seed}), train, test), limit_s)
            for seed in seeds[name]
        ]
        for name, job in jobs.items()
    }
    peer = None
    if options.peer:
        modules = multinerf.load(options.peer)
        peer = climb(Peer(modules, mlp, batch, MLP_TRAINING, train, test), limit_s)
    return [row for name in jobs for row in _rows(name, found[name], peer)]


def _rows(name, climbs, peer):
    note = f"{TARGET_DB:g} dB: " + ", ".join(climbed.told for climbed in climbs)
    if peer:
        note += f"; peer {peer.told}"
        if peer.reached_s is None:
            note += ", so that the ratio is a lower bound"
    goal = measure.Goal("ratio", ">=", 10.0) if name == "grid" else None
    for with_compilation in (False, True):
        seconds = [climbed.seconds(with_compilation) for climbed in climbs]
        arrived = None not in seconds
        peer_s = peer and peer.seconds(with_compilation)
        bound_s = peer_s or (peer and peer.limit_s)
        what = "with compilation" if with_compilation else "training alone"
        yield measure.Row(
            what=f"time to quality, {name}, {what}",
            unit="s",
            ours=measure.spread(seconds) if arrived else None,
            peer=peer_s and measure.one(peer_s),
            ratio=measure.spread(bound_s / s for s in seconds)
            if arrived and peer
            else None,
            goal=goal,
            note="" if with_compilation else note,
        )


@dataclasses.dataclass(frozen=True)
class Climb:
    """How a training came to the target, or did not within its limit."""

    reached_s: float | None
    compile_s: float
    limit_s: float
    told: str

    def seconds(self, with_compilation):
        """Until the target; None where it was not reached."""
        extra = self.compile_s if with_compilation else 0.0
        return self.reached_s and self.reached_s + extra


def climb(runner, limit_s) -> Climb:
    """Train until the test views reach the target or the clock its limit."""
    clock, look_at, steps = 0.0, 1.0, 0
    while True:
        step = runner.next_step()
        clock += measure.seconds(step)
        steps += 1
        if clock < min(look_at, limit_s):
            continue
        begun = time.perf_counter()
        psnr_db = runner.psnr_db()
        look_at = max(clock * LOOK_AFTER, clock + time.perf_counter() - begun)
        if psnr_db >= TARGET_DB or clock >= limit_s:
            break
    reached = psnr_db >= TARGET_DB
    told = f"{'' if reached else 'not reached: '}{psnr_db:.2f} dB after {clock:.3g} s"
    return Climb(
        reached_s=clock if reached else None,
        compile_s=runner.compile_s,
        limit_s=limit_s,
        told=f"{told}, {steps} steps of {runner.batch_rays} rays",
    )


def mean_psnr_db(colours, photos):
    """Mean over views of the PSNR of colours [views, n, 3], rounded to 8 bits."""
    rounded = np.round(np.clip(colours, 0.0, 1.0) * 255.0) / 255.0
    errors = np.mean((rounded - photos / 255.0) ** 2, axis=(1, 2))
    return float(np.mean(-10.0 * np.log10(errors)))


def some_pixels(photos):
    """(x [n], y [n], colours [views, n, 3]) of the pixels that are looked at."""
    height, width = photos.images.shape[1:3]
    y, x = np.mgrid[EVERY_PX // 2 : height : EVERY_PX, EVERY_PX // 2 : width : EVERY_PX]
    x, y = x.ravel(), y.ravel()
    return x, y, photos.images[:, y, x].astype(np.float64)


class Ours:
    """Our training of a job, its rays drawn within the step."""

    def __init__(self, job, train, test):
        self.batch_rays, self._test = job.training.batch_rays, test
        self._training = ours.Training(job, train)
        self.compile_s = self._training.compile_s
        self._render = jax.jit(self._training.method.render)

    def next_step(self):
        return self._training

    def psnr_db(self):
        x, y, photos = some_pixels(self._test)
        colours = []
        for camera in zip(self._test.pixtocams, self._test.camtoworlds, strict=True):
            pixtocam, camtoworld = (jnp.asarray(part, jnp.float32) for part in camera)
            rays = cameras.pixels_to_rays(x, y, pixtocam, camtoworld)
            colours.append(self._render(self._training.params, rays).values)
        return mean_psnr_db(np.stack(colours), photos)


class Peer:
    """The peer's training with the same model, rays and schedule as our mlp."""

    def __init__(self, modules, model, batch, schedule, train, test):
        self.batch_rays = batch
        first, last = schedule["learning_rates"]
        self._steps, self._done = schedule["steps"], 0
        self._peer = theirs.make(
            modules,
            name="quality",
            **model,
            batch_rays=batch,
            steps=self._steps,
            training={
                "lr_init": first,
                "lr_final": last,
                "lr_delay_steps": schedule["warmup_steps"],
            },
        )
        self._looked = theirs.make_dataset(self._peer, test, split="test")
        self._test = test
        # Its first step compiles; the training begins anew after two.
        self._training = theirs.Training(self._peer, train, batches=1)
        first_s, again_s = (measure.seconds(self._training) for _ in range(2))
        self.compile_s = max(first_s - again_s, 0.0)
        self._training.restart()

    def next_step(self):
        share = min(self._done / (self._steps - 1), 1.0)
        self._done += 1
        return functools.partial(self._training, self._training.batch(), share)

    def psnr_db(self):
        x, y, photos = some_pixels(self._test)
        variables = self._training.variables()
        colours = []
        for view in range(len(photos)):
            rays = self._looked.generate_ray_batch(view).rays
            rays = jax.tree.map(lambda z: z[y, x], rays)
            colours.append(self._peer.render(variables, rays))
        return mean_psnr_db(np.stack(colours), photos)
