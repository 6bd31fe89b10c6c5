"""Crops of another scene's photos at their own size, with its cameras and split."""


class Crops:
    """The record of crops; what it does not say itself, their source says."""

    has_truth = False

    def __init__(self, source):
        self.source = source

    def __getattr__(self, name):
        return getattr(self.source, name)

    def parent(self, scene):
        """The name of the scene that crops are of."""
        return scene.crop.of

    def cameras_by(self, scene):
        """The method whose cameras of that scene crops have; None: as given."""
        return scene.crop.cameras

    def size(self, scene):
        """(side of a crop in px at most, crops of each photo at most)."""
        return scene.crop.px, scene.crop.count

    def wants_matches(self, scene):
        """They have the points of the scene that they are of."""
        return False
