"""Windows of the photos at their own size: photo, render before, render after.

Folders are those of trainings on windows (`alignerf.verdict.evidence`): views are
called <photo>_w0, <photo>_w1.
"""

from pathlib import Path

import numpy as np

from alignerf.files import images
from alignerf.page import pictures
from alignerf.scenes import prepared

QUALITY = 90
MOST_BYTES = 1_500_000


def read(given, corrected, by, shown):
    """{view: [{layers: {name: data URI}, offset_px}]} of the photos' windows.

    given, corrected: folders results/SCENE/METHOD/round0 of trainings with the cameras
    as given and as the method `by` has put them right; None where there is none.
    offset_px: where a window's render by the second lies from the first, x first; left
    out without it. Photos at the end of `shown` have none where they do not fit.
    """
    if not given:
        return {}
    before, after = of_folder(given), of_folder(corrected) if corrected else {}
    found, size = {}, 0
    for one in shown:
        for name in windows_of(one, before):
            entry = of_window(before[name], after.get(name), by, one.turns)
            size += sum(map(pictures.size_of, entry["layers"].values()))
            if size > MOST_BYTES:
                return found
            found.setdefault(one.key, []).append(entry)
    return found


def windows_of(one, before):
    """Names of a photo's windows, in order."""
    return sorted(name for name in before if name.rpartition("_w")[0] == one.row.view)


def of_folder(base):
    """{window: (its photo, its render, its corner in px)} of a training."""
    base = Path(base)
    scene = prepared.load(base.parents[1])
    middles = np.linalg.inv(scene.pixtocams)[:, :2, 2]
    found = {}
    for view, name in enumerate(scene.names):
        render = base / "renders" / str(scene.split[view]) / f"{name}.png"
        photo = scene.folder / "images" / f"{name}.png"
        if render.is_file():
            # A corner further to the right has the principal point further left.
            found[name] = photo, render, -middles[view]
    return found


def of_window(before, after, by, turns):
    """A window's images as data URIs, and the offset of the last."""

    def uri(path):
        return pictures.data_uri(np.rot90(images.read(path), -turns), None, QUALITY)

    layers = {"photo": uri(before[0]), "render": uri(before[1])}
    entry = {"layers": layers}
    if after is not None:
        layers[f"render, {by}"] = uri(after[1])
        moved = np.round(after[2] - before[2]).astype(int)
        for _ in range(turns):
            moved = np.array([-moved[1], moved[0]])
        entry["offset_px"] = moved.tolist()
    return entry
