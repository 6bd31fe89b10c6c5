"""A trainer of somebody else's, for tests: it averages photos that see the same.

    python stand_in.py train DATA MODEL [--fail]
    python stand_in.py render DATA MODEL RENDERS --geometry FOLDER [--depth FOLDER]

Geometry is known to it, cameras and photos are not: what a pixel shows is the mean of
the nearest training photos there, by the cameras in DATA/transforms.json. Where these
are wrong its renders are blurred, and lie beside their photos. It needs NumPy and
OpenCV alone, and knows nothing of this project.

Notation: cameras have OpenGL axes (x right, y up, z backwards), pixel centres at +0.5.
"""

import argparse
import json
import pathlib
import sys

import cv2
import numpy as np

NEIGHBOURS = 4
# A photo sees a point whose depth is, by its own depth map, no larger than this.
OCCLUDED = 1.05


def train(args):
    """Keep the training photos, and a word that they are there."""
    frames = read_frames(args.data, "train")
    print(f"learning from {len(frames)} photos")
    if args.fail:
        sys.exit("stand_in: no more memory")
    photos = {
        name: read_photo(args.data / frame["file_path"])
        for name, frame in frames.items()
    }
    args.model.mkdir(parents=True, exist_ok=True)
    np.savez(args.model / "photos.npz", **photos)


def render(args):
    """Write an image of each view, and its depth if that is asked for."""
    frames = read_frames(args.data, "train") | read_frames(args.data, "test")
    learnt = dict(np.load(args.model / "photos.npz"))
    depths = {
        name: np.load(args.geometry / f"{name}.npz")["depth_m"] for name in frames
    }
    for name, frame in frames.items():
        camera = camera_of(frame)
        near = sorted(learnt, key=lambda n: away(camera, camera_of(frames[n])))
        points = points_of(camera, depths[name])
        total, weight = 0.0, 1e-6
        for other in near[:NEIGHBOURS]:
            photo, seen = look(
                points, camera_of(frames[other]), learnt[other], depths[other]
            )
            total, weight = total + seen * photo, weight + seen
        image = total / weight
        empty = (weight < 0.5).astype(np.uint8)[..., 0]
        image = np.clip(image.round(), 0, 255).astype(np.uint8)
        image = cv2.inpaint(image, empty, 3, cv2.INPAINT_TELEA)
        cv2.imwrite(str(args.renders / f"{name}.png"), image)
        if args.depth:
            np.save(args.depth / f"{name}.npy", depths[name])


def read_frames(data, split):
    """{view: its frame} of a split of transforms.json."""
    content = json.loads((data / "transforms.json").read_text())
    chosen = set(content[f"{split}_filenames"])
    frames = [frame for frame in content["frames"] if frame["file_path"] in chosen]
    return {pathlib.Path(frame["file_path"]).stem: frame for frame in frames}


def read_photo(path):
    return cv2.imread(str(path)).astype(np.float32)


def camera_of(frame):
    """(camtopix [3, 3], camtoworld [4, 4])."""
    camtopix = np.eye(3)
    camtopix[[0, 1, 0, 1], [0, 1, 2, 2]] = [frame[k] for k in LENS]
    return camtopix, np.array(frame["transform_matrix"])


LENS = ("fl_x", "fl_y", "cx", "cy")


def away(camera, other):
    """How far apart two cameras are, by place and direction."""
    (_, one), (_, two) = camera, other
    return np.linalg.norm(one[:3, 3] - two[:3, 3]) - 3 * one[:3, 2] @ two[:3, 2]


def points_of(camera, depth):
    """Points [h, w, 3] of the world that a camera's pixels show."""
    camtopix, camtoworld = camera
    y, x = np.indices(depth.shape) + 0.5
    rays = np.stack([x, y, np.ones(depth.shape)], axis=-1) @ np.linalg.inv(camtopix).T
    rays = rays * [1, -1, -1] * depth[..., None]
    return rays @ camtoworld[:3, :3].T + camtoworld[:3, 3]


def look(points, camera, photo, depth):
    """(what a photo shows of points, where it sees them): [h, w, 3], [h, w, 1]."""
    camtopix, camtoworld = camera
    local = (points - camtoworld[:3, 3]) @ camtoworld[:3, :3] * [1, -1, -1]
    z = np.maximum(local[..., 2:], 1e-6)
    at = (local @ camtopix.T)[..., :2] / z - 0.5
    at = np.clip(at, -1e4, 1e4).astype(np.float32)
    colours = cv2.remap(photo, at, None, cv2.INTER_LINEAR)
    own = cv2.remap(depth.astype(np.float32), at, None, cv2.INTER_NEAREST)
    h, w = depth.shape
    inside = (at >= 0).all(axis=-1) & (at[..., 0] < w - 1) & (at[..., 1] < h - 1)
    sees = inside & (local[..., 2] > 1e-6) & (local[..., 2] < OCCLUDED * own)
    return colours, sees[..., None].astype(np.float32)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("train", "render"))
    for name in ("data", "model"):
        parser.add_argument(name, type=pathlib.Path)
    parser.add_argument("renders", type=pathlib.Path, nargs="?")
    parser.add_argument("--geometry", type=pathlib.Path)
    parser.add_argument("--depth", type=pathlib.Path)
    parser.add_argument("--fail", action="store_true")
    args = parser.parse_args()
    {"train": train, "render": render}[args.what](args)


if __name__ == "__main__":
    main()
