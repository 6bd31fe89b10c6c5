"""A capture: where photos and cameras come from, and all that others ask of it.

`scene` is a scene's keys, `keys.scene.Scene`; `views` are `prepare.PosedViews`.
"""

import functools

from alignerf import captures
from alignerf.captures import crops
from alignerf.io.environment import extensions

# Ways of having poses that came with the photos.
INPUT = ("adjusted", "input")
SPLITS = ("train", "test")
# What is held out at most, unless a number says more; fewer than MIN_TEST_VIEWS give
# no interval (`causes.shared.misalignment`; a test holds both equal).
SELDOM, OFTEN, MIN_TEST_VIEWS = 8, 4, 5


class Capture:
    """A source of photos and cameras."""

    name: str
    # Folders are recognised in this order.
    order = 0
    # A few words for the key `source`.
    what: str
    # Ways of having poses, the usual one first.
    poses = INPUT
    # Of the keys of a scene that not every source has, those that this one has.
    keys = ()
    # (annotation, field) of keys of its own, which a scene has under its name.
    section = None
    has_truth = False
    has_path = True
    # Renders that another program has made are judged, and nothing is trained.
    trains = True
    # The published scores of its scenes are of every eighth view, however few that are.
    every_eighth = False
    # Its own files say which views are held out.
    says_split = False

    def detect(self, folder):
        """Whether a folder is meant to be of this source, complete or not."""
        return False

    def detect_late(self, folder):
        """The same, where no source has detected the folder by its own files."""
        return False

    def check(self, folder):
        """ValueError naming what a folder lacks that is meant to be of this source."""

    def scene(self, folder):
        """The keys of a scene of a folder that was detected."""
        found = {"source": self.name, "path": str(folder)}
        masks = folder / "masks"
        return found | {"masks": str(masks)} if self.takes(masks) else found

    def takes(self, masks):
        """Whether a folder of masks beside the photos is one that it reads."""
        return "masks" in self.keys and masks.is_dir()

    def tracked_by_phone(self, folder):
        """Whether a phone itself has found the poses, as it was moved."""
        return False

    def read(self, scene, scratch):
        """(views at full size, the report of them so far, the truth or None).

        scratch: a folder that files may be written into, which the views need.
        """
        raise NotImplementedError

    def at_full_size(self, scene, folder, scratch):
        """The views of a prepared scene once more, with cameras of the source.

        folder: the prepared scene's. scratch: as of `read`.
        """
        raise NotImplementedError

    def parent(self, scene):
        """The name of another scene, whose photos and cameras it has; or None."""
        return None

    def poses_of(self, scene):
        """The way of having poses; without features no camera can be adjusted."""
        usual = self.poses
        if scene.triangulate is False and "input" in usual:
            usual = ("input",)
        return scene.poses or usual[0]

    def every_of(self, scene, views):
        """The n of a scene whose every n-th view of `views` is held out.

        `auto`: 8, or the largest n from 4 on with MIN_TEST_VIEWS held out. Under 17
        views no such n leaves 12 to learn from: it stays 8, as no interval can be had
        anyway.
        """
        every = scene.test_every or (SELDOM if self.every_eighth else "auto")
        if every != "auto":
            return every
        some = range(SELDOM, OFTEN - 1, -1)
        enough = (n for n in some if -(-views // n) >= MIN_TEST_VIEWS)
        return next(enough, SELDOM)

    def wants_matches(self, scene):
        """Whether cameras are checked by matches, which find the scene's points too.

        Input cameras are unless the scene says no, the courtyard's true ones where it
        says so. COLMAP's poses have both already.
        """
        poses, wanted = self.poses_of(scene), scene.triangulate
        return poses in INPUT if wanted is None else wanted and poses != "colmap"

    def cameras_by(self, scene):
        """The method whose cameras of its parent it has; None: as given."""
        return None

    def splits(self, scene):
        """Splits of which there are renders."""
        return SPLITS

    def can_export(self, scene):
        """Whether what is corrected is of use to another program."""
        return True

    def before(self, scene):
        """The verdict.json of earlier renders, with which these are compared."""
        return None

    def faults(self, scene):
        """(key, fault) of what a scene's keys ask of each other, besides the usual."""
        return ()


@functools.cache
def every():
    """{name: record} of all sources, in the order in which folders are recognised."""
    found = extensions.registered(captures, "captures", "CAPTURE")
    return {record.name: record for record in found}


def of(scene):
    """The record of a scene: of its source, or of crops of such."""
    source = every()[scene.source]
    return crops.Crops(source) if scene.crop else source


def detected(folder):
    """The record that a folder is of; None where there is none.

    Raises ValueError where a folder is nearly an app's or COLMAP's, and says what is
    missing.
    """
    for way in ("detect", "detect_late"):
        for record in every().values():
            if getattr(record, way)(folder):
                record.check(folder)
                return record
    return None
