"""A training is a value: what it computes, from what, and where it lies.

Two methods share a training when their values are equal. Rules, costs and exports walk
over `Training.after`.
"""

from typing import Any, NamedTuple

from alignerf.experiment import layout
from alignerf.io.environment import extensions


class Training(NamedTuple):
    """One run of `alignerf.train`, or of another program's (`alignerf.external.train`).

    folder: of its own, below results/SCENE/. job: a `jobs.Job`, its slice of the
    config. photos, cameras: what it learns from. valid: folder of the pixels that count
    there; None: all do. initial: the parameters that it goes on from. truth: the
    folder its cameras are compared with. after: the trainings that lead to it, whose
    costs are its own too.
    """

    scene: str
    folder: str
    job: Any
    photos: str
    cameras: str
    valid: str | None = None
    initial: str | None = None
    truth: str | None = None
    after: tuple["Training", ...] = ()

    def __hash__(self):
        """Of the fields that differ most: `after` is a long way down."""
        return hash((self.scene, self.folder, self.job, self.photos, self.cameras))

    @property
    def flows(self):
        """Those of `after` whose training views are rendered and aligned for it.

        It learns from photos that they warped, or with cameras that they corrected.
        """
        own = {self.photos, self.cameras}
        return [one for one in self.after if own & {warped(one), corrected(one)}]

    @property
    def path(self):
        """Its folder."""
        return layout.training(self.scene, self.folder)

    @property
    def owner(self):
        """The method that it has its name from; `pretrain` is none."""
        return self.folder.partition("/")[0]

    @property
    def value(self):
        """What equal trainings have in common: all but the folder."""
        return self._replace(folder="")

    @property
    def records(self):
        """Modules that what runs its job imports by name: its classes, and its part."""
        job, aligns = self.job, self.job.aligns
        part = [job.part.partition(":")[0]] if job.part else []
        own = extensions.modules("estimators", aligns.estimator) if aligns else []
        return [type(job).__module__, type(job.model).__module__, *part, *own]

    @property
    def warped(self):
        """{"photos": folder, "valid": folder} that it has learnt from, if warped."""
        if self.valid:
            return {"photos": self.photos, "valid": self.valid}
        if "photos" in self.job.moves:
            return {name: f"{self.path.learnt}/{name}" for name in ("photos", "valid")}
        return {}

    def inputs(self):
        """{name: path} of what it reads besides the scene's own files."""
        names = ("photos", "cameras", "valid", "initial", "truth")
        paths = {name: getattr(self, name) for name in names}
        return {name: path for name, path in paths.items() if path}


def from_photos(scene, folder, job, **more):
    """A training on the photos as taken, with the cameras as given."""
    at = layout.Scene(scene)
    cameras = more.pop("cameras", at.cameras)
    return Training(scene, folder, job, at.images, cameras, **more)


def warped(training):
    """The training photos that a training's flow has warped."""
    return f"{training.path.warped}/train"


def corrected(training):
    """cameras.npz of a training, corrected by its flow."""
    return training.path.corrected


def lead_to(training):
    """What comes before a training, directly or not, in an order, and the training."""
    way = {}

    def go(one):
        if one not in way:
            for before in one.after:
                go(before)
            way[one] = None

    go(training)
    return list(way)


def rendered_for(training):
    """Trainings whose training views are rendered and aligned in the loop to one."""
    flows = (before for one in lead_to(training) for before in one.flows)
    return list(dict.fromkeys(flows))


def moved_for(training):
    """Those of them whose cameras are then corrected by their flow."""
    learnt_with = {one.cameras for one in lead_to(training)}
    return [one for one in rendered_for(training) if corrected(one) in learnt_with]


def common(experiment, scene, method):
    """What all jobs have: the values of `jobs.Job`, of a training in one go."""
    config, chosen = experiment.config, experiment.scenes[scene]
    model = config.models[experiment.methods[method].model]
    return {
        "seed": chosen.seed,
        "model": model_of(model, chosen),
        "training": training_of(config, chosen, model),
        "decisions": decisions_of(config, scene),
        "scaled": is_open(config.training),
    }


def model_of(model, scene):
    """A model as a job has it: its training is the job's, its background a scene's.

    Transparent pixels stand on the scene's background, so a model that leaves its own
    open knows it.
    """
    found = {"training": model.default("training")}
    if getattr(model, "background", "") is None:
        found["background"] = scene.background
    return model.model_copy(update=found)


def is_open(training):
    """Whether facts decide the length of a complete config's training."""
    return training.steps is training.budget_min is None


def decisions_of(config, scene):
    """The file that says what a scene's facts decided; null where nothing is left."""
    left = is_open(config.training) or any(one.open for one in config.models.values())
    return layout.Scene(scene).decisions if left else None


def training_of(config, scene, model):
    """The config's training with a model's changes, as long as model or scene asks."""
    found, changes = config.training, model.training.given
    steps, budget_min = scene.steps, scene.budget_min
    if own := changes.pop("steps", None):
        steps, budget_min = own, None
    if not budget_min:
        steps = steps or found.whole
    return retimed(found, steps, budget_min).model_copy(update=changes)


def retimed(training, steps, budget_min=None):
    """Of another length; a given warm-up keeps its share of the steps, where known."""
    warmup_steps, whole = training.warmup_steps, training.whole
    if warmup_steps and steps and whole:
        warmup_steps = round(warmup_steps / whole * steps)
    found = {"steps": steps, "budget_min": budget_min, "warmup_steps": warmup_steps}
    return training.model_copy(update=found)
