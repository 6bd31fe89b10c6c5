"""Photos beside renders of another program: these are judged, nothing is trained."""

from typing import Literal

from alignerf.captures import posed
from alignerf.experiment.keys.key import PATH, Keys, key


class ExternalRenders(Keys):
    """What another program has trained: its renders are judged, and nothing is trained.

    `make judge` writes it.
    """

    renders: PATH = key(
        what="folder of its renders of the photos, as nerfstudio, gsplat or Gaussian "
        "splatting write them, or with the photos' names",
    )
    splits: list[Literal["train", "test"]] = key(
        ["train", "test"],
        "which photos have renders: training ones, held-out ones, or both",
        length=(1, 2),
    )
    cameras: PATH | None = key(
        None,
        "transforms.json, COLMAP's sparse/0, or cameras.json of Gaussian splatting, or "
        "their folder; null: a field of view is assumed",
    )
    depth: PATH | None = key(
        None,
        "folder of the renders' depth along the optical axis, in the unit of the "
        "cameras: .npz, .npy; null: from the points that cameras came with, else all "
        "is far away",
    )
    before: PATH | None = key(
        None,
        "verdict.json of earlier results to compare with",
    )


class JudgedCapture(posed.Posed):
    name = "external_renders"
    order = 8
    what = "photos beside renders of another program"
    # Renders were seen by the cameras as they are; an export has adjusted ones.
    poses = ("input",)
    keys = ("background",)
    section = (
        ExternalRenders | None,
        key(
            None,
            "of source external_renders: the renders, their cameras and their depth",
        ),
    )
    trains = False

    def read(self, scene, scratch):
        from alignerf.judged import views

        return views.load(scene, scratch)

    def read_given(self, scene):
        from alignerf.judged import views

        return views.at_full_size(scene)

    def wants_matches(self, scene):
        return bool(scene.external_renders.cameras) and super().wants_matches(scene)

    def splits(self, scene):
        return scene.external_renders.splits

    def can_export(self, scene):
        return bool(scene.external_renders.cameras) and "train" in self.splits(scene)

    def before(self, scene):
        return scene.external_renders.before

    def faults(self, scene):
        """The pairs stay as they are: nothing of them is made smaller."""
        if not scene.external_renders:
            yield (
                "external_renders",
                "goes with source 'external_renders', and that with it",
            )
        for name, usual in (("downscale", 1), ("crop", None), ("perturb_px", 0)):
            if getattr(scene, name) != usual:
                yield name, "not of renders that are judged"


CAPTURE = JudgedCapture()
