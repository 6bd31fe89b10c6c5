"""A scene of mip-NeRF 360, fetched: `python -m alignerf.scenes.download 360_v2/garden`.

Its archive (12 or 4 GB) is fetched beside the scene's folder, as NAME.fetched, and is
gone once all its scenes are there. One that a user has put there is taken, and stays. A
stopped download goes on.
"""

import argparse
import hashlib
import os
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from alignerf.experiment.checks import fetched
from alignerf.io import atomic, downloads, faults, progress

BUCKET = "https://storage.googleapis.com/gresearch/refraw360"
# No SHA-256 of them is published. The MD5 is the one that the bucket gives. Of the
# second archive none was found: the first one that a scene comes from is noted.
ARCHIVES = (
    downloads.Published(
        f"{BUCKET}/360_v2.zip",
        12_535_427_936,
        "cef2ef3aeaf0c062dbe65130bc249870",
        "md5",
    ),
    downloads.Published(f"{BUCKET}/360_extra_scenes.zip", 4_488_140_217, None),
)
MAX_NOTE = 1000
LICENCE = (
    "mip-NeRF 360's photos (Barron et al., CVPR 2022): no licence is published with "
    "them; https://jonbarron.info/mipnerf360 says whom to ask"
)
# What decoders raise of a damaged archive.
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path, metavar="360_v2/NAME")
    scene = parser.parse_args(argv).scene
    found = [one for one in ARCHIVES if scene.name in fetched.ARCHIVES[one.name]]
    if not found:
        raise ValueError(f"{scene}: {scene.name} is no scene of mip-NeRF 360")
    if not os.path.lexists(scene):
        print(LICENCE, flush=True)
        bring(scene, *found)


def bring(scene, published):
    """Fetch the archive of a scene and unpack it."""
    folder = scene.parent
    folder.mkdir(parents=True, exist_ok=True)
    try:
        path = downloads.fetch(published, folder)
    except ValueError as error:
        raise ValueError(
            f"{error}: the same command goes on from there; or fetch it by other means "
            f"and put it to {folder / published.name}, or the scene to {scene}"
        ) from None
    noted = folder / f"{published.name}.sha256"
    if published.hash is None and noted.is_file():
        wanted = faults.text(noted, MAX_NOTE).strip()
        published = published._replace(hash=wanted, kind="sha256")
    try:
        downloads.check(path, published)
    except ValueError as error:
        raise ValueError(f"{error}: delete it, and run this again") from None
    with atomic.scratch_folder(folder) as scratch:
        unpack(path, scene.name, scratch)
        (scratch / scene.name).rename(scene)
    if published.hash is None:
        with atomic.replace_file(noted) as note, faults.opened(path) as archive:
            note.write_text(hashlib.file_digest(archive, "sha256").hexdigest() + "\n")
    others = fetched.ARCHIVES[published.name]
    is_theirs = path.name == published.name
    if not is_theirs and all(os.path.lexists(folder / name) for name in others):
        path.unlink()


def unpack(path, name, folder):
    """Unpack a scene of an archive; ValueError where it is damaged."""
    try:
        with zipfile.ZipFile(path) as archive:
            inside = [
                info
                for info in archive.infolist()
                if PurePosixPath(info.filename).parts[:1] == (name,)
            ]
            if not inside:
                raise ValueError(f"{path}: no scene {name} in it")
            for info in progress.over(inside, f"unpacking {name}", unit="file"):
                # Which leaves out what would lead out of the folder.
                archive.extract(info, folder)
    except DAMAGED as error:
        raise ValueError(f"{path}: {error}: delete it, and run this again") from None


if __name__ == "__main__":
    faults.run(main)
