"""Numbered renders of other programs, and which photo each belongs to.

Known are the `render.py` of 3D Gaussian splatting (train/ours_30000/renders/00000.png),
the `simple_trainer.py` of gsplat (val_step29999_0000.png, photo and render side by
side), and folders of numbers. Numbers count photos by name.
"""

import re
from pathlib import Path
from typing import NamedTuple

from alignerf.scenes import photos

# What folders call a split; what is validated is held out.
SPLITS = {"train": "train", "test": "test", "val": "test", "eval": "test"}
SHEET = re.compile(r"(train|val|test)_step(\d+)_(\d+)\.png")
OURS = re.compile(r"ours_(\d+)")
# Folders of renders within that of a split.
WITHIN = ("renders", "rgb")
# A number in a name, and what is around it.
NUMBERED = re.compile(r"(.*?)(\d+)(\D*)")
# Every so many views, by name, are held out by 3D Gaussian splatting and by gsplat.
EVERY = 8


class Render(NamedTuple):
    """A render's file. sheet: its photo is beside it, on the left.

    split: that it is of, or None.
    """

    path: Path
    sheet: bool = False
    split: str | None = None

    def half(self, image):
        """What is the render in an image of the file."""
        return image[:, image.shape[1] // 2 :] if self.sheet else image

    @property
    def size(self):
        """(width, height) of the render; ValueError of a sheet without halves."""
        width, height = photos.head(self.path).size
        if self.sheet and width % 2:
            raise ValueError(
                f"{self.path}: {width}x{height} px: a photo and its render are of "
                "one size"
            )
        return width // 2 if self.sheet else width, height


class Found(NamedTuple):
    """The renders {view: Render} of a folder, and in words how they are laid out.

    left_out: paths that are of no view.
    """

    renders: dict
    layout: str
    left_out: list


class Group(NamedTuple):
    """Numbered renders [(number, path)] of the views of a split; of all where None.

    is_of: {view: split that it is then said to be of, or None}. by_rank: numbers begin
    anywhere, so that there have to be as many renders as views. sheet: as of `Render`.
    """

    counted: str | None
    paths: list
    is_of: dict
    by_rank: bool = False
    sheet: bool = False


def in_order(photo_paths):
    """The views as programs count them: by their photos' paths."""
    return sorted(photo_paths, key=lambda view: photo_paths[view].as_posix())


def found(folder, files, photo_paths, splits, every, layout):
    """A `Found` of numbered renders; None where they are not as many, or named.

    photo_paths: {view: path}; splits: {view: split}, or None: one in `every` is held
    out. layout: a function below. Raises ValueError where numbers are of no view, and
    where two renders are of one view.
    """
    order, renders = in_order(photo_paths), {}
    splits = splits or every_nth(order, every)
    words, groups = layout(folder, files, splits)
    for group in groups:
        own = [view for view in order if group.counted in (None, splits[view])]
        numbers, paths = zip(*sorted(group.paths), strict=True)
        if group.by_rank:
            if len(own) != len(paths):
                return None
            numbers = range(len(paths))
        elif numbers[-1] >= len(own):
            views = f"{group.counted} views" if group.counted else "views"
            raise ValueError(
                f"{paths[-1]}: there are {len(own)} {views} by the photos' names, so "
                f"none has the number {numbers[-1]}"
            )
        for number, path in zip(numbers, paths, strict=True):
            view = own[number]
            put(renders, view, Render(path, group.sheet, group.is_of[view]))
    return Found(renders, words, []) if renders else None


def put(renders, view, render):
    """Add a render; ValueError where the view has one."""
    if view in renders:
        raise ValueError(f"{renders[view].path} and {render.path}: both of view {view}")
    renders[view] = render


def every_nth(names, n=EVERY):
    """{name: split} where every n-th view by name is held out."""
    return {name: "test" if i % n == 0 else "train" for i, name in enumerate(names)}


def nearest(split, count, splits):
    """The split that so many renders are of; None, of all, where that is nearer."""
    own = sum(one == split for one in splits.values())
    return None if abs(count - len(splits)) < abs(count - own) else split


# Of the files in a folder, where splits are {view: split}: (words, [`Group`]), without
# groups where they are laid out otherwise.


def sheets(folder, files, splits):
    """gsplat's: photo and render side by side, of the last step."""
    found = [(SHEET.fullmatch(path.name), path) for path in files]
    found = [(match, path) for match, path in found if match]
    last, of_split = max((int(match[2]) for match, _ in found), default=0), {}
    for match, path in found:
        if int(match[2]) == last:
            of_split.setdefault(SPLITS[match[1]], []).append((int(match[3]), path))
    groups = [
        Group(
            nearest(split, len(paths), splits),
            paths,
            dict.fromkeys(splits, split),
            sheet=True,
        )
        for split, paths in of_split.items()
    ]
    # Where all views are held out, as by `--test-every 1`, those say what was learnt.
    groups = [g if g.counted else g._replace(is_of=splits) for g in groups]
    return f"photo and render side by side, as gsplat writes them ({last})", groups


def gaussians(folder, files, splits):
    """3D Gaussian splatting's: numbered by name, of the last iteration."""
    found = []
    for path in files:
        parts = path.parts
        match = OURS.fullmatch(parts[-3]) if len(parts) > 3 else None
        if match and parts[-2] == "renders" and parts[-4] in SPLITS:
            found.append((int(match[1]), SPLITS[parts[-4]], path))
    last, of_split = max((number for number, _, _ in found), default=0), {}
    for iteration, split, path in found:
        if iteration == last:
            if not path.stem.isdecimal():
                raise ValueError(f"{path}: not a number, as render.py writes it")
            of_split.setdefault(split, []).append((int(path.stem), path))
    groups = []
    for split, paths in of_split.items():
        # Without its `--eval` it learns from all.
        counted = split if len(of_split) > 1 else nearest(split, len(paths), splits)
        groups.append(Group(counted, paths, dict.fromkeys(splits, split)))
    return f"numbered, as 3D Gaussian splatting writes them ({last})", groups


def numbered(folder, files, splits):
    """Renders numbered in the order of the photos: of all, or of a split."""
    of_split, groups = {}, []
    for path in files:
        of_split.setdefault(split_of(path, folder), []).append(path)
    for split, paths in of_split.items():
        if not (in_order := by_numbers(paths)):
            return "", []
        # As many as are learnt from are these.
        learnt = sum(one == "train" for one in splits.values())
        usual = "train" if len(paths) == learnt else "test"
        counted = nearest(split or usual, len(paths), splits)
        is_of = dict.fromkeys(splits, split or counted)
        groups.append(Group(counted, [*in_order.items()], is_of, True))
    return "numbered", groups


def by_numbers(paths):
    """{number: path} of names that differ by a number; {} of others."""
    matches = [NUMBERED.fullmatch(path.stem) for path in paths]
    if not all(matches) or len({(match[1], match[3]) for match in matches}) > 1:
        return {}
    found = {int(match[2]): path for match, path in zip(matches, paths, strict=True)}
    return found if len(found) == len(paths) else {}


def with_their_numbers(folder, files, photo_paths):
    """A `Found` of renders that have the numbers of their photos; None of others."""
    own = by_numbers(files)
    views = {path: view for view, path in photo_paths.items()}
    of_photos = by_numbers(list(views))
    if not own or own.keys() - of_photos.keys():
        return None
    found = {
        views[of_photos[number]]: Render(path, split=split_of(path, folder))
        for number, path in own.items()
    }
    return Found(found, "with the photos' numbers", [])


def split_of(path, folder):
    """The split that a folder on the way to a render says, or None."""
    parts = [part.lower() for part in path.relative_to(folder).parts[:-1]]
    above = folder
    while above.name in WITHIN or OURS.fullmatch(above.name):
        parts.insert(0, above.name.lower())
        above = above.parent
    parts.insert(0, above.name.lower())
    return next((SPLITS[part] for part in reversed(parts) if part in SPLITS), None)
