"""The truth of windows of the courtyard's photos: that of the whole photos, cut."""

import numpy as np

from alignerf.files import archives, images
from alignerf.scenes import prepared
from alignerf.scenes.capture import windows as of_windows

# Arrays of the truth's files.
OF_TRUTH = {"depth": ["depth_m"], "flow": ["flow_px", "valid"], "moving": ["moving"]}


def cut_truth(folder, names, windows: of_windows.Windows):
    """Cut the truth of whole views, in place; returns the mean true flow in px.

    folder: of `courtyard.truth.write_truth`, for the views that have windows.
    """
    lengths_px = []
    for name, corner in zip(names, windows.corners, strict=True):
        piece = of_windows.piece_at(corner, windows.px)
        path = folder / "oracle" / f"{name}.png"
        images.write(path, piece(images.read(path)))
        for kind, arrays_of in OF_TRUTH.items():
            path = folder / kind / f"{name}.npz"
            if path.is_file():
                arrays = archives.read(path, arrays_of)
                arrays = {key: piece(array) for key, array in arrays.items()}
                if kind == "flow":
                    arrays["valid"] &= stays(arrays["flow_px"], windows.px)
                    flow_px = arrays["flow_px"][arrays["valid"]]
                    lengths_px.append(np.linalg.norm(flow_px, axis=-1))
                np.savez_compressed(path, **arrays)
    path = folder / "cameras.npz"
    arrays = prepared.read_cameras(path)
    arrays["pixtocams"] = of_windows.shifted(arrays["pixtocams"], windows)
    arrays |= {"width": np.int64(windows.px), "height": np.int64(windows.px)}
    np.savez(path, **arrays)
    return float(np.concatenate(lengths_px).mean())


def stays(flow_px, px):
    """Where a flow [px, px, 2] ends inside of the window."""
    y, x = np.mgrid[:px, :px]
    ends = np.stack([x, y], axis=-1) + flow_px
    return ((ends >= 0) & (ends <= px - 1)).all(axis=-1)
