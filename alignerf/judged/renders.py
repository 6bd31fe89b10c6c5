"""Renders of another program, and which photo each belongs to.

Known ways to lay them out: nerfstudio's `ns-render dataset` (train/rgb/, test/rgb/),
Brush's eval_30000/, any folder whose renders are called like their photos, and those
that are numbered (`layouts`).
"""

import functools
import logging
import os
import re
import shlex
import unicodedata
import urllib.parse
from pathlib import Path, PurePath

from alignerf.colmap import video
from alignerf.io import faults
from alignerf.judged import layouts
from alignerf.scenes import photo_names, photos

log = logging.getLogger("alignerf")

SUFFIXES = photos.SUFFIXES - {".heic", ".heif"}
# Folders beside renders, of photos, depths and others; and such files among renders.
OTHERS = re.compile(
    r"gt.*|.*ground.?truth.*|raw-.*|.*depth.*|accumulation|.*normals?|masks?|alpha|errors?"
    r"|diff|background|rgba|cameras"
)
TRUTH = re.compile(r"gt([_-].*)?|ground.?truth")
OTHER_FILES = re.compile(
    r"(.*[^a-z])?(gt|ground.?truth|depths?|normals?|acc|accumulation|alpha|opacity|masks?"
    r"|errors?|diff|disparity)([^a-z].*)?"
)
# What programs put around a photo's name, and file managers at the end of a copy's.
AROUND = re.compile(
    r"(?:renders?|rgb|pred|color|images?)[_-](.+)|(.+)[_-](?:renders?|rgb|pred|img)",
    re.IGNORECASE,
)
COPIED = re.compile(r"( - copy)?( ?\(\d+\))?$", re.IGNORECASE)
# Folders at most that are part of a name.
DEPTH = 4
# Folders with such numbers and more in their names are of a training's steps.
MIN_STEPS = 100
# More files are no folder of renders.
MAX_FILES = 100_000


def find(folder, photo_paths, splits=None, every=None) -> layouts.Found:
    """The renders of these views in a folder.

    photo_paths: {view: path}. splits: {view: split}, where the cameras say it. every:
    one in so many is held out, where that is said.
    Raises ValueError naming the folder where there are none, and where two files are of
    one view.
    """
    folder = Path(folder)
    files, own = files_of(folder, photo_paths), {*photo_paths.values()}
    files = [path for path in files if path not in own] or files
    files = of_last(files, photo_paths)
    check_some(folder, files)
    if every or len(set((splits or {}).values())) < 2:
        splits = None
    counted = functools.partial(
        layouts.found, folder, files, photo_paths, splits, every or layouts.EVERY
    )
    found = counted(layouts.sheets) or counted(layouts.gaussians)
    if not found:
        found = named(folder, files, photo_paths)
        numbers = sorted(layouts.by_numbers(files))
        # A program counts from 0; fewer than all are of a split, though photos may
        # have such numbers, too.
        counts = numbers == [*range(len(files))] and len(files) < len(photo_paths)
        if found.left_out or (counts and files[0].stem.isdecimal()):
            ways = [
                layouts.with_their_numbers(folder, files, photo_paths),
                counted(layouts.numbered),
            ]
            found = next(filter(None, ways[::-1] if counts else ways), found)
    if not found.renders:
        few = faults.some_names([path.name for path in files])
        raise ValueError(
            f"{folder}: its renders ({few}) are not called like the photos "
            f"({faults.some_names(sorted(photo_paths))}), and are not as many: give "
            "each the name of its photo"
        )
    if found.left_out:
        few = faults.some_names([path.name for path in found.left_out])
        log.warning("%s: of no photo, and left out: %s", folder, few)
    return found


def files_of(folder, photo_paths=(), suffixes=SUFFIXES):
    """Paths of the images in a folder and those inside, sorted; no photos or depths.

    photo_paths: {view: path}, which may be called like what is left out.
    """
    found, seen = [], 0
    for root, inner, files in photo_names.walk(folder):
        inner[:] = sorted(
            one for one in inner if not OTHERS.fullmatch(one.lower()) and one[0] != "."
        )
        seen += len(files)
        if seen > MAX_FILES:
            raise ValueError(f"{folder}: over {MAX_FILES} files: not renders alone")
        paths = (Path(root, name) for name in files if name[0] != ".")
        found += [path for path in paths if path.suffix.lower() in suffixes]
    left = [path for path in found if not is_other(path)]
    return sorted(
        found if any(map(is_other, map(Path, photo_paths))) else left or found
    )


