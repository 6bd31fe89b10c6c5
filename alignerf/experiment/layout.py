"""Where all results lie: one list for rules, which give patterns, and for commands.

Rules name folders whose content differs from training to training: an entry for each
split that others need. Commands name what is inside.
"""

import re

RESULTS = "results"
# Renders of splats: no results of a scene have this name.
SPLATS = f"{RESULTS}/splats"


class Below:
    """A path below a folder."""

    def __init__(self, path):
        self.path = path

    def __get__(self, folder, owner=None):
        return f"{folder}/{self.path}"


class Folder(str):
    """A folder as text, with the logs and costs of the jobs that write into it."""

    __slots__ = ()

    def log(self, job):
        return f"{self}/logs/{job}.log"

    def benchmark(self, job):
        return f"{self}/logs/{job}.tsv"


class Scene(Folder):
    """The folder of a scene. `Scene("{scene}")` has the patterns of rules."""

    __slots__ = ()
    images = Below("images")
    # What is known of a synthetic scene alone.
    truth = Below("images/truth")
    # Cameras that bundle adjustment corrected: of all views, and with held-out ones as
    # they came; and what that took.
    adjusted = Below("images/adjusted/cameras.npz")
    adjusted_train = Below("images/adjusted/train.npz")
    adjusted_report = Below("images/adjusted/report.json")
    cameras = Below("cameras.npz")
    poses = Below("poses.json")
    facts = Below("facts.json")
    decisions = Below("decisions.json")
    config = Below("config.yaml")
    preflight = Below("preflight.json")
    verdict = Below("verdict.json")
    page = Below("index.html")
    tables = Below("tables")
    views = Below("tables/views.csv")
    transients = Below("transients.npz")
    misalignment = Below("tables/misalignment.csv")
    figures = Below("figures")
    # The warped test set, its flow, and how long that is.
    testset = Below("testset")
    testset_flow = Below("testset/flow")
    testset_warped = Below("testset/warped")
    testset_lengths = Below("testset/displacement.csv")
    testset_overfit = Below("testset/overfit.csv")

    def __new__(cls, name):
        return super().__new__(cls, f"{RESULTS}/{name}")

    def scores(self, table=""):
        """Scores of the scene's tables, or of a table across scenes (`comparison/`)."""
        return f"{self}/{table}scores.csv"

    def trainings(self, table=""):
        """Costs of trainings, likewise."""
        return f"{self}/{table}trainings.csv"

    def table(self, name, kind="csv"):
        return f"{self.tables}/{name}.{kind}"

    def figure(self, name):
        return f"{self.figures}/{name}.png"

    def export(self, method, what):
        """The folder for other programs."""
        return f"{self}/{method}/export/{what}"


class Training(Folder):
    """The folder of a training, by its path."""

    __slots__ = ()

    @property
    def name(self):
        """Its path below the scene's folder."""
        return self.split("/", 2)[2]

    timing = Below("timing.json")
    # Its model, the cameras that its renders are seen by, and photos that it warped.
    learnt = Below("learnt")
    cameras = Below("learnt/cameras.npz")
    model = Below("learnt/model.msgpack")
    # With an entry for each split.
    renders = Below("renders")
    depth = Below("depth")
    render = Below("render")
    flow = Below("flow")
    warped = Below("warped")
    displacement = Below("displacement")
    # Cameras that its flow corrects.
    corrected = Below("corrected/cameras.npz")
    corrections = Below("corrected/poses_corrected.json")
    aligned_pose = Below("aligned_pose")
    metrics = Below("metrics.csv")
    metrics_aligned_pose = Below("metrics_aligned_pose.csv")
    overfit = Below("overfit.csv")

    def rendered(self, split):
        """The report of its renders of a split."""
        return f"{self.render}/{split}.json"

    def lengths(self, split):
        """The lengths of their flow."""
        return f"{self.displacement}/{split}.csv"

    def parts(self, split, photos=""):
        """What its flow is made of; photos: by its own cameras, without the truth."""
        return f"{self}/parts{photos}/{split}"

    def decomposition(self, split, photos=""):
        """The statistics of these parts."""
        return f"{self}/decomposition{photos}_{split}.csv"


def training(scene, folder):
    """A training's folder, by its name below the scene's."""
    return Training(f"{Scene(scene)}/{folder}")


# Of a training's, with an entry for each split.
OF_SPLITS = ("renders", "depth", "render", "flow", "warped", "displacement")
INSIDE = re.compile(
    rf"({RESULTS}/.+/(?:{'|'.join(OF_SPLITS)}))/(?:train|test|oracle)(?:\.\w+)?"
    rf"|({RESULTS}/.+/learnt)/(?:cameras\.npz|model\.msgpack|photos|valid)"
    rf"|({RESULTS}/[^/]+/images)/.+"
)


def output_of(path):
    """The output of a rule that a path below results/ is, or lies in."""
    inside = INSIDE.fullmatch(path)
    return next(filter(None, inside.groups())) if inside else path


def outputs_of(paths):
    """The outputs of rules for several paths: {name: path}, or a list, each once."""
    if isinstance(paths, dict):
        return {name: output_of(path) for name, path in paths.items()}
    return list(dict.fromkeys(map(output_of, paths)))
