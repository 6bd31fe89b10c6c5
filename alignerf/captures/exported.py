"""Cameras that a program of photogrammetry has exported, beside its photos."""

from alignerf.captures import posed


class Exported(posed.Posed):
    name = "exported"
    order = 8
    what = "cameras of Metashape, openMVG, OpenSfM, Bundler, 3DGS, TUM or Nerfies"

    keys = ("masks",)

    def detect_late(self, folder):
        from alignerf.readers.programs import reading
        from alignerf.scenes import photo_names

        return reading.find(folder) is not None and bool(photo_names.listed(folder))

    def read_given(self, scene):
        from alignerf.readers.programs import reading

        return reading.views_of(scene.path, scene.masks)


CAPTURE = Exported()
