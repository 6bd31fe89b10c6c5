"""A folder of photos and films, or one film: COLMAP finds the poses."""

import collections
import contextlib
from pathlib import Path

from alignerf.captures import base


class Photos(base.Capture):
    name = "photos"
    order = 9
    what = "folder of photos and films"
    poses = ("colmap",)
    keys = ("background", "masks")
    frame = "COLMAP's: its unit of length is arbitrary"

    def detect_late(self, folder):
        return inner_of(folder) is not None

    def scene(self, folder):
        from alignerf.readers.programs import reading

        reading.tell_unread(folder)
        inner = inner_of(folder)
        found = {"source": self.name, "path": str(inner)}
        masks = [p for p in (inner / "masks", inner.parent / "masks") if p.is_dir()]
        if masks and (masks[0].parent == inner or inner.name == "images"):
            found["masks"] = str(masks[0])
        return found

    def read(self, scene, scratch):
        from alignerf.colmap import loading

        return loading.by_colmap(scene.path, scratch, scene)

    def at_full_size(self, scene, folder, scratch):
        from alignerf.colmap import loading

        return loading.once_more(scene.path, scene, folder, scratch)


def inner_of(folder):
    """The folder with the photos, which programs call so, or a film; or None."""
    if not folder.is_dir():
        from alignerf.colmap import video

        is_film = folder.is_file() and folder.suffix.lower() in video.SUFFIXES
        return folder if is_film else None
    places = (folder, folder / "images", folder / "rgb")
    places = [place for place in places if place.is_dir()]
    for inner in places:
        if any(is_taken(path) for path in inner.iterdir()):
            return inner
    from alignerf.scenes import photo_names

    # A folder of each camera; elsewhere these are scenes.
    below = (one for one in places if one.name == "images" and photo_names.listed(one))
    return next(below, None)


def is_taken(path):
    """Whether a file is a photo or a film, by its name."""
    from alignerf.colmap import video
    from alignerf.scenes import photos

    suffixes = photos.SUFFIXES | video.SUFFIXES
    return path.suffix.lower() in suffixes and not path.name.startswith(".")


def alone(paths):
    """The folder of most photos among the paths, if no cameras lie there; else None."""
    from alignerf.judged import originals

    found = (path for path in map(Path, paths) if is_taken(path))
    # Masks come after the photos, and are no more.
    usual = collections.Counter(path.parent for path in found).most_common(1)
    for folder, _ in usual:
        with contextlib.suppress(ValueError, OSError):
            record = base.detected(folder)
            is_alone = record and record.poses == ("colmap",)
            return originals.named(folder) if is_alone else None
    return None


CAPTURE = Photos()
