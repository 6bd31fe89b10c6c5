"""What poses cost: seconds, memory and pose error by number and size of photos.

    python -m tools.bench.poses_costs WORK --out docs/measured/poses_costs.csv

Photos of a made-up room, whose cameras are known exactly, are drawn into WORK. `given`:
`make poses` on them with cameras that are OFF_PX off; `none`: COLMAP's own run and the
check, as the first stage of `make photos`. Each case runs in a process of its own, and
is not run again where its row is in the CSV. wall_s is the whole command; parts are
wall and CPU seconds, and what is left of the whole is reading, checking and waiting.
Errors are px of the photo: `pose_error.distance_px` at the room's surface.
"""

import argparse
import contextlib
import json
import logging
import os
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pandas as pd

from alignerf import poses as stage
from alignerf.cli import poses as command
from alignerf.colmap import ingest, mapping
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import archives, machine, progress
from alignerf.keypoints import readjustment
from alignerf.scenes import cameras, prepare
from alignerf.sfm import correction, pose_error
from tools.bench import measure

# (photos, width) of each case, each with and without cameras.
CASES = ((30, 1600), (50, 4000), (150, 4000), (300, 4000))
# Wrong by so many px of a photo of 1600 px: the same angle at every size.
OFF_PX = 2.0
# Metres, z up: the room, and boxes in it.
ROOM = np.array([[-3.0, -3.0, 0.0], [3.0, 3.0, 2.6]])
BOXES = np.array(
    [
        [[-0.9, -0.5, 0.0], [-0.2, 0.3, 0.8]],
        [[0.1, -0.7, 0.0], [0.6, -0.1, 1.3]],
        [[0.2, 0.4, 0.0], [1.0, 0.9, 0.5]],
        [[-0.7, 0.8, 0.0], [-0.3, 1.2, 1.0]],
    ]
)
# Of the textures: what a photo of 12 MP sees from 3 m.
PX_PER_M, WIDTH, HEIGHT, FOCAL = 900, 4000, 3000, 3000.0
NEAR_M, RING, GRID = 0.05, 100, 12
# Parts, and what does them.
PARTS = {
    "copies": ((prepare, "write_photos"), (ingest, "ingest")),
    "features": ((mapping, "extract"),),
    "matching": ((mapping, "match"),),
    "poses": ((mapping, "_map"), (correction.Search, "fewest")),
    "again": ((readjustment, "refine"),),
    "export": ((command, "write"), (prepare, "write_views")),
}
LINE = "of a case: "


