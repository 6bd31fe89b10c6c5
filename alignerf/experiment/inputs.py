"""What the rules of trainings, scores and exports wait for, and how it is passed on."""

import json

from alignerf.experiment import arguments, kinds, layout, slices, sources


def is_given(experiment, folder):
    """Whether a folder below a scene's is an external method's."""
    return folder.partition("/")[0] in experiment.names(kinds.external)


def renders_of(experiment, scene, folder, moved=""):
    """The folder of the views that are scored: a training's, or another program's.

    moved: whether they are those by moved cameras, as the name of their scores has it.
    """
    if is_given(experiment, folder):
        method = experiment.methods[folder.partition("/")[0]]
        return method["renders"].replace("{scene}", scene)
    return f"results/{scene}/{folder}/{'aligned_pose' if moved else 'renders/test'}"


def decisions_of(experiment, scene):
    """What the scene's facts decided, where the config leaves something to them."""
    return slices.decisions_of(experiment.config, scene) or []


def truth_of(experiment, scene):
    """The oracle's folder, where the scene's truth is known."""
    truth = experiment.truth_of(scene)
    return {"truth": truth} if truth else {}


def of_training(experiment, scene, folder):
    """{name: path} of the outputs of rules that a training waits for."""
    training = experiment.training(scene, folder)
    needed = layout.outputs_of(training.inputs())
    needed |= {
        "decisions": decisions_of(experiment, scene),
        "given": f"results/{scene}/cameras.npz",
        "images": f"{training.prepared}/images",
    }
    if not training.alone:
        needed["preflight"] = f"results/{scene}/preflight.json"
    return needed


def training_options(experiment, scene, folder):
    """Options of `alignerf.train`: what the training learns from."""
    training = experiment.training(scene, folder)
    words = arguments.options({"scene": training.prepared} | training.inputs())
    if training.prepared != f"results/{scene}":
        words += arguments.option("seen-by", f"results/{scene}/cameras.npz")
    return words


def weights_of(experiment, scene, folder):
    """The file that a fine-tuning's loss looks through, where it has one."""
    finetuning = json.loads(experiment.training(scene, folder).job)["alignerf"]
    weights = finetuning and finetuning["frequency_weights"]
    return [weights] if weights else []


def threads_of(experiment, scene, folder):
    """Threads of a training and its rendering."""
    alone = experiment.training(scene, folder).alone
    return sources.WHOLE_MACHINE if alone else sources.OF_TRAINING


def last_training(experiment, scene, method):
    """The training of a method's last round."""
    return experiment.at(scene, method, experiment.last_round(scene, method))


def of_export(experiment, scene, method, what):
    """{name: output} of what is handed to other programs, `cameras` or `photos`."""
    training = last_training(experiment, scene, method)
    inputs = {"learnt": training.learnt}
    if what == "photos":
        inputs |= layout.outputs_of(training.warped)
    if method in experiment.names(kinds.aligned):
        inputs["verdict"] = f"results/{scene}/verdict.json"
    return inputs


def export_options(experiment, scene, method, what):
    """Options of `alignerf.export`: cameras, warped photos, and whether it paid."""
    training = last_training(experiment, scene, method)
    chosen = {"cameras": f"{training.learnt}/cameras.npz"}
    if what == "photos":
        chosen |= {"warped": training.warped["photos"]}
        chosen |= {"valid": training.warped["valid"]}
    words = arguments.options(chosen)
    if method in experiment.names(kinds.aligned):
        # Where aligning on the way brought nothing, cameras go out as given.
        words += ["--if-pays", f"results/{scene}/verdict.json", training.owner]
    return words


def testset_of(scene, folder, moved):
    """The warped test set, where renders are scored by it.

    A point of the sweep, and renders by moved cameras, are scored by the photos.
    """
    by_photos = moved or folder.startswith("tradeoff/")
    return None if by_photos else f"results/{scene}/testset"


def of_scores(experiment, scene, folder, moved):
    """{name: output} that scores need besides renders: the truth, and the test sets."""
    inputs = truth_of(experiment, scene)
    if testset := testset_of(scene, folder, moved):
        sets = ("flow", "warped", *arguments.CONTROL_SETS)
        inputs |= {name: f"{testset}/{name}" for name in sets}
    return inputs


def scores_options(experiment, scene, folder, moved):
    """Options of `alignerf.evaluate`: renders, test sets, LPIPS.

    Of renders by moved cameras PSNR alone is scored.
    """
    renders = renders_of(experiment, scene, folder, moved)
    chosen = {"aligned-pose" if moved else "renders": renders}
    chosen["testset"] = testset_of(scene, folder, moved)
    words = arguments.options(chosen | truth_of(experiment, scene))
    return words + ([] if moved else arguments.lpips_options(experiment))
