"""The alignments of one training, made in its loop.

The loop asks three things: before which steps it has to stop (`places`), what it learns
from after the alignments so far (`views`), and to align at a step (`align`, which may
give parameters that it changed). A resumed training takes what is on disk (`restore`)
and is bit for bit the same.
"""

import dataclasses
import time

import numpy as np

from alignerf.alignment import cameras, look, store, warped
from alignerf.cameras import refine
from alignerf.experiment import jobs
from alignerf.methods import align, base
from alignerf.processes import devices
from alignerf.scenes import prepared
from alignerf.training import compose, memory
from flow.camera import correct
from flow.estimation import estimators

# Places beside those of `align`: cameras are learnt from here on; they stay again.
LEARN, HOLD = "learn", "hold"

# Share of the steps from which on `min_move_px` is the flow's own error; before, in
# proportion, it is more.
SETTLED = 0.25
# Of `min_move_px`, once cameras were seen to be wrong: what is left of their error
# is then moved too. With nothing wrong the flow asks for more than that.
AGAIN = 0.3
# Before the last look for cameras some views tell whether any has to move: this share
# of them, evenly, and at least so many.
PROBED_FRACTION, MIN_PROBED = 0.2, 8
# Of a view as many pixels say where its camera is: a flow is smooth.
FITTED_PIXELS = 1000
# Of a pixel of a small image: a photo and where it counts, a depth, a flow and where it
# holds; offsets before, now and packed for the disk.
SMALL_BYTES = 3 + 1 + 4 + 8 + 1 + 3 * 8


