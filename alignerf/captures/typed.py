"""What users type for a folder of photos, taken for what it plainly means.

A file of a capture means its folder, COLMAP's sparse/0 the project above it, a folder
of one capture that one. What another program has trained, and what is packed, is
refused with the command that takes it, the user's own paths in it.
"""

import contextlib
import difflib
import logging
import os
import re
import shlex
import urllib.parse
from pathlib import Path

from alignerf.captures import base, photos
from alignerf.io import faults, provenance

log = logging.getLogger("alignerf")

PACKED = re.compile(r".*\.(zip|7z|rar|tar|tgz|tar\.\w+)", re.IGNORECASE)
WINDOWS = re.compile(r"([A-Za-z]):[\\/](.*)|\\\\.*", re.DOTALL)
ADDRESS = re.compile(r"(https?|ftp|s3|gs):/")
# Files and folders beside a trained model, and those of a project, which may hold one.
TRAINED = ("cfg_args", "point_cloud", "nerfstudio_models", "ckpts", "t*/ours_*")
PROJECT = ("images", "input", "sparse", "colmap", "transforms.json")
# Splats that are smaller than a .ply, and its beginnings: one of points has neither.
SMALLER = {".splat", ".ksplat", ".spz", ".sog"}
OF_SPLATS, HEAD_BYTES = (b"f_dc_0", b"packed_position"), 8192
# Folders that a system adds to what it packs.
SYSTEMS = {"__MACOSX", "@eaDir", "lost+found"}
# Folders of cameras, which lie in a project.
OF_CAMERAS = re.compile(
    r"\d+|sparse|colmap|dense|(un)?distorted|models?|keyframes|(corrected_)?cameras"
    r"|sfm|outputs?|glomap|reconstructions?|matches|bundle|opensfm|exports?"
)
# How many folders above and below are looked at, and of those below how many in all.
ABOVE, BELOW, MAX_FOLDERS = 3, 4, 2000


def at_home(text):
    """A path with `~` written out, as it is, where nothing is called otherwise.

    Else without quotes, with spaces that a shell has escaped, as a file manager's
    address, or a path of Windows as it is called under Linux there.
    """
    text = str(text)
    for one in (text, *readings(text)):
        if one and os.path.lexists(path := os.path.expanduser(one)):
            return Path(path)
    return Path(os.path.expanduser(text))


def readings(text):
    """Further ways to read what was typed."""
    bare = text.strip()
    if bare[:1] in ("'", '"') and bare[-1:] == bare[:1]:
        bare = bare[1:-1]
    yield bare
    yield os.path.expandvars(bare)
    if bare.startswith("file://"):
        yield urllib.parse.unquote(bare.removeprefix("file://"))
    yield re.sub(r"\\(.)", r"\1", bare)
    if (found := WINDOWS.fullmatch(bare)) and found[1]:
        bare = f"/mnt/{found[1].lower()}/{found[2]}"
    yield bare.replace("\\", "/")
    # All photos of a folder, which no shell has written out.
    if "*" in bare.rpartition("/")[2]:
        yield bare.rpartition("/")[0]


def meant(path, command="photos"):
    """The folder or film that a path means to a command; what is not the path is said.

    Raises ValueError in one line, with what to type, where it is neither.
    """
    path = at_home(path)

    def then(folder):
        return provenance.as_command(command, {"FOLDER": folder})

    if not path.exists():
        raise ValueError(missing(path))
    if not (path.is_file() or path.is_dir()):
        raise ValueError(f"{path}: neither a folder nor a file")
    found = of_file(path, then) if path.is_file() else of_folder(path, then)
    if found != path:
        log.info("%s: its folder is used: %s", path, found)
    return found


def missing(path):
    """That a path does not exist, and what there is instead."""
    if WINDOWS.fullmatch(str(path)):
        drive = str(path)[0].lower()
        return (
            f"{path}: a path of Windows, and this system is none: give the path that "
            f"it has here (under WSL: /mnt/{drive}/...)"
        )
    if ADDRESS.match(str(path)):
        return f"{path}: an address: download it first, and give the folder"
    try:
        there = [p.name for p in path.parent.iterdir() if p.exists()]
    except (OSError, ValueError):
        there = []
    alike = difflib.get_close_matches(path.name, there, 1)
    instead = f": {path.parent / alike[0]} does" if alike else ""
    return f"{path} does not exist{instead}"


