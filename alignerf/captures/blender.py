"""NeRF's synthetic scenes: transforms_train.json, _val and _test beside one another.

The files say which views are trained on and which are scored. Views of `val`, which no
published score uses, are left out. Photos with alpha are set on a background.
"""

from pathlib import Path

from alignerf.captures import posed

SPLITS = ("train", "test")
ALONE = (
    "To take the training photos alone, rename transforms_train.json to transforms.json"
)


class Blender(posed.Posed):
    name = "blender"
    order = 1
    what = "one of NeRF's synthetic scenes"
    keys = ("background",)
    says_split = True

    def detect(self, folder):
        return (folder / "transforms_train.json").exists()

    def read_given(self, scene):
        """A view's name begins with its split."""
        from alignerf.readers import shots, transforms

        folder, found, lost = Path(scene.path), [], []
        for split in SPLITS:
            path = folder / f"transforms_{split}.json"
            own = transforms.cameras_of(path, split=split)
            found += own.shots
            lost += own.left_out
        try:
            own = own._replace(where=folder, shots=found, left_out=lost)
            own = transforms.placed(own, folder)
        except ValueError as error:
            raise ValueError(f"{error}. {ALONE}") from None
        found = [s._replace(name=prefixed(s.split, s.name)) for s in own.shots]
        own = own._replace(shots=found)
        return shots.views_of(own, background=scene.background), own.left_out


def prefixed(split, name):
    """A view's name that begins with its split."""
    return name if name.startswith(f"{split}_") else f"{split}_{name}"


CAPTURE = Blender()
