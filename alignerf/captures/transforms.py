"""The transforms.json of instant-ngp and nerfstudio, beside its photos."""

from alignerf.captures import posed


class Transforms(posed.Posed):
    name = "transforms"
    order = 2
    what = "transforms.json"
    keys = ("background", "images", "masks")

    def detect(self, folder):
        return (folder / "transforms.json").exists()

    def read_given(self, scene):
        from alignerf.scenes.formats import transforms

        keys = (scene["path"], scene["background"])
        return transforms.read(*keys, images=scene["images"], masks=scene["masks"])


CAPTURE = Transforms()
