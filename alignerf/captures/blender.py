"""NeRF's synthetic scenes: transforms_train.json, _val and _test beside one another.

The files say which views are trained on and which are scored. Views of `val`, which no
published score uses, are left out. Photos with alpha are set on a background.
"""

from pathlib import Path

from alignerf.captures import posed
from alignerf.io import faults

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
        import numpy as np

        from alignerf.scenes import prepare
        from alignerf.scenes.formats import transforms

        halves, names, left_out = [], [], []
        for split in SPLITS:
            path = Path(scene["path"]) / f"transforms_{split}.json"
            try:
                views, missing = transforms.read(
                    path, scene["background"], split_by_lists=False
                )
                # A frame that was never rendered finds a training photo of its name.
                taken = {photo.path for half in halves for photo in half.photos}
                each = zip(views.names, views.photos, strict=True)
                others = (
                    name
                    for name, photo in each
                    if photo.path in taken and photo.path.parent.name != split
                )
                lost = [*missing, *others]
                if lost and split == "test":
                    few, place = faults.some_names(lost), path.parent
                    raise ValueError(f"{path}: no image in {place} of {few}")
            except ValueError as error:
                way = f". {ALONE}" if split == "test" else ""
                raise ValueError(f"{error}{way}") from None
            prefixed = prefixed_by(split, [*views.names, *missing])
            left_out += prefixed[len(views.names) :]
            halves.append(views)
            names += prefixed[: len(views.names)]
        sizes = {(views.width, views.height) for views in halves}
        if len(sizes) > 1:
            folder = scene["path"]
            raise ValueError(f"{folder}: photos of train and test differ in size")
        views = prepare.join(halves, masked=any(views.masks for views in halves))
        split = np.repeat(SPLITS, [len(views.names) for views in halves])
        return views._replace(names=names, split=split), left_out


def prefixed_by(split, names):
    """Names that begin with their split; where all have it already, as they are."""
    has = all(name.startswith(f"{split}_") for name in names)
    return list(names) if has else [f"{split}_{name}" for name in names]


CAPTURE = Blender()
