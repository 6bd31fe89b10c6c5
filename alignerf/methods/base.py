"""What a method's record has: defaults of all that the program asks of a method."""

import functools
import importlib
import shutil
from typing import Literal

from alignerf import methods
from alignerf.experiment import jobs, trainings
from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys.key import Keys, key


class Common(Keys):
    """Keys of every method, which stand before those of the records."""

    model: str | None = key(None, "a key of models; null takes the first")
    rounds: int = key(
        0,
        "rounds of render, flow, fix and training after the first training",
        least=0,
        most=16,
    )
    lengths: list[float] | None = key(
        None,
        "those of `vary.lengths` at which it is scored; null: all",
        above=0,
        most=1000,
        length=(1, 100),
    )
    changes: Literal["photos", "cameras"] = key(
        "photos",
        "what a round fixes by the flow: photos are warped, as in the paper, or "
        "training cameras are corrected",
    )


PUBLISHED = key(
    None,
    "name of the method in results/published; `snakemake comparison` shows the scores "
    "printed for it",
    pattern=r"\S",
)


class Method:
    """A method's record: an instance of a class of its own, called METHOD in its file.

    key: the key of a method in the config by which it is of this record. Keys: the
    class of what stands there; annotation, field: its type and meaning, if it is of no
    class. order: of the keys in a config. beside: the keys of a method that may stand
    beside its own. systems: the kinds of model that it trains; None: all.
    """

    key = None
    Keys = None
    what = ""
    order = 0
    beside = ("model", "published", "lengths")
    systems = None
    # Classes of its own that its jobs have, see `experiment.jobs`.
    jobs = ()
    # Whether our code trains it, from scratch so that others are set against it.
    ours = True
    from_scratch = False
    # Whether it aligns itself while it trains, which the verdict then judges.
    in_loop = False

    @property
    def example(self):
        """YAML: the least that a config says of it, beside a method called `plain`."""
        return f"{self.key}: {{}}" if self.key else "{}"

    @property
    def annotation(self):
        return self.Keys | None

    @property
    def field(self):
        first_line = (self.Keys.__doc__ or self.key).split("\n")[0]
        return key(None, self.what or first_line)

    def check_beside(self, config, name):
        """ValueError for a key that means nothing beside the record's own."""
        method, common = config.methods[name], Common()
        for other, value in method:
            may = other in (self.key, *self.beside)
            if not may and value and value != getattr(common, other, None):
                fault(f"methods.{name}.{other}", f"not beside {self.key}")
        if not self.ours:
            return
        if method.model not in config.models:
            fault(f"methods.{name}.model", f"no model {method.model!r}")
        kind = config.models[method.model].kind
        if self.systems and kind not in self.systems:
            fault(f"methods.{name}.{self.key}", f"not of a model of kind {kind}")

    def check(self, config, name):
        """ValueError for what it cannot have in a complete config."""

    def trainings(self, experiment, scene, name, once):
        """The trainings of its rounds, round 0 first; here one in one go.

        once: gives the equal training that another method has made already.
        """
        job = trainings.common(experiment, scene, name)
        if self.jobs:
            job |= {self.key: getattr(experiment.methods[name], self.key)}
        (kind,) = self.jobs or [jobs.Full]
        job = kind(**job)
        own = methods.input_cameras(experiment, scene, name)
        own |= {"truth": experiment.truth_of(scene)}
        return [once(trainings.from_photos(scene, f"{name}/round0", job, **own))]

    def cameras(self, experiment, scene):
        """{"cameras": path} that its training begins with, if not the scene's."""
        return {}

    def baseline(self, experiment, name):
        """The method whose round 0 it is set against; itself where there is none."""
        model = experiment.methods[name].model
        plain = experiment.names("from_scratch")
        same = (n for n in plain if experiment.methods[n].model == model)
        return next(same, name)

    def moves(self, method, round):
        """What it has changed by a round: `cameras`, `photos`; None: by its last."""
        return frozenset()

    def subject(self, experiment, name):
        """What tables say first: the field that it trains."""
        model = experiment.config.models[experiment.methods[name].model]
        field = getattr(model, "field", model)
        hashed = getattr(field, "log2_hashmap_size", None)
        size = f"2^{hashed}" if hashed else getattr(field, "width", "")
        aliased = [] if getattr(field, "anti_aliased", True) else ["aliased"]
        return [f"{field.kind} {size}".strip(), *aliased]

    def words(self, experiment, name):
        """What tables say of it besides."""
        return []


class Part:
    """What a job adds to a training; this adds nothing.

    data_loss: (rendering, photo [n, 3], weight [n]) -> mean over n rays drawn one by
    one, as those of `rays.rendering`; None: the system's own. patches: keys as of
    `staged.Finetuning`, of rays that are drawn by patches instead; patch_losses, of
    these: (rgb [n, p, p, 3], photo [n, q, q, 3], exists [n, q, q]) -> ({term: mean},
    {number to show, as mse: mean}); photo lies around the patch, q = p + 2 radius_px,
    and exists is zero where it does not count.
    """

    data_loss = patches = patch_losses = None

    def __init__(self, job):
        self.job = job

    def wrapped(self, method, loaded, learning):
        """The `training.methods.Method` that is trained on a scene.

        learning: whether what it learns besides, as cameras, is learnt now.
        """
        return method

    def aligner(self, loaded, photos, folder):
        """What stops the loop and aligns; None: nothing does. folder: checkpoints."""
        return None

    def moved(self, loaded, params, aligner):
        """The scene with the cameras that the training ends with."""
        return loaded

    def write(self, folder, given, moved, aligner, views, cameras):
        """Write the cameras that renders are seen by, and photos that were warped.

        given, moved: the scene before and after; cameras: the file of the former.
        """
        shutil.copyfile(cameras, folder / "cameras.npz")


@functools.cache
def part_of(job) -> Part:
    """The part of a job, imported by its name; one of equal jobs, as losses are.

    `experiment.sources` follows the import statements of a file, and a change of the
    flow package must not rerun the trainings that align nothing.
    """
    if not job.part:
        return Part(job)
    module, _, name = job.part.partition(":")
    return getattr(importlib.import_module(module), name)(job)