def check_some(folder, files):
    """ValueError where there are no renders, which says how a film becomes some."""
    films = files_of(folder, suffixes=video.SUFFIXES) if folder.is_dir() else []
    if folder.suffix.lower() in video.SUFFIXES:
        films = [folder]
    if films and not files:
        raise ValueError(
            f"{films[0]}: a video: give its frames, if it shows the photos one by one: "
            f"mkdir frames && ffmpeg -i {shlex.quote(str(films[0]))} frames/%05d.png"
        )
    if not folder.is_dir():
        raise ValueError(f"{folder}: no folder of renders")
    beside = [folder.parent / name for name in ("renders", "rgb")]
    if TRUTH.fullmatch(folder.name.lower()) and any(map(Path.is_dir, beside)):
        found = next(filter(Path.is_dir, beside))
        raise ValueError(f"{folder}: photos, by its name: renders lie in {found}")
    if not files:
        raise ValueError(f"{folder}: no renders ({', '.join(sorted(SUFFIXES))})")


def is_other(path):
    """Whether a file is called like a depth, a mask or else beside a render."""
    return bool(OTHER_FILES.fullmatch(path.stem.lower()))


def of_last(files, photo_paths):
    """The files without those of earlier steps: of eval_5000/ beside eval_30000/."""
    known = {part for path in photo_paths.values() for part in PurePath(path).parts}
    steps = {}
    for path in files:
        for place in path.parents:
            match = layouts.NUMBERED.fullmatch(place.name)
            # Photos, too, may lie in folders that are numbered.
            if match and place.name not in known:
                siblings = steps.setdefault((place.parent, match[1], match[3]), {})
                siblings.setdefault(int(match[2]), []).append(path)
    earlier = set()
    for numbers in steps.values():
        last = {path.name for path in numbers[max(numbers)]}
        for number in numbers.keys() - {max(numbers)}:
            same = [path for path in numbers[number] if path.name in last]
            # Folders of several cameras have files of the same names, too.
            earlier.update(same if min(numbers) >= MIN_STEPS else ())
    return [path for path in files if path not in earlier]


def named(folder, files, photo_paths) -> layouts.Found:
    """Renders that are called like their photos, in one folder or in several.

    photo_paths: {view: path}. Raises ValueError where two files are of one view.
    """
    called, found, strange, loosest = Called(photo_paths), {}, [], {}
    for path in files:
        view, loose = called.view_of(path)
        if view is None or loose > loosest.get(view, loose):
            strange.append(path)
            continue
        if loose < loosest.get(view, loose):
            strange.append(found.pop(view).path)
        loosest[view] = loose
        split = layouts.split_of(path, folder)
        layouts.put(found, view, layouts.Render(path, split=split))
    return layouts.Found(found, "named like the photos", strange)


class Called:
    """Views by what their photos are called, or their names with folders before them.

    photo_paths: {view: path}.
    """

    def __init__(self, photo_paths):
        self.views = [{} for _ in LOOSELY]
        places = [PurePath(path).parent for path in photo_paths.values()]
        common = os.path.commonpath(places or ["."])
        # A file in a folder of one photo is of no photo in another.
        self.folders = {
            part for one in places for part in one.relative_to(common).parts
        }
        for view, path in photo_paths.items():
            texts = {view, *with_folders(path)}
            for loosely, known in zip(LOOSELY, self.views, strict=True):
                for text in set(map(loosely, texts)):
                    # What two views are called is no name of either.
                    known[text] = view if known.get(text, view) == view else None

    def view_of(self, path):
        """(view, how loosely it is called so) of a file; (None, 0) of another's."""
        before = (None, *path.parts[-DEPTH:-1])
        tries = zip(with_folders(path), before, strict=True)
        tries = [text for text, folder in tries if folder not in self.folders]
        around = filter(None, map(AROUND.fullmatch, tries))
        tries += [match[1] or match[2] for match in around]
        for loose, known in enumerate(self.views):
            for text in tries:
                if view := known.get(LOOSELY[loose](text)):
                    return view, loose
        return None, 0


def with_folders(path):
    """What a file is called, without suffix, with several folders before it to none."""
    *folders, name = PurePath(path).parts[-DEPTH:]
    while PurePath(name).suffix.lower() in photos.SUFFIXES:
        name = PurePath(name).stem
    return ["_".join([*folders[i:], name]) for i in range(len(folders) + 1)]


def loosely(text):
    """A name without what file managers, browsers and other systems change in it."""
    plain = unicodedata.normalize("NFKC", urllib.parse.unquote(text)).casefold()
    return re.sub(r"[\W_]+", "_", plain).strip("_")


# As it is; in letters and figures alone; without the mark of a copy.
LOOSELY = (str, loosely, lambda text: loosely(COPIED.sub("", text)))
