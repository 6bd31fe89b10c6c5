"""Folders as users have them, each file in them damaged in every way.

Stage `poses` has to refuse it in one line, or to make a scene that loads: the same as
before, or with a word on what was left out.
"""

import json
import shutil
import sys

import numpy as np
from PIL import Image

from alignerf.scenes import prepared
from tools.torture import damage, running, stages

SOURCES = ("transforms", "mipnerf360", "llff", "blender", "photos")
VIEWS, SIZE = 10, (48, 36)
# Ways of a folder of photos besides those of its files.
BYTES_NAME = b"caf\xe9.png"


def make(source, chain, folder):
    """A capture of a kind, in a folder, from the export of a finished chain."""
    scene = next((chain / "results").glob("*/cameras.npz")).parent
    found = next(scene.glob("*/export/cameras"))
    shutil.copytree(found / "images", folder / "images")
    if source == "transforms":
        shutil.copy(found / "transforms.json", folder)
    if source == "mipnerf360":
        shutil.copytree(found / "sparse", folder / "sparse")
    if source == "llff":
        write_bounds(prepared.load(scene), folder / "poses_bounds.npy")
    if source == "blender":
        write_blender(json.loads((found / "transforms.json").read_text()), folder)
    return folder / "images" if source == "photos" else folder


def write_bounds(scene, path):
    """LLFF's rows of a scene's cameras, whose lens has no distortion."""
    rows = []
    for pixtocam, pose in zip(scene.pixtocams, scene.camtoworlds, strict=True):
        right, up, back, centre = pose.T
        lens = [scene.height, scene.width, 1 / pixtocam[0, 0]]
        matrix = np.stack([-up, right, back, centre, lens], axis=1)
        rows.append([*matrix.ravel(), 1.0, 10.0])
    np.save(path, np.array(rows))


def write_blender(scene, folder):
    """NeRF's three files, a third of the frames in each."""
    lens = {"camera_angle_x": 1.2}
    for place, split in enumerate(("train", "val", "test")):
        frames = [
            {key: frame[key] for key in ("file_path", "transform_matrix")}
            for frame in scene["frames"][place::3]
        ]
        path = folder / f"transforms_{split}.json"
        path.write_text(json.dumps(lens | {"frames": frames}))


# Ways of their own.


def frames_without_end(data, rng):
    """200,000 frames whose image is not there, before those that are."""
    value = json.loads(data)
    frame = value["frames"][0]
    more = [frame | {"file_path": f"images/no{i}.png"} for i in range(200_000)]
    return json.dumps(value | {"frames": more + value["frames"]}).encode()


def with_number(key, value):
    def apply(data, rng):
        return json.dumps(json.loads(data) | {key: value}).encode()

    return damage.rewritten(apply)


def with_entry(row, column, value):
    def apply(data, rng):
        found = json.loads(data)
        found["frames"][1]["transform_matrix"][row][column] = value
        return json.dumps(found).encode()

    return damage.rewritten(apply)


def with_path(path):
    def apply(data, rng):
        found = json.loads(data)
        found["frames"][1]["file_path"] = path
        return json.dumps(found).encode()

    return damage.rewritten(apply)


FRAMES_WAYS = {
    "200,000 frames without images": damage.rewritten(frames_without_end),
    **{
        f"{key} = {value:.0e}": with_number(key, value)
        for key in ("fl_x", "cx", "w", "k1")
        for value in (1e300, 1e-300, -1.0, 0.0)
        if (key, value) not in (("k1", 0.0), ("k1", 1e-300))
    },
    "a number of 400 digits": with_number("fl_x", 10**400),
    "a position of 1e300": with_entry(0, 3, 1e300),
    "a rotation of 400 digits": with_entry(0, 0, 10**400),
    "a mirrored camera": with_entry(0, 0, -5.0),
    **{
        f"an image at {name!r}": with_path(name)
        for name in ("../../x.png", "/etc/passwd", "", ".", "\0", "a" * 5000, "images")
    },
}


def bin_of(count):
    return damage.rewritten(
        lambda data, rng: int(count).to_bytes(8, "little") + data[8:]
    )


BIN_WAYS = {"2^60 entries": bin_of(2**60), "no entry": bin_of(0)}


def rows_changed(change):
    def apply(path, rng):
        rows = np.load(path)
        with open(path, "wb") as file:
            np.save(file, change(rows))
        return True

    return apply


