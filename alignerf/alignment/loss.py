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
from alignerf.training import batches, compose, loop, memory, renderer

log = logging.getLogger("alignerf")

# The parameter that holds the costs; no gradient of a network flows through it.
COSTS = "costs"
# Beside the checkpoint: what the look found.
FILE = "look.json"
# Two halves of a tile's rays agree where their offsets are as near.
AGREE_PX = 1.0


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

    def values_and_terms(params, batch, share):
        costs = jax.lax.stop_gradient(params[COSTS])
        # Of the tiles, or of the rays: what is less work.
        if len(batch.tile) < count:
            offsets = offsets_of(costs[batch.tile], chosen)
        else:
            offsets = offsets_of(costs, chosen)[batch.tile]
        photo, weight = aligned_loss.aligned_photo(batch, offsets)
        own = without_costs(params)
        moved = batch._replace(photo=photo, weight=weight)
        values, terms, shown = method.values_and_terms(own, moved, share)
        mean = aligned_loss.gathering(params[COSTS], values, batch, tiles)
        offset_px = jnp.mean(aligned_loss.lengths_px(offsets))
        return values, {**terms, COSTS: mean}, {**shown, "offset_px": offset_px}

    rate = aligned_loss.rate_of(method.units, count, chosen.patch_rays)
    made = method._replace(init=init, running_means=((COSTS, rate),))
    if not learning:
        return made._replace(
            terms=lambda params, *others: method.terms(without_costs(params), *others)
        )
    return made._replace(
        draw=draw,
        values_and_terms=values_and_terms,
        terms=lambda *a: values_and_terms(*a)[1:],
    )


class Look(loop.NoAligner):
    """The one look of a training; `learning` from there on where photos lie off."""

    def __init__(self, job, loaded, folder):
        self.job, self.loaded = job, loaded
        self.path = pathlib.Path(folder) / FILE
        self.learning, self.report, self.compile_time_s = False, [], 0.0
        self.places, self.identity, self.steps, self.photos = set(), "", 0, None

    def begin(self, steps, identity):
        """Fix the step of the look; identity: the training's fingerprint."""
        self.identity, self.steps = identity, steps
        place = round(self.job.aligned_loss.start_fraction * steps)
        self.places = {min(max(place, 1), steps - 1)} if steps > 1 else set()

    def restore(self, step):
        """Take over what an earlier look found; one at this very step is repeated."""
        if not any(place < step for place in self.places):
            return True
        row = self.read()
        if row is None:
            return False
        self.report, self.learning = [row], row["searching"]
        return True

    def read(self):
        """The row of the report on this very training's look; None without one."""
        try:
            found = json_files.read(self.path, {"identity": str, "row": dict})
        except (OSError, ValueError):
            return None
        known = isinstance(found["row"].get("searching"), bool)
        return found["row"] if known and found["identity"] == self.identity else None

    def views(self, views):
        """The views as they are; the look is at these."""
        self.photos = views
        return views

    def more_bytes(self, shapes):
        """Bytes of the costs, and of the photos while they are looked at."""
        tiles, count = tiles_of(self.job, self.loaded)
        # With the gradient, and what is added up at the look.
        return 4 * 4 * count * tiles.side**2 + memory.tree_bytes(shapes)

    def align(self, params, step):
        """Search the photos once; the parameters with the costs, where they lie off."""
        begun, compiled_s = time.perf_counter(), self.compile_time_s
        min_px = self.job.aligned_loss.min_move_px
        costs, median_px, known = self.searched(params)
        self.learning = float(median_px) >= min_px
        took_s = time.perf_counter() - begun - (self.compile_time_s - compiled_s)
        row = {"step": step, "offset_px": round(float(median_px), 3)}
        row |= {"searching": self.learning, "time_s": round(took_s, 3)}
        self.report = [row]
        stays = f"below {min_px:g} px, so the training stays plain"
        log.info(
            "aligned loss: photos are %.2f px off the renders (median of %d tiles of "
            "%d): %s",
            *(median_px, known, len(costs)),
            "they are searched from here on" if self.learning else stays,
        )
        with atomic.replace_file(self.path) as path:
            found = {"identity": self.identity, "row": row}
            path.write_text(json_files.canonical(found))
        return {**params, COSTS: costs} if self.learning else None

    def searched(self, params):
        """(costs [tiles, s, s], median offset in px, of how many tiles).

        By `patch_rays` rays a tile, forward only, less where these were more than a
        tenth of the training's steps. Two halves of the rays are searched apart: a
        tile in which they disagree, as one without texture, does not count.
        """
        chosen, (tiles, count) = self.job.aligned_loss, tiles_of(self.job, self.loaded)
        method = self.learning_method()
        key = jax.random.fold_in(jax.random.key(self.job.seed), 1)
        # No more rays at once than a renderer takes, where they are cut evenly.
        most = renderer.CHUNK_RAYS
        parts = method.units // most if method.units % most == 0 else 1

        def look(totals, step, params, views):
            batch = method.draw(key, step, views)
            rays = jax.tree.map(lambda x: x.reshape(parts, -1, x.shape[-1]), batch.rays)
            rgb = jax.lax.map(lambda rays: method.render(params, rays).values, rays)
            found = aligned_loss.summed(rgb.reshape(-1, 3), batch, tiles, count)
            return jax.tree.map(lambda t, f: t.at[step % 2].add(f), totals, found)

        def ended(sums, rays):
            each = sums / jnp.maximum(rays, 1.0)[..., None, None]
            found = jax.vmap(lambda costs: offsets_of(costs, chosen))(each)
            apart_px = aligned_loss.lengths_px(found[0] - found[1])
            known = (apart_px <= AGREE_PX) & (jnp.min(rays, axis=0) > 0)
            costs = jnp.sum(sums, 0) / jnp.maximum(jnp.sum(rays, 0), 1.0)[:, None, None]
            found_px = aligned_loss.lengths_px(offsets_of(costs, chosen))
            median_px = jnp.nanmedian(jnp.where(known, found_px, jnp.nan))
            # Where no tile can tell, nothing is moved.
            median_px = jnp.where(jnp.any(known), median_px, 0.0)
            return costs, median_px, jnp.sum(known)

        totals = (
            jnp.zeros((2, count, tiles.side, tiles.side)),
            jnp.zeros((2, count)),
        )
        given = devices.on_first(params), jax.tree.map(jnp.asarray, self.photos)
        # Compiling is counted apart: a cache often saves it.
        begun = time.perf_counter()
        look = jax.jit(look, donate_argnums=0).lower(totals, 0, *given).compile()
        ended = jax.jit(ended).lower(*totals).compile()
        self.compile_time_s += time.perf_counter() - begun
        steps = -(-chosen.patch_rays * count // method.units)
        for step in range(max(2, min(steps, self.steps // 10))):
            totals = look(totals, step, *given)
        return ended(*totals)

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
