"""A training is a value: what it computes, from what, and where it lies.

Two methods share a training when their values are equal. Rules, costs and exports walk
over `Training.after`.
"""

from typing import Any, NamedTuple

from alignerf.experiment import layout


class Training(NamedTuple):
    """One run of `alignerf.train`, or of another program's (`alignerf.external.train`).

    folder: of its own, below results/SCENE/. job: a `jobs.Job`, its slice of the
    config. photos, cameras: what it learns from. valid: folder of the pixels that count
    there; None: all do. initial: the parameters that it goes on from. truth: the
    folder its cameras are compared with. after: the trainings that lead to it, whose
    costs are its own too. flows: the trainings whose training views are rendered and
    aligned for it.
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
    flows: tuple["Training", ...] = ()

    def __hash__(self):
        """Of the fields that differ most: `after` and `flows` are long ways down."""
        return hash((self.scene, self.folder, self.job, self.photos, self.cameras))

    @property
    def path(self):
        """Its folder."""
        return layout.training(self.scene, self.folder)

    @property
    def owner(self):
        """The method that it has its name from; `pretrain` is none."""
        return self.folder.partition("/")[0]

    @property
    def learnt(self):
        """Folder of the cameras that its renders are seen by, and of warped photos."""
        return self.path.learnt

    @property
    def model(self):
        """Its parameters."""
        return self.path.model

    @property
    def value(self):
        """What equal trainings have in common: all but the folder."""
        return self._replace(folder="")

    @property
    def modules(self):
        """Modules of the code that it runs; `train` imports the job's own by name."""
        own = [self.job.part.partition(":")[0]] if self.job.part else []
        return ["alignerf.train", *own]

    @property
    def warped(self):
        """{"photos": folder, "valid": folder} that it has learnt from, if warped."""
        if self.valid:
            return {"photos": self.photos, "valid": self.valid}
        if "photos" in self.job.moves:
            return {name: f"{self.learnt}/{name}" for name in ("photos", "valid")}
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


def corrected(training):
    """cameras.npz of a training, corrected by its flow."""
    return training.path.corrected


def lead_to(training):
    """The trainings in `after`, recursively, then the training itself."""
    return way_to(training, lambda one: one.after)


def needs(training):
    """The same with those of `flows`: all that is trained before it."""
    return way_to(training, lambda one: (*one.after, *one.flows))


def way_to(training, before):
    """What comes before a training, directly or not, in an order, and the training."""
    way = {}

    def go(one):
        if one not in way:
            for needed in before(one):
                go(needed)
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
    config = experiment.config
    model = config["models"][experiment.methods[method]["model"]]
    return {
        "seed": experiment.scenes[scene]["seed"],
        "model": model_of(model, experiment.scenes[scene]),
        "training": training_of(config, scene, model),
        "decisions": decisions_of(config, scene),
    }


def model_of(model, scene):
    """A model as a job has it: its training is the job's, its background a scene's.

    Transparent pixels stand on the scene's background, so a model that leaves its own
    open knows it.
    """
    found = model | {"training": {}}
    if found.get("background", "") is None:
        found["background"] = scene["background"]
    return found


def decisions_of(config, scene):
    """The file that says what a scene's facts decided; null where nothing is left."""
    open_keys = [config["training"]["decided"]]
    open_keys += [model.get("decided") for model in config["models"].values()]
    return layout.Scene(scene).decisions if any(open_keys) else None


def training_of(config, scene, model):
    """The config's training with a model's changes, as long as model or scene asks."""
    found, chosen = config["training"], config["scenes"][scene]
    steps, budget_min = chosen["steps"], chosen["budget_min"]
    if own := model["training"].get("steps"):
        steps, budget_min = own, None
    changes = {k: v for k, v in model["training"].items() if k != "steps"}
    return found | retimed(found, steps, budget_min) | changes


def retimed(training, steps, budget_min=None):
    """Another length; a given warm-up keeps its share of the steps, where known."""
    warmup_steps = training["warmup_steps"]
    if warmup_steps and steps and training["steps"]:
        warmup_steps = round(warmup_steps / training["steps"] * steps)
    return {"steps": steps, "budget_min": budget_min, "warmup_steps": warmup_steps}
