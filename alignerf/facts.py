"""What a scene is, before anything is trained: `python -m alignerf.facts`.

People model only what a scene requires: how many views of what size, whether they
look at one place or along one direction, and how much exposure changes.
"""

import argparse
import json

import numpy as np

from alignerf.command import faults, whole
from alignerf.scenes import prepared


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--facts", required=True, help="facts.json, written")
    args = parser.parse_args(argv)
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
        **photo_facts(images),
    }
    with whole.replace_file(args.facts) as path:
        path.write_text(json.dumps(facts, indent=1))


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
        "capture": "forward-facing" if agreement > 0.9 else "inward or outward",
        "centre_distance": focus_distance(loaded.camtoworlds),
    }


def focus_distance(camtoworlds):
    """Mean distance of the cameras from the point closest to all optical axes.

    None without such a point (parallel axes, or one camera).
    """
    origins, axes = camtoworlds[:, :, 3], -camtoworlds[:, :, 2]
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    matrix = across.sum(axis=0)
    if np.linalg.cond(matrix) > 1e8:
        return None
    focus = np.linalg.solve(matrix, (across @ origins[..., None]).sum(axis=0)[:, 0])
    return round(float(np.linalg.norm(origins - focus, axis=-1).mean()), 4)


def photo_facts(images):
    """Brightness, its spread over views (exposure), and clipped pixels."""
    brightness = np.array([image.mean() / 255.0 for image in images])
    clipped = np.mean([(image == 255).all(axis=-1).mean() for image in images])
    return {
        "brightness": round(float(brightness.mean()), 4),
        "brightness_spread": round(float(brightness.std()), 4),
        "white_share": round(float(clipped), 4),
    }


if __name__ == "__main__":
    faults.run(main)
