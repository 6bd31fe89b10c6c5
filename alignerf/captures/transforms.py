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
        from alignerf.readers import transforms
        from alignerf.sfm import pairing

        keys = {key: getattr(scene, key) for key in ("background", "images", "masks")}
        return transforms.read(scene.path, **keys, choose=pairing.choose)


CAPTURE = Transforms()
