"""What a scene is, and which settings suit it: `python -m alignerf.facts`.

Facts: number and size of the views, how the cameras stand, the nearest and the farthest
depth, how well the poses fit, how much exposure changes, and which photos are soft.
Lengths are in units of the normalized scene, in which the largest coordinate of a
camera is 1. An unknown fact is null.
"""

import json
from pathlib import Path

import numpy as np

from alignerf.experiment import decisions
from alignerf.io import archives, atomic, faults
from alignerf.metrics import image as image_metrics
from alignerf.scenes import cameras, prepared

# Mean of the directions that cameras look in, where all look one way.
FORWARD = 0.9
# A bounded scene's farthest point over its median depth.
BOUNDED = 4.0
# Fine detail of a photo over the median's, under which it is called soft.
SOFT = 0.5


OPTIONS = {
    "[scene]": "prepared scene folder",
    "[facts]": "facts.json, written",
    "[decisions]": "decisions.json, written",
    "[show]": ("decisions.json, printed", {"type": Path} | faults.SEVERAL),
    "[unasked]": ("say: not applied", faults.FLAG),
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    if args.show:
        print("\n".join(decisions.shown(args.show, not args.unasked)))
    elif args.scene and args.facts and args.decisions:
        write(args)
    else:
        raise ValueError("--scene, --facts and --decisions, or --show")


def write(args):
    """Write the facts of a scene, and what they decide."""
    loaded = prepared.load(args.scene)
    everything = np.arange(len(loaded.names))
    images = prepared.read_images(loaded, everything, loaded.folder / "images")
    facts = {
        "views": len(loaded.names),
        "train_views": len(loaded.views("train")),
        "test_views": len(loaded.views("test")),
        "width_px": loaded.width,
        "height_px": loaded.height,
        "photo_bytes": images.nbytes,
        **camera_facts(loaded),
        **point_facts(loaded),
        **pose_facts(loaded.folder / "poses.json"),
        **photo_facts(images, loaded.names, prepared.read_masks(loaded, everything)),
    }
    found = decisions.decide(facts)
    content = {"decisions": [decision._asdict() for decision in found]}
    with atomic.replace_file(args.facts) as path:
        path.write_text(json.dumps(facts, indent=1))
    with atomic.replace_file(args.decisions) as path:
        path.write_text(json.dumps(content, indent=1) + "\n")
    print("\n".join(map(decisions.line, found)))


def camera_facts(loaded: prepared.Scene):
    """How the cameras stand, in the normalised frame (max |t| = 1)."""
    focal_px = 1 / np.linalg.norm(loaded.pixtocams[:, :, 0], axis=-1)
    looking = -loaded.camtoworlds[:, :, 2]
    mean = looking.mean(axis=0)
    # 1 where all look one way (forward-facing), near 0 all around an object.
    agreement = float(np.linalg.norm(mean))
    return {
        "focal_px": round(float(focal_px.mean()), 3),
        "pixel_angle_mrad": round(float(1e3 / focal_px.mean()), 4),
        "looking_agreement": round(agreement, 4),
        "capture": capture_of(loaded.camtoworlds, agreement),
        "centre_distance": focus_distance(loaded.camtoworlds),
        "neighbour_angle_deg": neighbour_angle_deg(loaded.camtoworlds),
    }


def focus_distance(camtoworlds):
    """Mean distance of the cameras from the point closest to all optical axes."""
    focus = cameras.focus_of(camtoworlds)
    if focus is None:
        return None
    distances = np.linalg.norm(camtoworlds[:, :, 3] - focus, axis=-1)
    return round(float(distances.mean()), 4)


def capture_of(camtoworlds, agreement):
    """In words: forward-facing, inward (around something) or outward (a room)."""
    if agreement > FORWARD:
        return "forward-facing"
    focus = cameras.focus_of(camtoworlds)
    if focus is None:
        return "one view" if len(camtoworlds) == 1 else "forward-facing"
    ahead = np.sum((focus - camtoworlds[:, :, 3]) * -camtoworlds[:, :, 2], axis=-1)
    return "inward" if np.mean(ahead > 0) > 0.5 else "outward"


def neighbour_angle_deg(camtoworlds):
    """Median angle between a view's direction and that of its nearest neighbour.

    Directions are those from the cameras' common focus; for forward-facing or outward
    views, the optical axes. A large angle means few photos for the scene's size.
    """
    if len(camtoworlds) < 2:
        return None
    axes, focus = -camtoworlds[:, :, 2], cameras.focus_of(camtoworlds)
    if focus is not None:
        towards = focus - camtoworlds[:, :, 3]
        length = np.linalg.norm(towards, axis=-1, keepdims=True)
        axes = np.where(length > 1e-9, towards / np.maximum(length, 1e-9), axes)
    cosines = axes @ axes.T
    np.fill_diagonal(cosines, -1.0)
    nearest = np.degrees(np.arccos(np.clip(cosines.max(axis=1), -1.0, 1.0)))
    return round(float(np.median(nearest)), 3)


def point_facts(loaded: prepared.Scene):
    """Nearest and farthest depths, from LLFF's bounds or COLMAP's points.

    `bounded`: hardly any point lies beyond a few times the median depth.
    """
    own = prepared.read_cameras(loaded.folder / "cameras.npz")["camtoworlds"]
    transform = cameras.frame_of(own).transform()
    depths = depths_of_bounds(loaded, transform)
    if not len(depths):
        depths = depths_of_points(loaded, transform)
    if not len(depths):
        return dict.fromkeys(("nearest", "median_depth", "farthest", "bounded"))
    # COLMAP's outliers are not the scene's ends.
    near, middle, far = np.quantile(depths, [0.01, 0.5, 0.99])
    return {
        "nearest": float(f"{near:.5g}"),
        "median_depth": float(f"{middle:.5g}"),
        "farthest": float(f"{far:.5g}"),
        "bounded": bool(far < BOUNDED * middle),
    }


def depths_of_points(loaded: prepared.Scene, transform):
    """Depths of COLMAP's points in every view whose image they fall into."""
    path = loaded.folder / prepared.POINTS
    if not path.is_file():
        return np.zeros(0)
    points = archives.read(path, ("points",))["points"]
    points = points @ transform[:3, :3].T + transform[:3, 3]
    depths = []
    for pixtocam, pose in zip(loaded.pixtocams, loaded.camtoworlds, strict=True):
        at, depth = cameras.project(points, pixtocam, pose)
        inside = (depth > 0) & (at > 0).all(-1)
        inside &= (at < [loaded.width, loaded.height]).all(-1)
        depths.append(depth[inside])
    return np.concatenate(depths)


def depths_of_bounds(loaded: prepared.Scene, transform):
    """LLFF's two depths of each view, and their harmonic mean."""
    path = loaded.folder / prepared.BOUNDS
    if not path.is_file():
        return np.zeros(0)
    scale = np.cbrt(np.linalg.det(transform[:3, :3]))
    bounds = archives.read(path, ("bounds",))["bounds"] * scale
    # What LLFF could not tell is no fact.
    known = np.isfinite(bounds).all(-1) & (bounds[:, 0] > 0)
    near, far = bounds[known & (bounds[:, 1] > bounds[:, 0])].T
    return np.concatenate([near, 2 / (1 / near + 1 / far), far])


def pose_facts(path):
    """How well the poses fit, in pixels of the training size."""
    empty = dict.fromkeys(
        (
            *("reprojection_px", "points_in_3_views", "registered_fraction"),
            *("photo_width_px", "photo_height_px", "downscale", "downscale_decided"),
        )
    )
    if not path.is_file():
        return empty
    report = prepared.read_poses(path.parent)
    error_px = report["mean_reprojection_error_px"]
    if error_px is not None:
        error_px = round(error_px * report["width"] / report["photo_width"], 4)
    return {
        "reprojection_px": error_px,
        "points_in_3_views": report.get("points_in_3_views"),
        "registered_fraction": round(report["registered"] / report["total"], 4),
        "photo_width_px": report["photo_width"],
        "photo_height_px": report.get("photo_height"),
        "downscale": report.get("downscale"),
        "downscale_decided": report.get("downscale_decided", False),
    }


def photo_facts(images, names, counts):
    """Brightness, its spread over views (exposure), clipped pixels, soft photos.

    images [n, h, w, 3] uint8; counts [n, h, w]: where they count.
    """
    kept = [image[mask] for image, mask in zip(images, counts, strict=True)]
    brightness = np.array([pixels.mean() / 255.0 for pixels in kept])
    clipped = np.mean([(pixels == 255).all(axis=-1).mean() for pixels in kept])
    detail = np.array([image_metrics.detail(image) for image in images])
    soft = detail < SOFT * np.median(detail)
    stops = np.log2(np.maximum(brightness, 1e-3))
    return {
        "brightness": round(float(brightness.mean()), 4),
        "brightness_spread": round(float(brightness.std()), 4),
        "brightness_spread_ev": round(float(stops.std()), 4),
        "white_fraction": round(float(clipped), 4),
        "soft_photos": [names[view] for view in np.flatnonzero(soft)],
    }


if __name__ == "__main__":
    faults.run(main)
