"""Renders of another program: `python -m alignerf.external.render`.

A job's command writes an image of every view, and their depth if it can; or they lie in
folders; or, without a job, the scene itself knows what belongs to which view
(`alignerf.judged`). They are checked and written as `alignerf.render_views`
writes ours: <view>.png, <view>.npz with depth, and a timing file, in folders with an
entry for each split.
"""

import hashlib
import json
import logging
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np

from alignerf.experiment.checks import placeholders
from alignerf.external import commands
from alignerf.io import archives, atomic, faults, images, machine, owned, progress
from alignerf.judged import depths, layouts, renders, views
from alignerf.scenes import cameras, distortion, photos, prepared

log = logging.getLogger("alignerf")

# Sizes that differ by rounding: by so many pixels, or by so much of a side.
ROUNDING_PX, ROUNDING_FRACTION = 2, 0.02
# About so many views tell the unit of their depth.
UNIT_VIEWS = 12

OPTIONS = commands.OPTIONS | {
    "[cameras]": "that renders are seen by",
    "splits": ("of the views", {"choices": prepared.SPLITS} | faults.SEVERAL),
    "renders": ("folder, written", Path),
    "depth": ("folder, written", Path),
    "timing": ("folder, written", Path),
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    job = args.config = args.config and commands.job_of(args.config)
    loaded = prepared.load(args.scene, args.cameras)
    if job is None:
        there = [name for name in prepared.SPLITS if (loaded.split == name).any()]
        if sorted(there) != sorted(args.splits):
            told = f"{', '.join(args.splits)}; there are renders of {', '.join(there)}"
            raise ValueError(f"judged.splits: {told}")
        write(args, loaded, of_pairs(loaded), 0.0, threads=args.threads)
    elif job.renders:
        names = {"scene": args.scene.name}
        folders = [
            f and placeholders.filled(f, names) for f in (job.renders, job.depth)
        ]
        write(args, loaded, of_folders(*folders, loaded, args.splits), 0.0)
    else:
        # It stays where something is wrong with it, for its owner to look at.
        owned.clear(args.training / "rendered")
        work = faults.resolved(args.training / "rendered")
        folders = {name: work / name for name in ("renders", "depth")}
        for folder in folders.values():
            folder.mkdir(parents=True)
        seconds = commands.run_of_job(job.render, args, **folders)
        of_view = of_folders(*folders.values(), loaded, args.splits)
        write(args, loaded, of_view, seconds)
        owned.clear(work)


def of_folders(images, depth, loaded: prepared.Scene, splits):
    """View -> (image, depth) of files that are named like the views of some splits.

    images, depth: folders, the latter in the units of the scene's own cameras, or None;
    without any all is far away. loaded: with the cameras that the renders are seen by.
    Raises ValueError where views are missing, of another size, empty, broken or twice
    the same.
    """
    names = [loaded.names[view] for split in splits for view in loaded.views(split)]
    images = Path(images)
    paths = {name: Path(name) for name in loaded.names}
    named = renders.named(images, renders.files_of(images, paths), paths)
    found, maps = complete(named.renders, names, images), {}
    if depth and (not Path(depth).is_dir() or any(Path(depth).iterdir())):
        maps = complete(depths.find(depth, loaded.names), names, depth)
    own, seen = prepared.read_cameras(loaded.folder / "cameras.npz"), {}
    scale, coarse = scale_of(own), None if maps else depth_of_points(loaded, own)

    def depth_of(view):
        path = maps[loaded.names[view]]
        return fitting(depths.read(path), path, loaded, cv2.INTER_NEAREST)

    every = [view for split in splits for view in loaded.views(split)] if maps else []
    scale /= unit_of(loaded, own, depth, every, depth_of)
    if not maps:
        what = "comes from the scene's points" if coarse else "counts as infinite"
        log.info("no depth came with the renders: it %s", what)

    def of_view(view):
        name = loaded.names[view]
        path = found[name].path
        # As photos are read, 16 bits and alpha too.
        image = photos.as_stored(path, "black")
        if (image == image[:1, :1]).all():
            raise ValueError(f"{path}: an empty image, all of one color")
        image = fitting(image, path, loaded, cv2.INTER_AREA)
        digest = hashlib.sha256(image.tobytes()).digest()
        camera = loaded.pixtocams[view].tobytes() + loaded.camtoworlds[view].tobytes()
        other, its_camera = seen.setdefault(digest, (path, camera))
        if camera != its_camera:
            raise ValueError(f"{path}: the same image as {other}, of another camera")
        if name not in maps:
            far = far_away((loaded.width, loaded.height))
            return image, scale * coarse(view) if coarse else far
        return image, scale * depth_of(view)

    return of_view


def of_pairs(loaded: prepared.Scene):
    """View -> (image, depth) of a scene that is judged."""
    if (pairs := views.read_pairs(loaded.folder)) is None:
        raise ValueError(f"{loaded.folder / views.PAIRS}: not found")
    own = prepared.read_cameras(loaded.folder / "cameras.npz")
    scale, size = scale_of(own), (loaded.width, loaded.height)
    coarse = depth_of_points(loaded, own) if pairs["depth"] == "points" else None

    def lens_of(view):
        """Of a render that shows the distortion: (camtopix, distortion)."""
        lens = pairs["views"][loaded.names[view]]["lens"]
        return lens and tuple(map(np.array, lens))

    def depth_of(view):
        values = depths.read(given[view])
        return depths.as_shown(values, own["pixtocams"][view], size, lens_of(view))

    given = {
        view: path
        for view, name in enumerate(loaded.names)
        if pairs["depth"] == "given" and (path := pairs["views"][name]["depth"])
    }
    where = Path(next(iter(given.values()))).parent if given else None
    scale /= unit_of(loaded, own, where, list(given), depth_of)

    def of_view(view):
        pair = pairs["views"][loaded.names[view]]
        render = layouts.Render(Path(pair["render"]), pair["sheet"])
        image, _ = views.read_render(render, pairs.get("background"))
        if lens := lens_of(view):
            camtopix = np.linalg.inv(loaded.pixtocams[view])
            image = distortion.undistort(image, *lens, camtopix)
        if coarse is not None:
            depth = coarse(view)
        elif view in given:
            depth = depth_of(view)
        else:
            depth = far_away(size)
        return image, scale * depth

    return of_view


def points_of(loaded):
    """The points [m, 3] that the photos of a scene share; None without any."""
    if not (path := loaded.folder / prepared.POINTS).is_file():
        return None
    return archives.read(path, ("points",))["points"]


def unit_of(loaded, own, where, views, depth_of):
    """`depths.unit_of` by some of the views; depth_of: view -> depth [h, w]."""
    if not len(views) or (points := points_of(loaded)) is None:
        return 1.0
    step = max(len(views) // UNIT_VIEWS, 1)
    some = (
        (depth_of(view), own["pixtocams"][view], own["camtoworlds"][view])
        for view in views[::step]
    )
    return depths.unit_of(where, points, some)


def depth_of_points(loaded, own):
    """View -> depth [h, w] by the points of a scene; None without any.

    own: its cameras as given, in whose units points and depth are.
    """
    if (points := points_of(loaded)) is None:
        return None
    cameras_of = own["pixtocams"], own["camtoworlds"]
    size = loaded.width, loaded.height
    return lambda v: depths.of_points(points, *(one[v] for one in cameras_of), size)


def scale_of(own):
    """Normalised units of length in one of the cameras as given."""
    return cameras.frame_of(own["camtoworlds"]).scale


def far_away(size):
    """Infinite depth [h, w]: before it only a turn and a zoom can be seen."""
    return np.full(size[::-1], np.inf, np.float32)


def complete(found, names, folder):
    """The same, or ValueError with some names of views that are missing."""
    if missing := [name for name in names if name not in found]:
        some = faults.some_names(missing)
        others = sorted(p.name for p in Path(folder).rglob("*") if p.is_file())
        has = f"; it has {faults.some_names(others)}" if others else "; it is empty"
        raise ValueError(
            f"{folder}: {len(missing)} of {len(names)} views are missing: {some}{has}"
        )
    return found


def fitting(values, path, loaded: prepared.Scene, interpolation):
    """Values [h, w, ...] at the scene's size, which rounding may have made another.

    Raises ValueError for any other size.
    """
    size, own = (loaded.width, loaded.height), values.shape[1::-1]
    if own == size:
        return values
    if any(
        abs(a - b) > max(ROUNDING_PX, ROUNDING_FRACTION * b)
        for a, b in zip(own, size, strict=True)
    ):
        sizes = f"{own[0]}x{own[1]} pixels, not {size[0]}x{size[1]}"
        raise ValueError(f"{path}: {sizes} as the photos in {{data}}")
    log.warning("made %dx%d like the photos: %s", *size, path.name)
    return cv2.resize(values, size, interpolation=interpolation)


def write(args, loaded, of_view, seconds, threads=1):
    """Write the views of all splits, and how long each took.

    of_view: a function of a view: its image [h, w, 3], its depth [h, w]. seconds: of
    all views, which the command renders at once.
    """
    count = sum(len(loaded.views(split)) for split in args.splits)
    with ExitStack() as stack:
        for split in args.splits:
            to_images, to_depths = (
                stack.enter_context(atomic.replace_folder(path / split))
                for path in (args.renders, args.depth)
            )

            def one(view, to_images=to_images, to_depths=to_depths):
                image, depth = of_view(view)
                images.write(to_images / f"{loaded.names[view]}.png", image)
                known = np.where(depth > 0, depth, np.inf).astype(np.float32)
                np.savez(to_depths / f"{loaded.names[view]}.npz", depth=known)

            own = loaded.views(split)
            made = machine.map_in_threads(one, own, threads=threads)
            for _ in progress.over(made, f"renders {split}", total=len(own)):
                pass
        owned.put(args.timing, [f"{split}.json" for split in args.splits])
        for split in args.splits:
            own = len(loaded.views(split))
            timing = {"time_s": round(own * seconds / count, 3), "views": own}
            timing["view_time_s"] = round(seconds / count, 4)
            with atomic.replace_file(args.timing / f"{split}.json") as path:
                path.write_text(json.dumps(timing))


if __name__ == "__main__":
    faults.run(main)
