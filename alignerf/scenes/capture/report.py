"""The parts of poses.json on the photos that were posed, and on their points."""

import numpy as np


def registration(names, left_out):
    """The part of the report that every source has."""
    return {
        "registered": len(names),
        "total": len(names) + len(left_out),
        "left_out": list(left_out),
        "mean_reprojection_error_px": None,
        "points": None,
        "models": None,
    }


def points(model):
    """The part about the points of a `colmap.Reconstruction`."""
    return {
        "mean_reprojection_error_px": model.mean_reprojection_error_px,
        "points": len(model.points),
        "points_in_3_views": model.points_in_3_views,
        "reprojection_errors_px": errors_of(model),
        "keypoints": model.keypoints,
    }


def photos(model, taken):
    """The part about photos: how they lie, and their lenses."""
    place = {name: i for i, name in enumerate(taken.names)}
    turns = {name: taken.lays[place[name]].turns for name in model.names}
    lenses = {}
    for i, number in enumerate(model.camera_of):
        lens = {"focal_px": [float(model.camtopix[i][k, k]) for k in (0, 1)]}
        lens |= {"centre_px": model.camtopix[i][:2, 2].tolist()}
        lens |= {"distortion": model.distortion[i].tolist()}
        lenses.setdefault(number, lens | {"views": 0})["views"] += 1
    focals = [taken.camera(k).focal_px for k in range(taken.cameras.max() + 1)]
    return {
        "camera_model": model.camera_model,
        "cameras": list(lenses.values()),
        "exif_focal_px": focals[0] if len(focals) == 1 else None,
        # Clockwise, until a view stands upright; the others do.
        "quarter_turns": {name: turn for name, turn in turns.items() if turn},
    }


def errors_of(model):
    """{view: mean reprojection error in px}; None of a view that sees no point."""
    return {
        name: None if np.isnan(error) else round(float(error), 4)
        for name, error in zip(model.names, model.errors_px, strict=True)
    }


def check_registered(model, least, where):
    """ValueError where too few photos are in the largest model."""
    count = len(model.names) + len(model.left_out)
    if len(model.names) < least * count:
        others = ", ".join(map(str, model.models[1:]))
        apart = f"; others are in models of {others}: two scenes?" if others else ""
        raise ValueError(
            f"{where}: COLMAP registered {len(model.names)} of {count} photos together"
            f"{apart}. Take more photos that overlap, sort out those of other places, "
            "or lower colmap.least_registered"
        )
