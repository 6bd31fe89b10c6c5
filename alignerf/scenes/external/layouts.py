"""Numbered renders of other programs, and which photo each belongs to.

Known are the `render.py` of 3D Gaussian splatting (train/ours_30000/renders/00000.png),
the `simple_trainer.py` of gsplat (val_step29999_0000.png, photo and render side by
side), and folders of numbers. Which photo has which number depends on the order that
the program has them in: see `orders`.
"""

import re
from pathlib import Path
from typing import NamedTuple

from alignerf.scenes.external import orders

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
    """A render's file. part: of `orders.HALVES`, which is the render; None of a whole.

    split: that it is of, or None.
    """

    path: Path
    part: str | None = None
    split: str | None = None


class Found(NamedTuple):
    """The renders {view: Render} of a folder, and in words how they are laid out.

    order: the views as they are counted. left_out: paths that are of no view.
    """

    renders: dict
    layout: str
    order: list
    left_out: list


class Group(NamedTuple):
    """Numbered renders [(number, path)] of the views of a split; of all where None.

    is_of: {view: split that it is then said to be of, or None}. by_rank: numbers begin
    anywhere, so that there have to be as many renders as views. part: as of `Render`.
    """

    counted: str | None
    paths: list
    is_of: dict
    by_rank: bool = False
    part: str | None = None


def found(folder, files, photo_paths, splits, every, part, layout):
    """A `Found` for each order of the photos that numbered renders may be in.

    photo_paths: {view: path}; splits: {view: split}, or None: one in `every` is held
    out. layout: a function below. Raises ValueError where numbers are of no view.
    """
    made, fault, by = [], None, orders.of(photo_paths)
    for how, order in by.items():
        own = splits or every_nth(order, every)
        words, groups = layout(folder, files, own)
        try:
            renders = of_groups(groups, order, own, photo_paths, part)
        except ValueError as error:
            fault = fault or error
            continue
        if renders:
            told = f"{words}, in the order of {how}" if len(by) > 1 else words
            used = {one.path for one in renders.values()}
            left = [path for g in groups for _, path in g.paths if path not in used]
            made.append(Found(renders, told, order, left))
    if fault and not made:
        raise fault
    return made


def of_groups(groups, order, splits, photo_paths, part):
    """{view: Render} of all groups, views in one order; {} where they are not as many.

    Raises ValueError as of `pairs_of`, and where two renders are of one view.
    """
    renders = {}
    for group in groups:
        own = [view for view in order if group.counted in (None, splits[view])]
        part = group.part or part
        pairs = pairs_of(group, own, photo_paths, part)
        if not pairs:
            return {}
        for path, view in pairs.items():
            put(renders, view, Render(path, part, group.is_of[view]))
    return renders


def pairs_of(group, own, photo_paths, part):
    """{path: view} of a group's renders, `own` views in order; [] of too few.

    Where a render or photo is missing among them, pictures tell which. Raises
    ValueError naming a render whose number is none of a view.
    """
    numbers, paths = zip(*sorted(group.paths), strict=True)
    ways = []
    if group.by_rank and len(own) == len(paths):
        ways = [dict(zip(paths, own, strict=True))]
    elif not group.by_rank and numbers[-1] < len(own):
        ways = [{path: own[n] for n, path in zip(numbers, paths, strict=True)}]
    if len(own) != len(paths) and (group.by_rank or numbers[-1] < len(paths)):
        ways += filter(None, [orders.aligned(own, paths, photo_paths, part)])
    if not (ways or group.by_rank):
        views = f"{group.counted} views" if group.counted else "views"
        raise ValueError(
            f"{paths[-1]}: there are {len(own)} {views} by the photos' names, so none "
            f"has the number {numbers[-1]}"
        )
    return ways and ways[orders.best(ways, photo_paths, part)]


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
            part="right",
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


def with_their_numbers(folder, files, photo_paths, part):
    """A `Found` of renders that have the numbers of their photos; None of others."""
    own = by_numbers(files)
    views = {path: view for view, path in photo_paths.items()}
    of_photos = by_numbers(list(views))
    if not own or own.keys() - of_photos.keys():
        return None
    found = {
        views[of_photos[number]]: Render(path, part, split_of(path, folder))
        for number, path in own.items()
    }
    return Found(found, "with the photos' numbers", sorted(photo_paths), [])


def split_of(path, folder):
    """The split that a folder on the way to a render says, or None."""
    parts = [part.lower() for part in path.relative_to(folder).parts[:-1]]
    above = folder
    while above.name in WITHIN or OURS.fullmatch(above.name):
        parts.insert(0, above.name.lower())
        above = above.parent
    parts.insert(0, above.name.lower())
    return next((SPLITS[part] for part in reversed(parts) if part in SPLITS), None)
