"""What one view's photo and render say, with the flow between them."""

from typing import NamedTuple

import numpy as np

from alignerf.cameras import exposure, transients
from alignerf.causes import motion
from alignerf.io import archives, csv_files
from alignerf.metrics import copies, floaters, pairs, spectrum, tone
from alignerf.scenes import prepared
from alignerf.verdict import views


class Seen(NamedTuple):
    """A view's row, and what is compared with other views'.

    place: as `transients` compares it. octaves: of `spectrum`. hidden: the fraction of
    the view that something close to the camera hides. scores: by name, {} of what is
    asked for none.
    """

    row: views.View
    pair: pairs.Seen
    sampled: exposure.Sampled
    place: transients.View
    levels: tone.Levels
    octaves: np.ndarray
    hidden: float
    small: np.ndarray
    scores: dict


def of_view(loaded: prepared.Scene, base, split, tables, look, metrics, view):
    """The `Seen` of a view.

    tables: of its split, by names; look: `pairs.look` with its options. metrics: {name:
    function of photo, render and where that counts}.
    """
    name = loaded.names[view]
    (photo,) = prepared.read_images(loaded, [view], loaded.folder / "images")
    (render,) = prepared.read_images(loaded, [view], base / "renders" / split)
    _, valid = read_flow(base, split, name)
    (counts,) = prepared.read_masks(loaded, [view])
    # Without any render of a learned photo, those of held-out ones have to tell.
    learned = split == "train" or not (base / "renders" / "train").is_dir()
    row = tables.loc[name]
    measured = views.View(
        view=name,
        split=split,
        flow_px=row["flow_median_px"],
        camera_px=row["camera_median_px"],
        remainder_px=row["remainder_median_px"],
        moved_fraction=moved_fraction(
            base, split, name, row["camera_median_px"], photo
        ),
        blur_sigma_px=row["blur_sigma_px"],
        **views.measured(photo, render, valid, counts),
    )
    depth = archives.read(base / "depth" / split / f"{name}.npz", ["depth"])["depth"]
    camera = loaded.pixtocams[view], loaded.camtoworlds[view]
    whole = exposure.View(photo, depth, *camera, counts)
    shown = np.where(counts[..., None], photo, render)
    return Seen(
        measured,
        look(photo, render, counts),
        exposure.sampled(whole),
        transients.small(whole, render, learned),
        tone.levels_of(photo, render, counts),
        spectrum.octaves(shown, render) * (1.0 if counts.mean() > 0.5 else np.nan),
        floaters.hidden(photo, render, depth, counts),
        copies.small(photo),
        {
            name: known(metric, photo, render, counts)
            for name, metric in metrics.items()
        },
    )


def known(metric, *pair):
    """A metric of a pair; NaN where it is too small, or too little of it counts."""
    try:
        return metric(*pair)
    except ValueError:
        return np.nan


def table(base, split):
    """Numbers of a split's views, by their names."""
    parts = csv_files.by_view(base / f"decomposition_photos_{split}.csv")
    lengths = csv_files.by_view(base / "displacement" / f"{split}.csv")
    return parts.join(lengths["blur_sigma_px"])


def read_flow(base, split, name):
    """(flow_px [h, w, 2], valid [h, w]) of a view."""
    data = archives.read(base / "flow" / split / f"{name}.npz", ("flow_px", "valid"))
    return data["flow_px"], data["valid"]


def moved_fraction(base, split, name, camera_px, photo):
    """Share of a view's valid pixels that moved on their own, by a visible length; NaN
    of none.

    Where the photo is flat, as in a sky, a flow says nothing.
    """
    min_px = max(motion.MOVED_PX, motion.MOVED_OF_CAMERA * camera_px)
    path = base / "parts_photos" / split / f"{name}.npz"
    data = archives.read(path, ("remainder_px", "moved", "valid"))
    far = np.linalg.norm(data["remainder_px"], axis=-1) > min_px
    valid = data["valid"]
    moved = data["moved"] & far & valid & views.textured(photo)
    return float(moved.sum() / valid.sum()) if valid.any() else np.nan
