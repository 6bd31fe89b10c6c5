"""What a scene's plan has to do: for its cost, before any of it is done."""

import hashlib
import json
from pathlib import Path

from alignerf.experiment import flows, plan, slices


def of_scene(experiment, scene):
    """What `snakemake SCENE` has to do, as JSON can have it: for its cost.

    trainings, in an order in which they can run: `name`, the folder below the scene's;
    `job`, the slice; `after`, names of those that it needs; `corrects`, whether cameras
    are put right for it; `renders`, the splits that are rendered and aligned;
    `scored`, whether its test views are. reference: by whose renders the test set is
    made; verdict: whose views the verdict looks at.

    With `rounds: auto` all rounds are counted that there may be, so that none has to be
    decided on. None where no cost is asked for (`preflight: false`).
    """
    if not experiment.config["preflight"]:
        return None
    longest = plan.Experiment(experiment.config, lambda **place: True)
    root = f"results/{scene}/"
    return {
        "reference": longest.reference_folder(scene).removeprefix(root),
        "verdict": longest.reference_folder(scene, 0).removeprefix(root),
        "trainings": [
            *pretrainings(longest, scene),
            *(training(longest, scene, *one) for one in longest.all_rounds(scene)),
        ],
        "given": len(longest.given()),
        "aligned_pose": experiment.config["aligned_pose"],
        "truth": experiment.has_truth(scene),
        "flow": flows.estimator_options(experiment),
    }


def pretrainings(experiment, scene):
    """The stage that staged methods of a model share, of each of their models."""
    corrected = {experiment.pretrained(scene, m) for m in experiment.correcting()}
    users = {experiment.methods[m]["model"]: m for m in experiment.staged()}
    found = []
    for model, method in users.items():
        folder = experiment.pretrained(scene, method)
        job = json.loads(slices.of_pretraining(experiment, scene, model))
        splits = ["train"] if folder in corrected else []
        found.append(one_of_work(scene, folder, job, renders=splits, scored=False))
    return found


def training(experiment, scene, method, round):
    """A method's round, after the trainings that it learns from."""
    followed = experiment.followed()[method]
    after = []
    if round > 0:
        after.append(experiment.folder(scene, method, round - 1))
    if method in experiment.staged():
        after.append(experiment.pretrained(scene, method))
        if experiment.methods[method]["alignerf"]["radius_px"] == "auto":
            after.append(experiment.folder(scene, experiment.base_of(method), 0))
    corrects = experiment.change_of(method, round) == "cameras"
    return one_of_work(
        scene,
        experiment.folder(scene, method, round),
        slices.round_job(experiment, scene, method),
        after=after,
        corrects=corrects or method in experiment.correcting(),
        renders=["train", "test"] if round in followed else ["test"],
        scored=True,
    )


def one_of_work(scene, folder, job, *, after=(), corrects=False, renders, scored):
    """An entry of `of_scene`, whose names are folders without the scene's."""
    root = f"results/{scene}/"
    return {
        "name": folder.removeprefix(root),
        "job": job,
        "after": [before.removeprefix(root) for before in after],
        "corrects": corrects,
        "renders": renders,
        "scored": scored,
    }


def digest(found) -> str:
    """SHA-256 of what there is to do; what was measured for other work is old."""
    return hashlib.sha256(slices.as_json(found).encode()).hexdigest()


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
