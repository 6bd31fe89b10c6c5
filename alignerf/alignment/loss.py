"""The alignment-aware loss in a training in one go, where photos ask for it.

The training begins as the baseline does. At a share of its steps one look searches the
photos for what the model shows. Where they lie off, photos are searched from there on;
else the training stays the baseline's, bit for bit.
"""

import logging
import pathlib
import time

import jax
import jax.numpy as jnp

from alignerf.contributions import aligned_loss
from alignerf.contributions.aligned_loss import Tiles
from alignerf.io import atomic, json_files
from alignerf.methods import base
from alignerf.processes import devices
from alignerf.training import batches, compose, loop, memory

log = logging.getLogger("alignerf")

# The parameter that holds the costs; no gradient of a network flows through it.
COSTS = "costs"
# Beside the checkpoint: what the look found.
FILE = "look.json"
MANIFEST = {"identity": str, "report": list}


def tiles_of(job, loaded) -> tuple[Tiles, int]:
    """(the tiles of a photo, how many all training views have)."""
    chosen, size = job.aligned_loss, (loaded.height, loaded.width)
    views = len(loaded.views("train"))
    tiles = aligned_loss.tiles_of(size, views, chosen.patch_px, chosen.radius_px)
    return tiles, views * tiles.rows * tiles.columns


def offsets_of(costs, chosen):
    """Offsets [tiles, 2] in px by a job's settings."""
    return aligned_loss.offsets_px(costs, chosen.patch_rays, chosen.align_penalty)


def aligned(method, chosen, tiles: Tiles, count, *, learning):
    """The `methods.Method` of single rays with the loss; chosen: its settings.

    learning: whether photos are searched now.
    """

    def init(key):
        costs = jnp.zeros((count, tiles.side, tiles.side))
        return {**method.init(key), COSTS: costs}

    def draw(key, step, views):
        drawn = method.draw(key, step, views)
        return aligned_loss.with_photo_around(drawn, views, tiles, batches.is_valid)

    def without_costs(params):
        return {name: tree for name, tree in params.items() if name != COSTS}

    def looked(params, batch, share):
        costs = jax.lax.stop_gradient(params[COSTS])
        # Of the tiles, or of the rays: what is less work.
        if len(batch.tile) < count:
            offsets = offsets_of(costs[batch.tile], chosen)
        else:
            offsets = offsets_of(costs, chosen)[batch.tile]
        photo, weight = aligned_loss.aligned_photo(batch, offsets)
        own = without_costs(params)
        moved = batch._replace(photo=photo, weight=weight)
        values, terms, shown = method.looked(own, moved, share)
        gathered = aligned_loss.gathering(params[COSTS], values, batch, tiles)
        offset_px = jnp.median(aligned_loss.lengths_px(offsets))
        return values, {**terms, COSTS: gathered}, {**shown, "offset_px": offset_px}

    rate = aligned_loss.rate_of(method.units, count, chosen.patch_rays)
    made = method._replace(init=init, gathered=((COSTS, rate),))
    if not learning:
        return made._replace(
            terms=lambda params, *others: method.terms(without_costs(params), *others)
        )
    return made._replace(draw=draw, looked=looked, terms=lambda *a: looked(*a)[1:])


class Look(loop.NoAligner):
    """The one look of a training; `learning` from there on where photos lie off."""

    def __init__(self, job, loaded, folder):
        self.job, self.loaded = job, loaded
        self.path = pathlib.Path(folder) / FILE
        self.learning, self.report, self.compile_time_s = False, [], 0.0
        self.places, self.identity, self.photos = {}, "", None

    def begin(self, steps, identity):
        """Fix the step of the look; identity: the training's fingerprint."""
        self.identity = identity
        place = round(self.job.aligned_loss.start_fraction * steps)
        self.places = {min(max(place, 1), steps - 1): ["loss"]} if steps > 1 else {}

    def restore(self, step):
        """Take over what an earlier look found; one at this very step is repeated."""
        if not any(place < step for place in self.places):
            return True
        try:
            found = json_files.read(self.path, MANIFEST)
        except (OSError, ValueError):
            return False
        if found["identity"] != self.identity or not found["report"]:
            return False
        self.report = found["report"]
        self.learning = bool(self.report[-1].get("searching"))
        return True

    def views(self, views):
        """The views as they are; the look is at these."""
        self.photos = views
        return views

    def more_bytes(self, shapes):
        """Bytes of the costs, and of the photos while they are looked at."""
        tiles, count = tiles_of(self.job, self.loaded)
        # With the gradient, and what is added up at the look.
        return 3 * 4 * count * tiles.side**2 + memory.tree_bytes(shapes)

    def align(self, params, step):
        """Search the photos once; the parameters with the costs, where they lie off."""
        begun, compiled_s = time.perf_counter(), self.compile_time_s
        chosen = self.job.aligned_loss
        costs, median_px = self.searched(params)
        self.learning = median_px >= chosen.min_move_px
        took_s = time.perf_counter() - begun - (self.compile_time_s - compiled_s)
        row = {"step": step, "offset_px": round(median_px, 3)}
        row |= {"searching": self.learning, "time_s": round(took_s, 3)}
        self.report = [row]
        log.info(
            "aligned loss: photos are %.2f px off the renders (median of %d tiles): %s",
            *(median_px, len(costs)),
            "they are searched from here on"
            if self.learning
            else f"below {chosen.min_move_px:g} px, so the training stays plain",
        )
        with atomic.replace_file(self.path) as path:
            found = {"identity": self.identity, "report": self.report}
            path.write_text(json_files.canonical(found))
        return {**params, COSTS: costs} if self.learning else None

    def searched(self, params):
        """(costs [tiles, s, s], median offset in px), by `patch_rays` rays a tile.

        Forward only: a third of what as many rays take in training.
        """
        chosen, (tiles, count) = self.job.aligned_loss, tiles_of(self.job, self.loaded)
        method = self.learning_method()
        key = jax.random.fold_in(jax.random.key(self.job.seed), 1)

        def look(totals, step, params, views):
            batch = method.draw(key, step, views)
            rgb = method.render(params, batch.rays).values
            found = aligned_loss.summed(rgb, batch, tiles, count)
            return jax.tree.map(jnp.add, totals, found)

        def ended(sums, rays):
            costs = sums / jnp.maximum(rays, 1.0)[:, None, None]
            offsets = offsets_of(costs, chosen)
            return costs, jnp.median(aligned_loss.lengths_px(offsets))

        totals = jnp.zeros((count, tiles.side, tiles.side)), jnp.zeros(count)
        given = devices.on_first(params), jax.tree.map(jnp.asarray, self.photos)
        # Compiling is counted apart: a cache often saves it.
        begun = time.perf_counter()
        look = jax.jit(look).lower(totals, 0, *given).compile()
        ended = jax.jit(ended).lower(*totals).compile()
        self.compile_time_s += time.perf_counter() - begun
        for step in range(-(-chosen.patch_rays * count // method.units)):
            totals = look(totals, step, *given)
        costs, median_px = ended(*totals)
        return costs, float(median_px)

    def learning_method(self):
        """The method that searches."""
        return compose.make_method(self.job, self.loaded, learning=True)


class Part(base.Part):
    """What the loss adds to a training."""

    def wrapped(self, method, loaded, learning):
        tiles, count = tiles_of(self.job, loaded)
        chosen = self.job.aligned_loss
        return aligned(method, chosen, tiles, count, learning=learning)

    def aligner(self, loaded, photos, folder):
        return Look(self.job, loaded, folder)