def of_file(path, then):
    """The folder that a file means, or a film itself; `then` as of `unpacked`."""
    from alignerf.colmap import video
    from alignerf.scenes import photos as of_photos

    suffix = path.suffix.lower()
    if suffix in video.SUFFIXES:
        return path
    if suffix in of_photos.SUFFIXES:
        return path.parent
    if PACKED.fullmatch(path.name):
        return unpacked(path, then)
    if suffix in SMALLER or is_splat(path):
        raise ValueError(of_trained(path))
    check_within_trained(path)
    if (found := project_of(path.parent, alone=suffix == ".db")) is None:
        raise ValueError(
            f"{path}: neither a photo nor a video, nor cameras with photos beside "
            "them: give the folder of the photos"
        )
    return found


def of_folder(path, then):
    """The folder that has a capture, or captures in its folders; path, if none has."""
    if is_trained(path):
        raise ValueError(of_trained(path))
    if is_model(path) and base.detected(path) is None:
        if found := project_of(path):
            return found
        raise ValueError(
            f"{path}: COLMAP's model, without its photos: give the folder above, where "
            "they lie in images/ beside sparse/0"
        )
    if found := base.detected(path):
        if found.poses == photos.Photos.poses:
            if path.name.startswith(("images", "rgb")):
                tell_cameras_above(path)
            # Cameras may lie among the photos.
            inner = photos.inner_of(path)
            if inner != path and project_around(inner):
                return inner
        return path
    found, trained = captures_below(path)
    if not found:
        check_others(path, then)
    if trained and not found:
        raise ValueError(of_trained(trained[0]))
    if not found or found[0].parent == path:
        return path
    if len(found) > 1:
        several = faults.some_names(list(map(str, found)), at_most=8)
        raise ValueError(f"{path}: several captures are below, give one: {several}")
    return found[0]


def tell_cameras_above(folder):
    """Log that the folder above has cameras of these photos, which are not read."""
    above = folder / os.pardir if folder.name in ("", os.pardir) else folder.parent
    if project_around(above):
        log.warning(
            "%s: photos alone, whose poses come from COLMAP: give %s for the cameras "
            "that lie there",
            *(folder, above),
        )


def captures_below(path):
    """(folders below that are captures, those that are trained models).

    None of them lies within another one.
    """
    found, trained, level, seen = [], [], [path], 0
    for _ in range(BELOW):
        below = []
        for folder in level:
            inner = inner_of(folder)
            seen += len(inner)
            for one in inner if seen < MAX_FOLDERS else ():
                if is_trained(one):
                    trained.append(one)
                else:
                    (found if base.detected(one) else below).append(one)
        if found:
            break
        level = below
    return found, trained


def inner_of(folder):
    """The folders in a folder that a user has put there, sorted."""
    try:
        every = sorted(folder.iterdir())
    except PermissionError:
        return []
    own = (p for p in every if p.name[0] != "." and p.name not in SYSTEMS)
    return [path for path in own if path.is_dir()]


def check_others(folder, then):
    """ValueError for what is there in place of photos; `then` as of `unpacked`."""
    check_within_trained(folder)
    files = sorted(path for path in folder.iterdir() if path.is_file())
    for path in files:
        if PACKED.fullmatch(path.name):
            unpacked(path, then)
    for path in files:
        if path.suffix.lower() in SMALLER:
            raise ValueError(of_trained(path))
        if is_splat(path):
            raise ValueError(of_trained(folder))


def check_within_trained(path):
    """ValueError for a part of what a program has trained."""
    if inside := next(filter(is_trained, [*path.parents][:ABOVE]), None):
        raise ValueError(of_trained(inside))


def project_of(folder, *, alone=False):
    """The folder that has photos with the cameras in it; alone: photos will do."""
    for _ in range(1 + ABOVE):
        found = base.detected(folder)
        if found and (alone or found.poses != photos.Photos.poses):
            return folder
        if not OF_CAMERAS.fullmatch(faults.resolved(folder).name):
            return None
        folder = folder / os.pardir if folder.name in ("", os.pardir) else folder.parent
    return None


def is_model(folder):
    """Whether a folder has COLMAP's files, or a folder 0 with them."""
    return any(
        (folder / inner / f"{part}{suffix}").is_file()
        for inner in (".", "0")
        for part in ("cameras", "images")
        for suffix in (".bin", ".txt")
    )


