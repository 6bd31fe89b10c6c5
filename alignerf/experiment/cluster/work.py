"""What a scene's plan has to do: for its cost, before any of it is done."""

import hashlib
import json
from pathlib import Path

from alignerf.experiment import arguments, plan, trainings
from alignerf.files import json_files


def of_scene(experiment, scene):
    """What `snakemake SCENE` has to do, as JSON can have it: for its cost.

    trainings, in an order in which they can run: `name`, the folder below the scene's;
    `job`, the slice; `external`, that it is another program's; `after`, names of those
    that it needs; `corrects`, whether cameras are put right for it; `renders`, the
    splits that are rendered and aligned; `scored`, whether its test views are.
    reference: by whose renders the test set is
    made; verdict: whose views the verdict looks at. windows: scenes of windows for the
    verdict, whose cost is counted here.

    With `rounds: auto` all rounds are counted that there may be, so that none has to be
    decided on. None where no cost is asked for (`preflight: false`), and for windows
    of another scene.
    """
    if not experiment.config["preflight"] or experiment.whole(scene) != scene:
        return None
    longest = plan.Experiment(experiment.config, lambda **place: True)
    root = f"results/{scene}/"
    every = longest.trainings(scene).values()
    return {
        "reference": longest.reference_folder(scene).removeprefix(root),
        "verdict": longest.reference_folder(scene, 0).removeprefix(root),
        "trainings": entries(longest, every),
        "given": len(longest.names("trains", False)),
        "aligned_pose": experiment.config["aligned_pose"],
        "truth": experiment.has_truth(scene),
        "flow": arguments.estimator_options(experiment),
    } | of_windows(experiment, scene)


def as_json(experiment, scene):
    """The same as text."""
    return json_files.canonical(of_scene(experiment, scene))


def of_windows(experiment, scene):
    """{"windows": entries} of a scene's windows; {} where it has none.

    name: of the scene; zoom: its key; steps: of its training; after: the training whose
    cameras it has, or None.
    """
    found = []
    for name in experiment.windows(scene):
        chosen = experiment.scenes[name]
        method = chosen["zoom"]["cameras"]
        found.append(
            {
                "name": name,
                "zoom": chosen["zoom"],
                "steps": chosen["steps"],
                "after": method and experiment.at(scene, method, 0).folder,
            }
        )
    return {"windows": found} if found else {}


def entries(experiment, every):
    """Entries of `of_scene`; cameras that several learn with are corrected once."""
    corrected, made = set(), []
    for training in every:
        new = training.cameras not in corrected
        made.append(one_of_work(experiment, training, new=new))
        corrected.add(training.cameras)
    return made


def one_of_work(experiment, training, *, new):
    """An entry of `of_scene`; new: nothing before it learns with its cameras."""
    needed = dict.fromkeys((*training.after, *training.flows))
    corrected = map(trainings.corrected, training.flows)
    splits = experiment.splits(training.scene, training.folder)
    return {
        "name": training.folder,
        "job": json.loads(training.job),
        **({"external": True} if training.external else {}),
        "after": [before.folder for before in needed],
        "corrects": new and training.cameras in corrected,
        "renders": splits,
        "scored": "test" in splits,
    }


def digest(found) -> str:
    """SHA-256 of what there is to do; what was measured for other work is old."""
    return hashlib.sha256(json_files.canonical(found).encode()).hexdigest()


class Digests:
    """The digest of what each scene of an experiment has to do, when asked for."""

    def __init__(self, experiment, results="results"):
        self.experiment, self.results, self.known = experiment, Path(results), {}

    def __getitem__(self, scene):
        if scene not in self.known:
            self.known[scene] = digest(of_scene(self.experiment, scene))
        return self.known[scene]

    def of_measured(self):
        """{scene: digest}; none where no cost was measured: many scenes take long."""
        return {
            scene: self[scene] if self.measured(scene) else ""
            for scene in self.experiment.scenes
        }

    def measured(self, scene):
        return (self.results / scene / "preflight.json").is_file()