class Aligner:
    """State of a training's alignments: its cameras, and the offsets of its photos."""

    def __init__(self, job: jobs.Job, scene: look.Scene, folder, method=None):
        """folder: of the training's checkpoints. method: that shows the views."""
        self.job, self.scene, self.folder = job, scene, folder
        self.settings = job.aligns
        few = look.with_fewer_samples(job)
        self.method = method or compose.without_cameras(few)
        self.size = scene.loaded.height, scene.loaded.width
        min_px = estimators.METHODS[job.aligns.estimator].min_side_px
        self.looks = not job.learns or job.learns.min_move_px is not None
        shrink = job.aligns.shrink
        try:
            self.k = look.factor(self.size, min_px, shrink) if self.looks else 1
        except ValueError as error:
            raise ValueError(f"{scene.photos}: {error}") from None
        self.now = scene.loaded
        self.offsets_px = None
        self.report = []
        self.identity, self.places, self.steps = "", {}, 0
        self.look = look.Looker(self.method, scene, self.k, job.aligns)

    @property
    def compile_time_s(self):
        """Seconds of compiling its renderer."""
        return self.look.compile_time_s

    def begin(self, steps, identity):
        """Fix the places of a training of so many steps; identity: its fingerprint."""
        self.identity, self.steps = identity, steps
        self.places = align.places(self.settings, steps)
        if learns := self.job.learns:
            begin = max(1, round(learns.delay_fraction * steps))
            end = max(begin + 1, round(learns.end_fraction * steps))
            for step, kind in ((begin, LEARN), (end, HOLD)):
                self.places.setdefault(step, []).append(kind)
            self.places = dict(sorted(self.places.items()))

    def restore(self, step) -> bool:
        """Load the alignments made before a step; returns whether they are on disk.

        An alignment that was made before this very step is not repeated.
        """
        stored = store.read(self.folder, identity=self.identity, size=self.sizes())
        aligned = stored and stored[1]["step"]
        last = max((at for at in self.places if at < step), default=None)
        if aligned is None or aligned not in (step, last):
            return last is None
        self.take(stored[0])
        self.report = stored[1]["report"]
        if aligned == step:
            del self.places[step]
        return True

    def align(self, params, step):
        """Render training views by these parameters, and correct what is off."""
        begun, compiled_s = time.perf_counter(), self.compile_time_s
        row = {"step": step, "corrects": self.places[step], "shrink": self.k}
        row |= self.corrected(devices.on_first(params), step)
        arrays = self.arrays()
        self.take(arrays)
        took_s = time.perf_counter() - begun - (self.compile_time_s - compiled_s)
        self.report.append(row | {"time_s": round(took_s, 3)})
        store.write(
            self.folder, arrays, identity=self.identity, step=step, report=self.report
        )
        store.say(self.report[-1])

    def corrected(self, params, step):
        """Entries of the report on what is corrected before a step."""
        kinds, row = self.places[step], {}
        if HOLD in kinds:
            self.now, row["learning"] = self.moved(params), False
        if LEARN in kinds:
            row["learning"] = True
        if {*align.CHANGED, *([LEARN] * self.looks)}.isdisjoint(kinds):
            return row
        views, seen, corrections = self.seen(params, step)
        row |= {"views": len(views)} | store.flow_length(seen, self.k)
        if "cameras" in kinds:
            row |= self.move_cameras(views, corrections)
        if "photos" in kinds:
            row |= self.move_photos(seen, corrections)
        elif row.get("cameras_moved"):
            # Offsets from renders by other cameras say nothing of these.
            self.offsets_px = None
        if LEARN in kinds:
            # A flow that nothing explains does not say that cameras are right.
            stay = sum(bool(one.left_alone) and one.trusted for one in corrections)
            row["learning"] = 2 * stay <= len(corrections)
        return row

    def seen(self, params, step):
        """(views, `correct.View` of each, `correct.Correction` of each or None).

        Where some of the views show that no camera has to move, the others are not
        looked at, nor where no camera would be moved. The last look for cameras is at
        all, as a single one may be wrong; not where they would be learnt from there on.
        """
        views, probed = self.scene.views, self.probed(step)
        now = self.moved(params)
        seen = list(self.look(params, now, probed))
        if len(probed) < len(views):
            corrections = self.corrections(seen, step)
            trusted = sum(one.trusted for one in corrections)
            stay = all(one.left_alone for one in corrections)
            if (stay and 2 * trusted > len(probed)) or self.places[step] == [LEARN]:
                return views[probed], seen, corrections
            found = dict(zip(probed, seen, strict=True))
            others = [i for i in range(len(views)) if i not in found]
            found |= zip(others, self.look(params, now, others), strict=True)
            seen = [found[i] for i in range(len(views))]
        asked = not {"cameras", LEARN}.isdisjoint(self.places[step])
        return views, seen, self.corrections(seen, step) if asked else None

    def probed(self, step):
        """Indices of the training views that are looked at first."""
        count = len(self.scene.views)
        few = max(MIN_PROBED, round(PROBED_FRACTION * count))
        later = [kinds for at, kinds in self.places.items() if at > step]
        is_early = self.places[step] == ["cameras"] and any(
            "cameras" in kinds for kinds in later
        )
        is_early |= LEARN in self.places[step]
        if 2 * few > count or not is_early or self.were_wrong():
            return list(range(count))
        return np.linspace(0, count - 1, few).round().astype(int).tolist()

    def corrections(self, seen, step):
        """A `correct.Correction` of each view."""
        corrections = correct.corrections(
            [lambda one=view: one for view in seen],
            min_px=self.min_px(step),
            zooms=not self.were_wrong(),
            max_pixels=FITTED_PIXELS,
        )
        if len(corrections) > 1:
            return corrections
        # What all corrections share is taken out: of a single correction, all of it.
        alone = "of one view nothing is known but by itself"
        return [correct.left_alone(one, alone) for one in corrections]

    def move_cameras(self, views, corrections):
        """Move the cameras that can be trusted; returns entries of the report."""
        self.now = cameras.corrected(self.now, views, corrections)
        names = [self.now.names[view] for view in views]
        return {
            "camera_px": self.k * cameras.median_px(corrections),
            "cameras_moved": len(cameras.moved_views(views, corrections)),
            "left_alone": store.staying(names, corrections, self.k),
        }

    def min_px(self, step):
        """Median motion in px below which all motions are the flow's own error.

        Early in a training renders are blurred, and the error is larger.
        """
        if self.were_wrong():
            return AGAIN * self.settings.min_move_px
        return self.settings.min_move_px * max(1.0, SETTLED * self.steps / step)

    def were_wrong(self):
        """Whether an earlier alignment moved most of the cameras."""
        most = len(self.scene.views) / 2
        return any(row.get("cameras_moved", 0) >= most for row in self.report)

    @property
    def learning(self):
        """Whether cameras are learnt now."""
        told = [row["learning"] for row in self.report if "learning" in row]
        return bool(told and told[-1])

    def learning_method(self):
        """The method that learns them."""
        return compose.make_method(self.job, self.scene.loaded, learning=True)

    def moved(self, params) -> prepared.Scene:
        """The scene with its cameras of now, aligned and learnt."""
        if not self.learning:
            return self.now
        scales = scales_of(self.job, self.scene.loaded)
        return refine.learnt(self.now, params["cameras"], scales)

    def move_photos(self, seen, corrections):
        """Set the offsets by which photos are warped; returns entries of the report.

        corrections: of the cameras at this step, or None.
        """
        corrections = corrections or [None] * len(seen)
        offsets = [
            warped.offsets(view, one, max_pixels=FITTED_PIXELS)
            for view, one in zip(seen, corrections, strict=True)
        ]
        self.offsets_px = np.stack(offsets).astype(np.float32)
        moving = (self.offsets_px != 0).any(axis=-1).mean(axis=(1, 2))
        return {
            "photos_warped": int((moving > 0).sum()),
            "moving_fraction": float(np.median(moving)),
        }

    def views(self, views):
        """The `batches.Views` after the alignments so far; views: before them."""
        chosen = self.scene.views
        if self.offsets_px is not None:
            views = warped.warped(views, self.offsets_px, self.k)
        return views._replace(
            pixtocams=self.now.pixtocams[chosen].astype(np.float32),
            camtoworlds=self.now.camtoworlds[chosen].astype(np.float32),
        )

    def arrays(self):
        """{name: array} of the state: cameras and, where photos are warped, offsets."""
        arrays = {
            "pixtocams": np.asarray(self.now.pixtocams),
            "camtoworlds": np.asarray(self.now.camtoworlds),
        }
        if self.offsets_px is not None:
            arrays["offsets_px"] = self.offsets_px
        return arrays

    def take(self, arrays):
        """Set the state from the arrays of `arrays`."""
        self.now = dataclasses.replace(
            self.scene.loaded,
            pixtocams=arrays["pixtocams"],
            camtoworlds=arrays["camtoworlds"],
        )
        self.offsets_px = arrays.get("offsets_px")

    def write(self, folder, views):
        """Write the photos as they are warped into a folder, where any may be.

        views: the training views as given.
        """
        if self.settings.photos_at:
            names = [self.now.names[view] for view in self.scene.views]
            now = self.views(views)
            store.write_photos(folder, names, now, views, self.offsets_px, self.k)

    def more_bytes(self, shapes):
        """Bytes that the alignments take besides the training's views, of these shapes.

        Photos as taken stay beside those that are warped; renders and flows are small.
        """
        photos = memory.tree_bytes(shapes.photos)
        small = SMALL_BYTES * photos // (3 * self.k**2)
        # Also where no photo is warped: views with new cameras are placed on the device
        # while the old ones are still there.
        return small + photos + memory.tree_bytes(shapes.valid)

    def sizes(self):
        """(shape, dtype) of each of the arrays."""
        n, views = len(self.now.names), len(self.scene.views)
        h, w = (side // self.k for side in self.size)
        return {
            "pixtocams": ((n, 3, 3), "float64"),
            "camtoworlds": ((n, 3, 4), "float64"),
            "offsets_px": ((views, h, w, 2), "float32"),
        }


class InLoop(base.Part):
    """What alignment in the loop, learnt cameras and both add to a training."""

    def wrapped(self, method, loaded, learning):
        if not self.job.learns:
            return method
        return refine.refined(
            method,
            scales_of(self.job, loaded),
            prior_weight=self.job.learns.prior_weight,
            learning=learning,
        )

    def aligner(self, loaded, photos, folder):
        scene = look.Scene(loaded, loaded.views("train"), photos)
        return Aligner(self.job, scene, folder)

    def moved(self, loaded, params, aligner):
        return aligner.moved(params)

    def write(self, folder, given, moved, aligner, views, cameras):
        store.write_cameras(folder / "cameras.npz", given, moved, cameras)
        aligner.write(folder, views)


def scales_of(job, given: prepared.Scene):
    """What the learnt parameters of the training views are multiplied by."""
    return refine.scales_of(refine.views_of(given), job.learns.preconditioned)
