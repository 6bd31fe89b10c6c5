"""What a scene is, and which settings suit it: `python -m alignerf.facts`.

Facts: number and size of views and photos, what a pixel covers, the nearest and the
median depth. Lengths are in units of the normalized scene, in which the largest
coordinate of a camera is 1. An unknown fact is null.
"""

import json
from pathlib import Path

import numpy as np

from alignerf.experiment import decisions
from alignerf.io import archives, atomic, faults
from alignerf.scenes import cameras, prepared

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
    focal_px = 1 / np.linalg.norm(loaded.pixtocams[:, :, 0], axis=-1)
    facts = {
        "views": len(loaded.names),
        "train_views": len(loaded.views("train")),
        "test_views": len(loaded.views("test")),
        "width_px": loaded.width,
        "height_px": loaded.height,
        "pixel_angle_mrad": round(float(1e3 / focal_px.mean()), 4),
        **point_facts(loaded),
        **photo_facts(loaded.folder),
    }
    found = decisions.decide(facts)
    content = {"decisions": [decision._asdict() for decision in found]}
    with atomic.replace_file(args.facts) as path:
        path.write_text(json.dumps(facts, indent=1))
    with atomic.replace_file(args.decisions) as path:
        path.write_text(json.dumps(content, indent=1) + "\n")
    print("\n".join(map(decisions.line, found)))


def point_facts(loaded: prepared.Scene):
    """Nearest and median depth, from LLFF's bounds or COLMAP's points."""
    own = prepared.read_cameras(loaded.folder / "cameras.npz")["camtoworlds"]
    transform = cameras.frame_of(own).transform()
    depths = depths_of_bounds(loaded, transform)
    if not len(depths):
        depths = depths_of_points(loaded, transform)
    if not len(depths):
        return dict.fromkeys(("nearest", "median_depth"))
    # COLMAP's outliers are not the scene's ends.
    near, middle = np.quantile(depths, [0.01, 0.5])
    return {"nearest": float(f"{near:.5g}"), "median_depth": float(f"{middle:.5g}")}


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


def photo_facts(folder):
    """Size of the photos, and how their factor came about, by a scene's poses.json."""
    report = prepared.read_poses(folder) if (folder / "poses.json").is_file() else {}
    return {
        "photo_width_px": report.get("photo_width"),
        "photo_height_px": report.get("photo_height"),
        "downscale": report.get("downscale"),
        "downscale_decided": report.get("downscale_decided", False),
    }


if __name__ == "__main__":
    faults.run(main)
