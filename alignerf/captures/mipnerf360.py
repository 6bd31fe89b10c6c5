"""A scene of mip-NeRF 360 (360_v2), or another project with a model of COLMAP."""

from alignerf.captures import posed


class MipNerf360(posed.Posed):
    name = "mipnerf360"
    order = 3
    what = "a scene of mip-NeRF 360 (360_v2) or another COLMAP model"
    keys = ("images", "masks")
    every_eighth = True

    def detect(self, folder):
        return (folder / "sparse/0").exists()

    def detect_late(self, folder):
        """A model lies elsewhere; ValueError where a part of it is missing."""
        from alignerf.readers import colmap_models
        from alignerf.scenes import photo_names

        if not (photo_names.listed(folder) or any(folder.glob("images_*/*"))):
            return False
        if colmap_models.find(folder):
            return True
        if lacking := colmap_models.missing(folder):
            inner = folder / "images"
            raise ValueError(
                f"{lacking}. Without it COLMAP runs on the photos: move it away, or "
                f"give {inner if inner.is_dir() else folder} as the folder"
            )
        return False

    def read_given(self, scene):
        from alignerf.readers import projects
        from alignerf.sfm import pairing

        keys = (scene.path, scene.images, scene.masks)
        return projects.read(*keys, pairing.choose)


CAPTURE = MipNerf360()
