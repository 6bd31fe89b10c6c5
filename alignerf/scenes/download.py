"""A scene of mip-NeRF 360, fetched: `python -m alignerf.scenes.download 360_v2/garden`.

curl fetches its archive (12 or 4 GB) beside the scene's folder, as NAME.fetched, and
goes on where it has stopped. The archive is gone once all its scenes are there. One
that a user has put there is taken, and stays.
"""

import argparse
import hashlib
import os
import subprocess
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from alignerf.experiment.checks import fetched
from alignerf.io import atomic, faults, progress

BUCKET = "https://storage.googleapis.com/gresearch/refraw360"
# Bytes, and the MD5 that the bucket gives: no SHA-256 is published, and of the second
# archive no hash at all.
ARCHIVES = {
    "360_v2.zip": (12_535_427_936, "cef2ef3aeaf0c062dbe65130bc249870"),
    "360_extra_scenes.zip": (4_488_140_217, None),
}
CURL = "curl --fail --location --proto =https --continue-at - --progress-bar --output"
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
    found = [name for name in ARCHIVES if scene.name in fetched.ARCHIVES[name]]
    if not found:
        raise ValueError(f"{scene}: {scene.name} is no scene of mip-NeRF 360")
    if not os.path.lexists(scene):
        print(LICENCE, flush=True)
        bring(scene, *found)


def bring(scene, name):
    """Fetch the archive of a scene and unpack it."""
    folder = scene.parent
    folder.mkdir(parents=True, exist_ok=True)
    path = fetch(folder / name, *ARCHIVES[name])
    with atomic.scratch_folder(folder) as scratch:
        unpack(path, scene.name, scratch)
        (scratch / scene.name).rename(scene)
    others = (os.path.lexists(folder / other) for other in fetched.ARCHIVES[name])
    if path.name != name and all(others):
        path.unlink()


def fetch(path, size, md5):
    """Path of an archive, a user's own or fetched; ValueError where it is another."""
    if not os.path.lexists(path):
        url, own = f"{BUCKET}/{path.name}", path
        path = path.with_name(f"{path.name}.fetched")
        if path.is_symlink():
            raise ValueError(f"{path}: a link, and nothing is written through one")
        # Of a whole file a server refuses to send more.
        if not path.exists() or path.stat().st_size < size:
            try:
                subprocess.run([*CURL.split(), path, url], check=True)
            except (OSError, subprocess.CalledProcessError) as error:
                code = getattr(error, "returncode", None)
                why = f"curl ended with {code}" if code else f"curl: {error.strerror}"
                raise ValueError(
                    f"{url}: {why}: the same command goes on from there; or fetch it "
                    f"by other means and put it to {own}"
                ) from None
    with faults.opened(path) as file:
        if path.stat().st_size != size or (
            md5 and hashlib.file_digest(file, "md5").hexdigest() != md5
        ):
            raise ValueError(f"{path}: not as published: delete it, and run this again")
    return path


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
