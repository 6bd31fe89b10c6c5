"""Record3D, exported as EXR + JPG, or an .r3d unpacked: metadata and rgb/<n>.jpg.

`metadata.json` (of an .r3d `metadata`, beside rgbd/) has `poses`, one [qx, qy, qz, qw,
tx, ty, tz] a frame: ARKit's camera-to-world of the photo as it is stored, which is
upright where the phone was. `K` [9] stands column by column. Newer ones have
`perFrameIntrinsicCoeffs`, one [fx, fy, cx, cy] a frame: a phone's focal length changes
as it focuses. Both are of photos of `w` x `h`. Axes and order as instant-ngp's
scripts/record3d2nerf.py and nerfstudio's record3d_utils.py have them.

It is a film of many frames: some are taken, evenly. Videos by the front camera
have no poses.
"""

import logging
from pathlib import Path

from alignerf.captures import posed
from alignerf.io import faults, json_files

log = logging.getLogger(__name__)

METADATA, PHOTOS = ("metadata.json", "metadata"), ("rgb", "rgbd")
DEPTH = "depth"
KINDS = {
    "poses": [json_files.vector(7)],
    **dict.fromkeys("wh", json_files.OrNone(json_files.positive)),
    "K": json_files.OrNone(json_files.vector(9)),
    "perFrameIntrinsicCoeffs": json_files.OrNone([json_files.vector(4)]),
}


class Record3d(posed.App):
    name = "record3d"
    order = 7
    what = "Record3D's EXR + JPG"

    def detect(self, folder):
        # Other programs have such folders and a file of this name, too.
        path = first_of(folder, METADATA)
        if first_of(folder, (*PHOTOS, DEPTH)) is None or not (path and path.is_file()):
            return False
        return b'"poses"' in faults.content(path, faults.MAX_BYTES)

    def check(self, folder):
        numbered_photos(folder)

    def photos_of(self, folder):
        return {name_of(number): path for number, path in chosen(folder).items()}

    def read_given(self, scene):
        from alignerf.readers import shots

        folder = scene.path
        frames, path = chosen(folder), first_of(folder, METADATA)
        if path is None:
            raise ValueError(f"{folder}: no metadata.json: it has Record3D's poses")
        content = json_files.read(path, KINDS)
        poses, sides = content["poses"], [content.get(key) for key in "wh"]
        left_out = [name_of(number) for number in frames if number >= len(poses)]
        if len(left_out) == len(frames):
            raise ValueError(f"{path}: poses: {len(poses)}, none of a photo")
        if left_out:
            log.warning("%s: no pose of %s", path, faults.some_names(left_out))
        found = [
            shots.Shot(
                name_of(number),
                lens_of(path, content, number),
                pose_of(poses[number]),
                tuple(map(float, sides)) if all(sides) else None,
                photo=photo,
            )
            for number, photo in frames.items()
            if number < len(poses)
        ]
        shots.check_apart(found, path)
        own = shots.cameras(path, found)
        return shots.views_of(own, masks=scene.masks), left_out


def first_of(folder, names):
    """The first of these names that is there, else None."""
    paths = [Path(folder) / name for name in names]
    return next((path for path in paths if path.exists()), None)


def numbered_photos(folder):
    """{number of the frame: path} of all photos; ValueError where there are none."""
    inner = first_of(folder, PHOTOS)
    if inner is None:
        raise ValueError(f"{folder}: no rgb/<n>.jpg beside Record3D's metadata")
    from alignerf.readers import shots

    found = {}
    for stem, path in shots.photos_in(inner).items():
        if not (stem.isascii() and stem.isdecimal() and len(stem) < 10):
            named = faults.name_of(path.name)
            raise ValueError(f"{inner}: {named}: its name is no frame's number")
        if int(stem) in found:
            raise ValueError(f"{inner}: two photos of frame {int(stem)}")
        found[int(stem)] = path
    if not found:
        raise ValueError(f"{inner}: no <n>.jpg")
    return dict(sorted(found.items()))


def chosen(folder):
    """{number: path} of the frames that are taken, as of `shots.evenly`."""
    from alignerf.readers import shots

    return dict(shots.evenly(list(numbered_photos(folder).items()), folder))


def name_of(number):
    """The name of a frame's view; names are in the order of the frames."""
    return f"{number:06d}"


def lens_of(path, content, number):
    """The lens of a frame: its own, else that of all."""
    import numpy as np

    from alignerf.readers import shots

    own = content.get("perFrameIntrinsicCoeffs")
    # Of another number of frames they are none of these.
    if own and len(own) == len(content["poses"]):
        return shots.lens(f"{path}: frame {number}", "PINHOLE", own[number])
    if content.get("K") is None:
        raise ValueError(f"{path}: no K in it")
    columns = np.array(content["K"], np.float64).reshape(3, 3)
    if not np.allclose(columns[[0, 1, 0, 1, 2], [1, 0, 2, 2, 2]], [0, 0, 0, 0, 1]):
        raise ValueError(f"{path}: K is not fx 0 0, 0 fy 0, cx cy 1")
    params = columns[[0, 1, 2, 2], [0, 1, 0, 1]]
    return shots.lens(f"{path}: K", "PINHOLE", params)


def pose_of(values):
    """Camera-to-world [3, 4] of a frame's seven numbers."""
    import numpy as np

    from alignerf.readers import shots

    values = np.array(values, np.float64)
    return np.concatenate([shots.rotation_of(values[:4]), values[4:, None]], axis=-1)


CAPTURE = Record3d()
