"""A scene of LLFF: poses_bounds.npy beside images or images_<n>."""

from alignerf.captures import posed


class Llff(posed.Posed):
    name = "llff"
    order = 4
    what = "LLFF's poses_bounds.npy"
    keys = ("masks",)
    every_eighth = True

    def detect(self, folder):
        return (folder / "poses_bounds.npy").exists()

    def read_given(self, scene):
        from alignerf.readers import llff

        return llff.read(scene.path, masks=scene.masks), []


CAPTURE = Llff()