def with_cell(column, value):
    def change(rows):
        rows[2, column] = value
        return rows

    return rows_changed(change)


NPY_WAYS = {
    "a row less": rows_changed(lambda rows: rows[:-1]),
    "a column less": rows_changed(lambda rows: rows[:, 1:]),
    "no rows": rows_changed(lambda rows: rows[:0]),
    "complex": rows_changed(lambda rows: rows.astype(complex)),
    "text": rows_changed(lambda rows: rows.astype(str)),
    "NaN": with_cell(3, np.nan),
    "a focal length of 1e300": with_cell(14, 1e300),
    "a focal length of 0": with_cell(14, 0.0),
    "a position of 1e300": with_cell(3, 1e300),
    "a mirrored camera": with_cell(0, 9.0),
    "a height of 1": with_cell(4, 1.0),
}


def beside(name, content):
    """A file more in the folder of photos."""

    def apply(path, rng):
        target = path.parent / name
        if content is None:
            target.symlink_to(target.name)
        elif content == "folder":
            target.mkdir()
        else:
            target.write_bytes(content)
        return True

    return apply


def of_bytes(path, rng):
    """A photo whose name is no UTF-8."""
    (path.parent / BYTES_NAME.decode(errors="surrogateescape")).write_bytes(
        path.read_bytes()
    )
    return True


def transparent(path, rng):
    """Something lies behind, and nobody says what."""
    Image.fromarray(np.full((*SIZE[::-1], 4), 9, np.uint8)).save(path)
    return True


PHOTO_WAYS = {
    "a looping link beside": beside("loop.png", None),
    "a folder named like a photo": beside("folder.png", "folder"),
    "a text named like a photo": beside("text.jpg", b"hello"),
    "an empty film": beside("film.mp4", b""),
    "a broken HEIC": beside("a.heic", b"\0\0\0\x18ftypheic" + bytes(99)),
    "a name that is no UTF-8": of_bytes,
    "transparent": transparent,
}


def cases(source, folder):
    """(path of the file, name of the way, way) of all that can be done to a capture."""
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    photos = [p for p in files if p.suffix == ".png"]
    for path in [p for p in files if p not in photos] + photos[1:2]:
        ways = damage.ANY_WAYS | {
            ".json": damage.JSON_WAYS | FRAMES_WAYS,
            ".bin": BIN_WAYS,
            ".npy": NPY_WAYS,
            ".png": damage.PNG_WAYS | PHOTO_WAYS,
        }.get(path.suffix, {})
        for name, way in ways.items():
            yield path.relative_to(folder), name, way


def attack(source, path, way, chain, place, rng, *, run=running.run):
    """(finding or None, Ended) of one damage; (None, None) where it does not apply."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    capture = make(source, chain, place / "capture")
    if not way(place / "capture" / path, rng):
        return None, None
    ended = pose(source, capture, place, run)
    names = [path.name, path.stem, path.parent.name, "capture", *keys_of(place)]
    if ended.code == 0:
        return of_accepted(ended, place, names), ended
    if left := stages.hidden(place):
        return f"left {min(left)} behind", ended
    return running.fault_of(ended, names), ended


def pose(source, capture, place, run=running.run):
    """Stage `poses` of a capture."""
    scene = {"source": source, "path": str(capture.relative_to(place))}
    if source == "blender":
        scene["background"] = "white"
    command = [sys.executable, "-m", "alignerf.poses", "--config", json.dumps(scene)]
    return run([*command, "--out", "results/scene"], place)


def keys_of(place):
    """Keys that a refusal may give instead of the file."""
    return ["file_path", "transform_matrix", "fl_x", "frames", "overlap", "registered"]


def of_accepted(ended, place, names):
    """What is wrong with a scene that was made of a damaged capture."""
    if ended.peak_mib > running.MAX_MIB or ended.time_s > 3 * running.MAX_S:
        return f"{ended.time_s:.0f} s, {ended.peak_mib:.0f} MiB"
    try:
        found = prepared.load(place / "results" / "scene")
    except ValueError as error:
        return f"made what does not load: {error}"[:120]
    if len(found.names) == VIEWS:
        return None
    said = any(name in ended.output for name in [*names, "COLMAP", "left out"])
    return None if said else f"{len(found.names)} of {VIEWS} views, and no word of it"
