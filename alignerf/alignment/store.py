"""The corrections of a training's alignments: beside its checkpoint, and as results.

`alignment-<step>.msgpack` holds the arrays of the newest alignment, its cameras and
offsets. `alignment.json` names this file with its SHA-256, the training's fingerprint
and the report. The JSON is replaced last, as in `training.checkpoint`. Results are
files of cameras and photos, the report and the log.
"""

import logging
import pathlib

import flax.serialization
import numpy as np

from alignerf.io import faults, images, json_files
from alignerf.scenes import prepared
from alignerf.training import batches, checkpoint

log = logging.getLogger("alignerf")

FILE = "alignment.json"
MANIFEST = dict.fromkeys(("file", "sha256", "identity"), str) | {"step": int}
MANIFEST |= {"report": list}
# Arrays that it always has; of warped photos there are more.
NEEDED = {"pixtocams", "camtoworlds"}


def write(folder, arrays, *, identity, step, report):
    """Write the arrays {name: array} of the alignment before a step."""
    data = flax.serialization.msgpack_serialize(arrays)
    facts = {"identity": identity, "step": step, "report": report}
    path = pathlib.Path(folder) / FILE
    checkpoint.write_named(path, "alignment", step, data, **facts)


def read(folder, *, identity, size):
    """(arrays, manifest) of this very training's newest alignment; None without one.

    size: {name: (shape, dtype)} of what there may be. What is damaged is said so, and
    counts as none.
    """
    path = pathlib.Path(folder) / FILE
    if not path.exists():
        return None
    try:
        manifest = json_files.read(path, MANIFEST)
        if manifest["identity"] != identity:
            return None
        data = checkpoint.read_named(path, manifest, "alignment")
        arrays = flax.serialization.msgpack_restore(data)
        check(arrays, size)
    except (OSError, ValueError, KeyError, TypeError) as error:
        log.warning("%s: alignment not usable: %s", path, error)
        return None
    return arrays, manifest


def check(arrays, size):
    """ValueError where arrays are not of these shapes, or hold what is not finite."""
    kinds = {name: (a.shape, a.dtype.name) for name, a in arrays.items()}
    if not (kinds.keys() >= NEEDED and kinds.items() <= size.items()):
        raise ValueError("its arrays are not this training's")
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{name} is not finite")


def write_cameras(path, original, scene: prepared.Scene, cameras=None):
    """Write a scene's cameras as they are now.

    original: the scene with its cameras as they were. cameras: the file of these; the
    poses of views that did not move stay as they are there, to the bit.
    """
    moved = (scene.camtoworlds != original.camtoworlds).any(axis=(1, 2))
    prepared.write_cameras(path, scene, cameras, moved)


def write_photos(folder, names, views, taken, offsets_px, k):
    """Write photos/<view>.png and valid/<view>.npz of views of these names.

    views: a `batches.Views`, the photos as warped in the end and where they hold;
    taken: before. offsets_px, k: as of `photos.warped`, or None where none is warped.
    They are written beside where the photo holds, so that it can be warped again at
    another size; a photo that stayed as taken has none.
    """
    for kind in ("photos", "valid"):
        (folder / kind).mkdir()
    if offsets_px is None:
        h, w = views.photos.shape[1:3]
        offsets_px = np.zeros((len(names), h // k, w // k, 2), np.float32)
    for slot, name in enumerate(names):
        photo = np.asarray(views.photos[slot])
        images.write(folder / "photos" / f"{name}.png", photo)
        counts = batches.unpack_valid(views.valid[slot], photo.shape[1])
        same = np.array_equal(photo, taken.photos[slot])
        np.savez_compressed(
            folder / "valid" / f"{name}.npz",
            valid=counts,
            offsets_px=np.zeros_like(offsets_px[slot]) if same else offsets_px[slot],
            shrink=k,
        )


def flow_length(seen, k):
    """{flow_px}: the median view's median flow, in px of the photos; null without one.

    seen: a `correct.View` of each view, of images made smaller by k.
    """
    medians = [
        np.median(np.linalg.norm(view.flow_px[view.valid], axis=-1))
        for view in seen
        if view.valid.any()
    ]
    return {"flow_px": k * float(np.median(medians)) if medians else None}


def staying(names, corrections, k):
    """{why a camera stays: names of these views}, of their `correct.Correction`s.

    k: factor by which the images were made smaller; reasons are in their pixels.
    """
    unit = f" (px of renders made smaller by {k})" if k > 1 else ""
    reasons = {}
    for name, correction in zip(names, corrections, strict=True):
        if correction.left_alone:
            reasons.setdefault(correction.left_alone + unit, []).append(name)
    return reasons


def say(row):
    """Log an entry of the report."""
    clauses = []
    if row.get("flow_px") is not None:
        clauses.append(
            f"renders and photos of {row['views']} views are apart by "
            f"{row['flow_px']:.2f} px"
        )
    if "cameras_moved" in row:
        moved, length_px = row["cameras_moved"], row["camera_px"]
        clauses.append(f"{moved} cameras move, by {length_px:.2f} px in the median")
    if "photos_warped" in row:
        share = row["moving_fraction"]
        warped = row["photos_warped"]
        clauses.append(f"{warped} photos warped, {share:.1%} of the median")
    if "learning" in row:
        clauses.append(f"cameras {'are learned' if row['learning'] else 'stay'}")
    log.info("aligned at step %d: %s", row["step"], "; ".join(clauses))
    for reason, views in row.get("left_alone", {}).items():
        log.info("cameras of %s stay: %s", faults.some_names(views), reason)
