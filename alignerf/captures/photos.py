"""A folder of photos and films, or one film: COLMAP finds the poses."""

from alignerf.captures import base


class Photos(base.Capture):
    name = "photos"
    order = 9
    what = "folder of photos and films"
    poses = ("colmap",)
    keys = ("background", "masks")

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
    from alignerf.colmap import video

    if not folder.is_dir():
        is_film = folder.is_file() and folder.suffix.lower() in video.SUFFIXES
        return folder if is_film else None
    places = (folder, folder / "images", folder / "rgb")
    places = [place for place in places if place.is_dir()]
    for inner in places:
        if any(video.is_taken(path) for path in inner.iterdir()):
            return inner
    from alignerf.scenes import photo_names

    # A folder of each camera; elsewhere these are scenes.
    below = (one for one in places if one.name == "images" and photo_names.listed(one))
    return next(below, None)


CAPTURE = Photos()
