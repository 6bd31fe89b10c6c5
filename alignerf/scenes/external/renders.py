"""Renders of another program, and which photo each belongs to.

Known ways to lay them out: nerfstudio's `ns-render dataset` (train/rgb/, test/rgb/),
the `render.py` of 3D Gaussian splatting (train/ours_30000/renders/00000.png), the
`simple_trainer.py` of gsplat (val_step29999_0000.png, photo and render side by side),
and any folder whose renders are called like their photos, or are numbered.
"""

import logging
import re
from pathlib import Path
from typing import NamedTuple

from alignerf.io import faults
from alignerf.scenes import photo_names, photos
from alignerf.scenes.capture import video

log = logging.getLogger("alignerf")

SUFFIXES = photos.SUFFIXES - {".heic", ".heif"}
# What folders call a split; what is validated is held out.
SPLITS = {"train": "train", "test": "test", "val": "test", "eval": "test"}
# Folders beside renders: photos, depths and others.
OTHERS = re.compile(
    r"gt.*|.*ground.?truth.*|raw-.*|.*depth.*|accumulation|.*normals?|masks?|alpha|error"
    r"|background|rgba|cameras"
)
SHEET = re.compile(r"(train|val|test)_step(\d+)_(\d+)\.png")
OURS = re.compile(r"ours_(\d+)")
# What programs put around a photo's name.
AROUND = re.compile(
    r"(?:render|rgb|pred|color|image)[_-](.+)|(.+)[_-](?:render|rgb|pred)"
)
NUMBERED = re.compile(r"(.*?)(\d+)")
# Every so many views, by name, are held out by 3D Gaussian splatting and by gsplat.
EVERY = 8
# Folders with such numbers and more in their names are of a training's steps.
MIN_STEPS = 100
# More files are no folder of renders.
MAX_FILES = 100_000


class Render(NamedTuple):
    """A render's file. is_sheet: its left half is the photo. split: or None."""

    path: Path
    is_sheet: bool = False
    split: str | None = None


class Found(NamedTuple):
    """The renders {view: Render} of a folder, and in words how they are laid out."""

    renders: dict
    layout: str


def find(folder, names, splits=None) -> Found:
    """The renders of these views in a folder.

    names: of the views, which are those of their photos. splits: {name: split}, where
    the cameras say it. Raises ValueError naming the folder where there are none, and
    where two files are of one view.
    """
    folder, names = Path(folder), sorted(names)
    if not folder.is_dir():
        film = folder.suffix.lower() in video.SUFFIXES
        hint = f"; of a film: ffmpeg -i {folder.name} renders/%05d.png" * film
        raise ValueError(f"{folder}: no folder of renders{hint}")
    files = of_last(files_of(folder))
    if not files:
        raise ValueError(f"{folder}: no renders ({', '.join(sorted(SUFFIXES))})")
    splits = splits if splits and len(set(splits.values())) > 1 else every_nth(names)
    for layout in (sheets, gaussians, named, numbered):
        if found := layout(folder, files, names, splits):
            return found
    few = faults.some_names([path.name for path in files])
    raise ValueError(
        f"{folder}: its renders ({few}) are not called like the photos "
        f"({faults.some_names(names)}), and are not as many"
    )


def files_of(folder):
    """Paths of the images in a folder and those inside, sorted; no photos or depths."""
    found, seen = [], 0
    for root, inner, files in photo_names.walk(folder):
        inner[:] = sorted(
            one for one in inner if not OTHERS.fullmatch(one.lower()) and one[0] != "."
        )
        seen += len(files)
        if seen > MAX_FILES:
            raise ValueError(f"{folder}: over {MAX_FILES} files: not renders alone")
        paths = (Path(root, name) for name in files if name[0] != ".")
        found += [path for path in paths if path.suffix.lower() in SUFFIXES]
    return sorted(found)


def of_last(files):
    """The files without those of earlier steps: of eval_5000/ beside eval_30000/."""
    steps = {}
    for path in files:
        for place in path.parents:
            if match := NUMBERED.fullmatch(place.name):
                siblings = steps.setdefault((place.parent, match[1]), {})
                siblings.setdefault(int(match[2]), []).append(path)
    earlier = set()
    for numbers in steps.values():
        last = {path.name for path in numbers[max(numbers)]}
        for number in numbers.keys() - {max(numbers)}:
            same = [path for path in numbers[number] if path.name in last]
            # Folders of several cameras have files of the same names, too.
            earlier.update(same if min(numbers) >= MIN_STEPS else ())
    return [path for path in files if path not in earlier]


def every_nth(names, n=EVERY):
    """{name: split} where every n-th view by name is held out."""
    return {name: "test" if i % n == 0 else "train" for i, name in enumerate(names)}