def unpacked(path, then):
    """The folder of an archive's name beside it, where that is a capture's.

    Else ValueError with the commands. then: (folder) -> the command that goes on.
    """
    kind = PACKED.fullmatch(path.name)[1].lower()
    folder = path.with_name(path.name[: -len(kind) - 1])
    if folder.is_dir():
        return of_folder(folder, then)
    own, out = shlex.quote(str(path)), shlex.quote(str(folder))
    commands = {"zip": f"`unzip {own} -d {out}`, then "}
    if kind.startswith("t"):
        commands[kind] = f"`mkdir {out} && tar -xf {own} -C {out}`, then "
    how = commands.get(kind, f"into {out}, then ")
    raise ValueError(f"{path}: unpack it first: {how}`{then(folder)}`")


def is_trained(folder):
    """Whether a folder is what a program has trained, and no project around it."""
    there = (next(folder.glob(name), None) for name in TRAINED)
    return any(there) and not any((folder / name).exists() for name in PROJECT)


def is_splat(path):
    """Whether a file is a .ply of Gaussians, by its beginning."""
    if path.suffix.lower() != ".ply" or not path.is_file():
        return False
    with faults.opened(path) as file:
        head = file.read(HEAD_BYTES)
    return any(name in head for name in OF_SPLATS)


def splat_in(folder):
    """The .ply of Gaussians in a folder or below; the last one, by numbers. Or None."""
    below = [p for k in range(4) for p in folder.glob("*/" * k + "*.ply")]
    found = [path for path in below if is_splat(path)]
    return max(
        found,
        key=lambda p: [int(n) for n in re.findall(r"\d+", str(p))] or [0],
        default=None,
    )


def of_trained(path):
    """What to type for a splat, or the folder of a trained model, in a line."""
    if path.is_file() and path.suffix.lower() in SMALLER:
        return f"{path}: a packed splat: export it as .ply, and give that as SPLAT"
    splat = path if path.is_file() else splat_in(path)
    above = [path, *path.parents][: 1 + ABOVE]
    noted = [*map(source_of, above), *map(project_around, above[1:])]
    source = next(filter(None, noted), "photos")
    cameras = [p for one in above if (p := one / "cameras.json").is_file()]
    given = {"PHOTOS": source, "SPLAT" if splat else "RENDERS": splat or path}
    given["CAMERAS"] = [*cameras, "sparse/0" if source == "photos" else source][0]
    told = provenance.as_command("judge", given)
    return f"{path}: trained by another program: `{told}` judges that"


def source_of(folder):
    """The folder of photos that 3DGS notes in cfg_args, if it is there; else None."""
    path = folder / "cfg_args"
    if not path.is_file():
        return None
    found = re.search(r"source_path=(['\"])(.+?)\1", faults.text(path))
    source = Path(found[2]) if found else None
    return source if source and source.is_dir() else None


def project_around(folder):
    """The folder, where it has photos with cameras; else None."""
    with contextlib.suppress(ValueError):
        found = base.detected(folder)
        return folder if found and found.poses != photos.Photos.poses else None


def judged(key, path):
    """What PHOTOS, RENDERS, SPLAT, CAMERAS or DEPTH of a judgement means; ValueError as
    of `meant`.
    """
    from alignerf.scenes import photos as of_photos

    path = at_home(path)
    if not path.exists():
        raise ValueError(f"{key}: {missing(path)}")

    def then(folder):
        return provenance.as_command("judge", {key: folder}) + " ..."

    if path.is_file() and PACKED.fullmatch(path.name):
        return unpacked(path, then)
    is_photo = path.is_file() and path.suffix.lower() in of_photos.SUFFIXES
    is_small = path.suffix.lower() in SMALLER
    if key == "SPLAT" and is_small:
        raise ValueError(of_trained(path))
    if key == "SPLAT" and path.is_dir():
        return splat_in(path) or path
    if key == "RENDERS" and (is_splat(path) or is_small):
        raise ValueError(f"{path}: a splat, and no folder of renders: give it as SPLAT")
    if key in ("PHOTOS", "RENDERS") and is_photo:
        return path.parent
    if key == "PHOTOS" and path.is_file():
        return of_file(path, then)
    if key == "PHOTOS" and path.is_dir():
        usual = (path, path / "input", path / "rgb")
        return path if any(map(photos.inner_of, usual)) else of_folder(path, then)
    return path
