"""Public captures as folders of photos, fetched from the repositories that have them.

    python -m tools.bench.captures results/captures [--only beer ...] [--mirror FOLDER]

`captures.yaml` names them. NAME/images gets a capture's photos, upright and at most
MAX_PX long, or, where its cameras were surveyed, photos as `raw_captures` reads them
beside a transforms.json. What is there is not fetched again. A mirror has the
repository OWNER/NAME in OWNER+NAME/repo; else GitHub is asked.
"""

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

import yaml
from PIL import Image, ImageOps

from alignerf.io import atomic

LISTED = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text())
# Which release of the rules held-out captures are to be looked at with.
RELEASE, EVERY = LISTED["release"], LISTED["captures"]
ROLES = DEVELOPMENT, HELD_OUT = "development", "held_out"
MAX_PX, QUALITY = 1024, 95
PHOTOS = (".jpg", ".jpeg", ".png")
# A mirror may hold only the blobs that were taken from it.
SERVED = "git -c uploadpack.allowFilter=true upload-pack"


def main(argv=None):
    public = [name for name, own in EVERY.items() if "folder" in own]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", nargs="+", choices=public, default=public)
    parser.add_argument("--mirror", type=Path)
    args = parser.parse_args(argv)
    for name in args.only:
        if (args.out / name).is_dir():
            continue
        fetch(EVERY[name], args.out / name, args.mirror)
        print(f"{name}: {len(list((args.out / name / 'images').iterdir()))} photos")


def of(role):
    """The names of the captures that have a role."""
    return {name for name, own in EVERY.items() if own["role"] == role}


def own(name):
    """The causes that are known to be true of a capture as it is."""
    return [*EVERY.get(name, {}).get("own", {})]


def check_for_development(names):
    """Refuse captures that no rule is to be made with."""
    if held_out := sorted(of(HELD_OUT) & {*names}):
        raise SystemExit(f"held out, for tools.bench.heldout: {', '.join(held_out)}")


def fetch(capture, out, mirror=None):
    """Write the folder of a capture of `captures.yaml`; ValueError where git cannot."""
    from tools.bench import heldout_poses, raw_captures

    repository, commit = capture["from"].split("@")
    url = f"https://github.com/{repository}.git"
    if mirror:
        url = str((mirror / repository.replace("/", "+") / "repo").resolve())
    with tempfile.TemporaryDirectory() as work:
        git(work, "init --quiet")
        git(work, "remote add origin", url)
        if mirror:
            git(work, "config remote.origin.uploadpack", SERVED)
        git(work, "fetch --quiet --depth 1 --filter blob:none origin", commit)
        listed = git(work, "ls-tree -r -z --name-only", commit).split("\0")
        paths = chosen(listed, capture["folder"], capture["photos"])
        cameras = capture.get("cameras")
        survey = [path for path in listed if cameras and path.startswith(cameras)]
        those = "checkout --pathspec-from-file=- --pathspec-file-nul"
        git(work, those, commit, told="\0".join([*paths, *survey]))
        with atomic.replace_folder(out) as made:
            if cameras:
                read = raw_captures.read(Path(work, cameras).parent)
                heldout_poses.write_scan(Path(made), read)
                return
            (Path(made) / "images").mkdir(parents=True)
            for path in paths:
                photo = upright(Path(work, path))
                place = Path(made, "images", Path(path).stem).with_suffix(".jpg")
                photo.save(place, quality=QUALITY)


def git(folder, words, *more, told=None):
    """What git prints; ValueError with the last line of what it complains of."""
    command = ["git", "-C", str(folder), *words.split(), *more]
    literal = os.environ | {"GIT_LITERAL_PATHSPECS": "1", "GIT_TERMINAL_PROMPT": "0"}
    done = subprocess.run(
        command, input=told, env=literal, capture_output=True, text=True
    )
    if done.returncode:
        said = (done.stderr.strip().splitlines() or [""])[-1]
        raise ValueError(f"git {words} {' '.join(more)}: {said}")
    return done.stdout


def chosen(listed, folder, photos):
    """Paths of photos directly in a folder: a slice of them by name, or those named."""
    of_folder = sorted(
        path
        for path in listed
        if str(Path(path).parent) == folder and path.lower().endswith(PHOTOS)
    )
    if ":" in photos:
        bounds = [int(bound) if bound else None for bound in photos.split(":")]
        return of_folder[slice(*bounds)]
    by_name = {Path(path).stem: path for path in of_folder}
    if missing := [name for name in photos.split() if name not in by_name]:
        raise ValueError(f"{folder}: no photo {', '.join(missing)}")
    return [by_name[name] for name in photos.split()]


def upright(path):
    """A photo as it is looked at, no side longer than MAX_PX."""
    with Image.open(path) as image:
        photo = ImageOps.exif_transpose(image).convert("RGB")
    scale = MAX_PX / max(photo.size)
    if scale >= 1:
        return photo
    size = tuple(round(side * scale) for side in photo.size)
    return photo.resize(size, Image.Resampling.LANCZOS)


if __name__ == "__main__":
    main()
