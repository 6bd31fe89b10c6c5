"""mip-NeRF 360's scenes, fetched: `python -m alignerf.scenes.download FOLDER`.

FOLDER is called 360_v2: each scene becomes a folder in it. The archives are fetched
beside the scenes (17 GB; 35 GB while they are unpacked) and are gone afterwards. A
stopped download goes on, a scene that is there is left alone. An archive that lies in
FOLDER already, fetched by other means, is taken.
"""

import argparse
import zipfile
from pathlib import Path, PurePosixPath

from alignerf.experiment.checks import fetched
from alignerf.io import atomic, downloads, faults, progress

BUCKET = "https://storage.googleapis.com/gresearch/refraw360"
# No SHA-256 of them is published. The MD5 is the one that the bucket gives; of the
# second archive none was found. Each file inside has a CRC-32, checked as it is read.
ARCHIVES = (
    downloads.Published(
        f"{BUCKET}/360_v2.zip",
        12_535_427_936,
        "cef2ef3aeaf0c062dbe65130bc249870",
        "md5",
    ),
    downloads.Published(f"{BUCKET}/360_extra_scenes.zip", 4_488_140_217, None),
)
LICENCE = (
    "mip-NeRF 360's photos (Barron et al., CVPR 2022): no licence is published with "
    "them; https://jonbarron.info/mipnerf360 says whom to ask"
)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    folder = parser.parse_args(argv).folder
    print(LICENCE, flush=True)
    folder.mkdir(parents=True, exist_ok=True)
    for published in ARCHIVES:
        names = fetched.ARCHIVES[published.name]
        missing = [name for name in names if not (folder / name).exists()]
        if missing:
            bring(published, missing, folder)


def bring(published, names, folder):
    """Fetch an archive and unpack these scenes of it."""
    path = folder / published.name
    try:
        downloads.fetch(published, folder)
    except ValueError as error:
        if not (path.exists() and path.stat().st_size == published.size):
            raise ValueError(
                f"{error}: fetch it by other means and put it to {path}, or its scenes "
                f"to {folder / names[0]} and so on"
            ) from None
    try:
        downloads.check(path, published)
    except ValueError as error:
        raise ValueError(f"{error}: delete it, and run this again") from None
    for name in names:
        with atomic.scratch_folder(folder) as scratch:
            unpack(path, name, scratch)
            (scratch / name).rename(folder / name)
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
    except zipfile.BadZipFile as error:
        raise ValueError(f"{path}: {error}: delete it and fetch it again") from None


if __name__ == "__main__":
    faults.run(main)
