"""Renders: another program's renders. They are scored, and nothing is trained."""

from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys import key as keys
from alignerf.methods import base


class Renders(base.Method):
    """A method with `renders`."""

    key, order = "renders", 7
    beside = ("published",)
    annotation = str | None
    field = keys.key(
        None,
        "instead of a training: folder of another program's renders of the test views, "
        "<view>.png of the scene's size (8-bit RGB); {scene} stands for the scene's "
        "name; they are scored, and no more",
        pattern=r"\S",
    )
    trains = ours = False
    example = "renders: renders/{scene}"
    folders = ("renders",)

    def check(self, config, name):
        if config["reference"]["method"] == name:
            fault("reference.method", f"{name} is not trained: nothing warps onto it")

    def trainings(self, experiment, scene, name, once):
        return []

    def baseline(self, experiment, name):
        return experiment.config["reference"]["method"]

    def subject(self, experiment, name):
        return ["renders given"]


METHOD = Renders()
