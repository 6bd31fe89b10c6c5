"""What sources have in common whose files give the poses."""

import logging
from pathlib import Path

from alignerf.captures import base

log = logging.getLogger("alignerf.poses")

# Said of the poses of apps, in the log and in poses.json.
OF_PHONE = "poses of the phone: expect pixels of error"


class Posed(base.Capture):
    """Photos with the cameras that came with them."""

    def read_given(self, scene):
        """(views with these cameras, names of photos without one)."""
        raise NotImplementedError

    def read(self, scene, scratch):
        from alignerf.colmap import loading

        views, left_out = self.read_given(scene)
        return views, loading.registration(views.names, left_out), None

    def at_full_size(self, scene, folder, scratch):
        return self.read_given(scene)[0]


class App(Posed):
    """An app's folder: its own poses, or COLMAP's from the same photos."""

    poses = (*base.INPUT, "colmap")
    keys = ("masks",)
    # What is said of poses that are better than a phone's own.
    optimized = None

    def photos_of(self, folder):
        """{view name: path} of the photos; ValueError where there are none."""
        raise NotImplementedError

    def tracked_by_phone(self, folder):
        return True

    def read(self, scene, scratch):
        from alignerf.colmap import loading

        path = scene.path
        if scene.poses == "colmap":
            links = self.link_photos(path, scratch)
            return loading.by_colmap(links, scratch, scene, where=path)
        views, told, truth = super().read(scene, scratch)
        said = OF_PHONE if self.tracked_by_phone(path) else self.optimized
        log.info("%s: %s", path, said)
        return views, told | {"of_poses": said}, truth

    def at_full_size(self, scene, folder, scratch):
        from alignerf.colmap import loading

        if scene.poses == "colmap":
            links = self.link_photos(scene.path, scratch)
            return loading.once_more(links, scene, folder, scratch)
        return super().at_full_size(scene, folder, scratch)

    def shots_of(self, folder, path_of, shot_of):
        """(shots, names of the photos whose camera's file is missing).

        path_of: (view name) -> that file; shot_of: (name, photo, file) -> Shot.
        """
        taken = self.photos_of(folder)
        there = {name: path_of(name) for name in taken if path_of(name).is_file()}
        shots = [shot_of(name, taken[name], path) for name, path in there.items()]
        return shots, [name for name in taken if name not in there]

    def link_photos(self, folder, scratch):
        """A new folder <scratch>/taken with a link to each photo of an app's folder.

        COLMAP finds photos there and nothing else, by the names of the views.
        """
        links = Path(scratch) / "taken"
        links.mkdir()
        for name, path in self.photos_of(folder).items():
            (links / f"{name}{path.suffix}").symlink_to(path.resolve())
        return links