def sheets(folder, files, names, splits):
    """gsplat's: photo and render side by side, of the last step."""
    found = [(SHEET.fullmatch(path.name), path) for path in files]
    found = [(match, path) for match, path in found if match]
    if not found:
        return None
    last = max(int(match[2]) for match, _ in found)
    found = [(match, path) for match, path in found if int(match[2]) == last]
    # Where all views are held out, as by `--test-every 1`, those say what was learnt.
    every, renders = len(found) == len(names), {}
    for match, path in found:
        split = SPLITS[match[1]]
        name = at(names, splits, None if every else split, int(match[3]), path)
        put(renders, name, Render(path, True, splits[name] if every else split))
    return Found(
        renders, f"photo and render side by side, as gsplat writes them ({last})"
    )


def gaussians(folder, files, names, splits):
    """3D Gaussian splatting's: numbered by name, of the last iteration."""
    found = []
    for path in files:
        parts = path.parts
        match = OURS.fullmatch(parts[-3]) if len(parts) > 3 else None
        if match and parts[-2] == "renders" and parts[-4] in SPLITS:
            found.append((int(match[1]), SPLITS[parts[-4]], path))
    if not found:
        return None
    last, renders = max(number for number, _, _ in found), {}
    found = [(split, path) for number, split, path in found if number == last]
    # Without its `--eval` it learns from all.
    every = {split for split, _ in found} == {"train"} and len(found) == len(names)
    for split, path in found:
        if not path.stem.isdecimal():
            raise ValueError(f"{path}: not a number, as render.py writes it")
        name = at(names, splits, None if every else split, int(path.stem), path)
        put(renders, name, Render(path, False, split))
    return Found(renders, f"numbered, as 3D Gaussian splatting writes them ({last})")


def at(names, splits, split, number, path):
    """The name of a view by its number in a split, or in all views where that is None.

    Raises ValueError naming the render's path where there are not as many.
    """
    own = [name for name in names if split in (None, splits[name])]
    if number >= len(own):
        views = f"{split} views" if split else "views"
        raise ValueError(
            f"{path}: there are {len(own)} {views} by the photos' names, so none has "
            f"the number {number}"
        )
    return own[number]


def put(renders, name, render):
    """Add a render; ValueError where the view has one."""
    if name in renders:
        raise ValueError(f"{renders[name].path} and {render.path}: both of view {name}")
    renders[name] = render


def named(folder, files, names, splits):
    """Renders that are called like their photos, in one folder or in several."""
    known, lower = set(names), {}
    for name in names:
        lower.setdefault(name.lower(), name)
    renders, strange = {}, []
    for path in files:
        name = name_of(path.stem, known, lower)
        if name is None:
            strange.append(path.name)
        else:
            put(renders, name, Render(path, False, split_of(path, folder)))
    if not renders:
        return None
    if strange:
        few = faults.some_names(strange)
        log.warning("%s: of no photo, and left out: %s", folder, few)
    return Found(renders, "named like the photos")


def name_of(stem, known, lower):
    """The view that a render's name means, or None."""
    tries = [stem, Path(stem).stem if Path(stem).suffix.lower() in SUFFIXES else stem]
    for one in list(tries):
        if match := AROUND.fullmatch(one):
            tries.append(match[1] or match[2])
    return next(
        (
            name
            for one in tries
            if (name := one if one in known else lower.get(one.lower()))
        ),
        None,
    )


def split_of(path, folder):
    """The split that a folder on the way to a render says, or None."""
    parts = [part.lower() for part in path.relative_to(folder).parts[:-1]]
    parts.insert(0, folder.name.lower())
    return next((SPLITS[part] for part in reversed(parts) if part in SPLITS), None)


def numbered(folder, files, names, splits):
    """Renders numbered in the order of the photos' names: of all, or of a split."""
    renders, of_split = {}, {}
    for path in files:
        of_split.setdefault(split_of(path, folder), []).append(path)
    for split, paths in of_split.items():
        own = [name for name in names if split is None or splits[name] == split]
        in_order = ordered(paths)
        test = [name for name in names if splits[name] == "test"]
        if split is None and in_order and len(in_order) == len(test) != len(names):
            own, split = test, "test"
        if in_order is None or len(in_order) != len(own):
            return None
        for name, path in zip(own, in_order, strict=True):
            put(renders, name, Render(path, False, split))
    return Found(renders, "numbered, taken in the order of the photos' names")


def ordered(paths):
    """The paths by the number that their names end in; None where they have none."""
    matches = [NUMBERED.fullmatch(path.stem) for path in paths]
    if not all(matches) or len({match[1] for match in matches}) > 1:
        return None
    numbers = [int(match[2]) for match in matches]
    if len(set(numbers)) < len(numbers):
        return None
    return [path for _, path in sorted(zip(numbers, paths, strict=True))]