def texture(seed, width, height):
    """uint8 [h, w, 3]: noise of all scales, and random shapes."""
    rng, image = np.random.default_rng(seed), np.full((height, width, 3), 125, np.int16)
    for px, strength in ((900, 35), (225, 30), (56, 25), (14, 20), (4, 12)):
        size = (height // px + 2, width // px + 2, 3)
        small = rng.normal(scale=strength, size=size).astype(np.float32)
        image += cv2.resize(small, (width, height)).astype(np.int16)
    image = np.clip(image, 0, 255).astype(np.uint8)
    for _ in range(width * height // 20_000):
        colour = tuple(map(int, rng.integers(0, 255, 3)))
        x, y, r = (int(rng.integers(high)) for high in (width, height, 50))
        if r % 2:
            cv2.circle(image, (x, y), r // 2 + 3, colour, -1, cv2.LINE_AA)
        else:
            corners = np.array([x, y]) + rng.integers(-r - 4, r + 5, (4, 2))
            cv2.fillPoly(image, [corners.astype(np.int32)], colour, cv2.LINE_AA)
    return image


def faces():
    """[(corner, its two sides in metres, outward normal, texture)], the room first."""
    found = []
    for number, (low, high) in enumerate([ROOM, *BOXES]):
        for axis in range(3):
            for side in range(2):
                u, v = np.diag(high - low)[[a for a in range(3) if a != axis]]
                corner, normal = low.copy(), np.zeros(3)
                corner[axis] = (low, high)[side][axis]
                normal[axis] = (-1, 1)[side] * (1 if number else -1)
                size = [int(PX_PER_M * np.linalg.norm(one)) for one in (u, v)]
                image = texture([number, axis, side], *size)
                found.append((number, corner, u, v, normal, image))
    return found


def draw(surfaces, pose):
    """The photo [HEIGHT, WIDTH, 3] of a camera: [3, 4] to the world, OpenCV's axes."""
    turn, centre = pose[:, :3], pose[:, 3]
    camtopix = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
    away = [0, *np.linalg.norm(BOXES.mean(axis=1) - centre, axis=1)]
    photo = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    order = sorted(surfaces, key=lambda one: (one[0] > 0, -away[one[0]]))
    for _, corner, u, v, normal, image in order:
        if normal @ (centre - corner) <= 0:
            continue
        shape = clipped([corner, corner + u, corner + u + v, corner + v], turn, centre)
        if len(shape) < 3:
            continue
        pixels = shape @ camtopix.T
        outline = np.clip(pixels[:, :2] / pixels[:, 2:], -1e6, 1e6)
        mask = np.zeros((HEIGHT, WIDTH), np.uint8)
        cv2.fillConvexPoly(mask, np.round(16 * (outline - 0.5)).astype(int), 1, shift=4)
        x, y, width, height = cv2.boundingRect(mask)
        if not width:
            continue
        # Texture px -> photo px, pixel centres at whole numbers in both.
        across = np.array([u / image.shape[1], v / image.shape[0]])
        start = corner - centre + across.sum(axis=0) / 2
        to_photo = camtopix @ turn.T @ np.stack([*across, start], axis=1)
        to_part = np.array([[1, 0, -x - 0.5], [0, 1, -y - 0.5], [0, 0, 1]]) @ to_photo
        part = cv2.warpPerspective(
            image, to_part, (width, height), borderMode=cv2.BORDER_REPLICATE
        )
        at = slice(y, y + height), slice(x, x + width)
        cv2.copyTo(part, mask[at], photo[at])
    return photo


def clipped(corners, turn, centre):
    """Corners [k, 3] in the camera's axes of what is in front of it."""
    each, kept = [(one - centre) @ turn for one in corners], []
    for one, following in zip(each, [*each[1:], each[0]], strict=True):
        if one[2] > NEAR_M:
            kept.append(one)
        if (one[2] > NEAR_M) != (following[2] > NEAR_M):
            share = (NEAR_M - one[2]) / (following[2] - one[2])
            kept.append(one + share * (following - one))
    return np.array(kept).reshape(-1, 3)


def rings(count):
    """Poses [n, 3, 4], OpenCV's axes: around the boxes, a ring for every RING of them.

    They follow one another as somebody walks.
    """
    found, several = [], -(-count // RING)
    for i in range(count):
        ring, place = divmod(i * several / count, 1)
        a = 2 * np.pi * place
        height = 1.35 + 0.2 * np.sin(2.3 * a) + 0.5 * (ring - (several - 1) / 2)
        radius = 2.2 + 0.2 * np.sin(3 * a)
        centre = np.array([radius * np.cos(a), radius * np.sin(a), height])
        z = [0.1 * np.cos(5 * a), 0.1 * np.sin(4 * a), 0.6] - centre
        z /= np.linalg.norm(z)
        x = np.cross(z, [0, 0, 1.0])
        x /= np.linalg.norm(x)
        found.append(np.stack([x, np.cross(z, x), z, centre], axis=1))
    return np.array(found)


def true_cameras(count, width):
    """Names, `camtopix` and OpenGL's `camtoworlds` of the photos of a case."""
    ratio, poses = width / WIDTH, rings(count)
    size = np.array([WIDTH, HEIGHT]) * ratio / 2
    camtopix = np.array([[FOCAL * ratio, 0, size[0]], [0, FOCAL * ratio, size[1]]])
    camtopix = np.tile([*camtopix, [0, 0, 1]], (count, 1, 1))
    poses[:, :, :3] = poses[:, :, :3] @ cameras.OPENGL_FROM_OPENCV
    names = [f"{i:04d}" for i in range(count)]
    return SimpleNamespace(names=names, camtopix=camtopix, camtoworlds=poses)


def off(true, width):
    """Poses that are OFF_PX off."""
    rng, px = np.random.default_rng(0), OFF_PX * width / 1600
    return cameras.perturb_poses(
        true.camtoworlds, np.linalg.inv(true.camtopix), px, rng
    )


def write_capture(folder, count, width, given):
    """Write the photos of a case, which others share, and maybe its cameras."""
    true, photos = true_cameras(count, width), folder.parent / f"{count}_{width}"
    if not photos.is_dir():
        partial = photos.with_suffix(".part")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        surfaces, poses = faces(), rings(count)
        for name, pose in progress.over(
            list(zip(true.names, poses, strict=True)), "drawn", unit="photo"
        ):
            photo = prepare.shrink(draw(surfaces, pose), width, width * HEIGHT // WIDTH)
            cv2.imwrite(f"{partial}/{name}.jpg", photo, [cv2.IMWRITE_JPEG_QUALITY, 92])
        partial.rename(photos)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for path in photos.iterdir():
        os.link(path, folder / path.name)
    if not given:
        return
    lens = true.camtopix[0]
    keys = ("fl_x", "fl_y", "cx", "cy", "w", "h")
    values = (*np.diag(lens)[:2], *lens[:2, 2], width, width * HEIGHT // WIDTH)
    told = dict(zip(keys, map(float, values), strict=True))
    told["frames"] = [
        {"file_path": f"{name}.jpg", "transform_matrix": [*pose.tolist(), [0, 0, 0, 1]]}
        for name, pose in zip(true.names, off(true, width), strict=True)
    ]
    (folder / "transforms.json").write_text(json.dumps(told))


def errors_px(true, names, camtopix, camtoworlds):
    """[k] pose errors of some of a case's views, in px of the photo."""
    at = [true.names.index(name) for name in names]
    own = SimpleNamespace(camtopix=true.camtopix[at], camtoworlds=true.camtoworlds[at])
    now = SimpleNamespace(camtopix=camtopix, camtoworlds=camtoworlds)
    points = {view: surface(own, view) for view in range(len(at))}
    # What is measured is the truth's place in the frame that was found, not its own.
    return np.array(list(pose_error.distance_px(now, own, points).values()))


def surface(own, view):
    """[k, 3] of the room and the boxes, on a grid of a view's pixels."""
    lens, pose = own.camtopix[view], own.camtoworlds[view]
    steps = [(np.arange(GRID) + 0.5) / GRID * 2 * side for side in lens[:2, 2]]
    pixels = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2)
    pixels = np.concatenate([pixels, np.ones((len(pixels), 1))], axis=1)
    turn = pose[:, :3] @ cameras.OPENGL_FROM_OPENCV
    rays = pixels @ np.linalg.inv(lens).T @ turn.T
    depth = np.full(len(rays), np.inf)
    for number, bounds in enumerate([ROOM, *BOXES]):
        planes = (bounds[:, None] - pose[:, 3]) / rays
        near, far = planes.min(axis=0).max(axis=1), planes.max(axis=0).min(axis=1)
        seen = (near < far) & (far > 0)
        depth = np.where(seen, np.minimum(depth, near if number else far), depth)
    return pose[:, 3] + depth[:, None] * rays


def cpu_s():
    """Of this process, and of those that it has started and that have ended."""
    each = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in each)


@contextlib.contextmanager
def timed(spent):
    """Add to spent {part: [wall, CPU]} what each of PARTS takes, within a block."""
    active = []

    def watched(part, function):
        def call(*args, **options):
            # Of parts within parts, the outer one counts.
            if active:
                return function(*args, **options)
            active.append(part)
            started = time.perf_counter(), cpu_s()
            try:
                return function(*args, **options)
            finally:
                active.pop()
                spent[part][0] += time.perf_counter() - started[0]
                spent[part][1] += cpu_s() - started[1]

        return call

    with contextlib.ExitStack() as undone:
        for part, places in PARTS.items():
            for module, name in places:
                own = getattr(module, name)
                setattr(module, name, watched(part, own))
                undone.callback(setattr, module, name, own)
        yield


def run(work, count, width, given):
    """The row of one case, which runs in this process."""
    name = f"{'given' if given else 'none'}_{count}_{width}"
    folder = work / name
    write_capture(folder, count, width, given)
    true, out = true_cameras(count, width), work / "results" / name
    shutil.rmtree(out, ignore_errors=True)
    out.parent.mkdir(exist_ok=True)
    spent = {part: [0.0, 0.0] for part in PARTS}
    started = time.perf_counter(), cpu_s()
    os.chdir(work)
    logging.basicConfig(level=logging.INFO)
    with timed(spent):
        if given:
            command.main([str(folder)])
        else:
            keys = {"source": "photos", "path": str(folder), "downscale": "auto"}
            stage.main(of_scenes.checked(keys), out)
    took = time.perf_counter() - started[0], cpu_s() - started[1]
    row = {"photos": count, "width": width, "cameras": "given" if given else "none"}
    row |= {"wall_s": round(took[0]), "cpu_s": round(took[1])}
    for part, (wall, cpu) in spent.items():
        row |= {f"{part}_s": round(wall, 1), f"{part}_cpu_s": round(cpu, 1)}
    row["peak_gb"] = round(machine.peak_bytes() / 1e9, 2)
    before = errors_px(true, true.names, true.camtopix, off(true, width))
    row["given_px"] = round(float(np.median(before)), 3) if given else ""
    after = errors_px(true, *found_in(out, given, width))
    told = round(float(np.median(after)), 3), round(float(after.max()), 3)
    return (
        row
        | dict(zip(("left_px", "left_worst_px"), told, strict=True))
        | {"registered": len(after)}
    )


def found_in(out, given, width):
    """(names, camtopix, camtoworlds) that a case has written."""
    if given:
        told = json.loads((out / "adjusted" / "transforms.json").read_text())
        frames = told["frames"]
        poses = [one["transform_matrix"][:3] for one in frames]
        lenses = [[one.get(key, told.get(key)) for key in KEYS] for one in frames]
        matrices = [[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] for fx, fy, cx, cy in lenses]
        names = [Path(one["file_path"]).stem for one in frames]
        return names, np.array(matrices), np.array(poses)
    keys = ("names", "pixtocams", "camtoworlds", "width")
    arrays = archives.read(out / "cameras.npz", keys)
    poses_json = json.loads((out / "poses.json").read_text())
    scale = np.diag([poses_json["photo_width"] / int(arrays["width"])] * 2 + [1])
    camtopix = scale @ np.linalg.inv(arrays["pixtocams"])
    return arrays["names"].tolist(), camtopix, arrays["camtoworlds"]


KEYS = ("fl_x", "fl_y", "cx", "cy")


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("work", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--cases", nargs="+", help="such as given_50_4000: of all")
    parser.add_argument("--machine", default="two cores of x86-64, no accelerator")
    parser.add_argument("--one", help="print the row of one case; runs in here")
    args = parser.parse_args(argv)
    args.work.mkdir(parents=True, exist_ok=True)
    work = args.work.absolute()
    if args.one:
        kind, count, width = args.one.split("_")
        row = run(work, int(count), int(width), kind == "given")
        print(LINE + json.dumps(row), flush=True)
        return
    cases = [f"{kind}_{n}_{px}" for n, px in CASES for kind in ("given", "none")]
    if not args.out.is_file():
        said = f"python -m tools.bench.poses_costs WORK --out {args.out.name}"
        args.out.write_text(measure.head(said, args.machine) + "cameras\n")
    kept = args.out.read_text().splitlines(keepends=True)
    head = "".join(line for line in kept if line[0] == "#")
    rows = pd.read_csv(args.out, comment="#").to_dict("records")
    there = [f"{row['cameras']}_{row['photos']}_{row['width']}" for row in rows]
    for name in args.cases or cases:
        if name not in there:
            words = [sys.executable, "-m", "tools.bench.poses_costs", str(work)]
            done = subprocess.run(
                [*words, "--one", name], check=True, stdout=subprocess.PIPE, text=True
            )
            (found,) = (x for x in done.stdout.splitlines() if x.startswith(LINE))
            rows.append(json.loads(found.removeprefix(LINE)))
            args.out.write_text(head + pd.DataFrame(rows).to_csv(index=False))
            print(rows[-1], flush=True)


if __name__ == "__main__":
    main()
