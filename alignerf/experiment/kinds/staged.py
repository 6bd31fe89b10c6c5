"""Staged: AligNeRF pre-trains as a plain method does, then fine-tunes by patches.

Methods of a model share the pre-training. Between the stages cameras may be put right.
"""

from alignerf.experiment import slices
from alignerf.experiment.trainings import DISPLACED, corrected, from_photos


def takes(method):
    """A method with `alignerf`."""
    return bool(method["alignerf"])


def trainings(experiment, scene, name, once):
    """The fine-tuning, which the pre-training leads to."""
    method = experiment.methods[name]
    job = slices.pretraining(experiment, scene, name)
    pretrained = once(from_photos(scene, f"pretrain/{method['model']}", job))
    more, flows = {}, []
    if corrects(method):
        more["cameras"] = corrected(pretrained)
        flows.append(pretrained)
    if method["alignerf"]["radius_px"] == "auto":
        measured = experiment.at(scene, experiment.baseline(name), 0)
        more["displacement"] = f"{measured.path}/{DISPLACED.format(split='train')}"
        flows.append(measured)
    job = slices.finetuning(experiment, scene, name)
    more |= {"initial": pretrained.model, "after": (pretrained,)}
    tuned = from_photos(scene, f"{name}/round0", job, flows=tuple(flows), **more)
    return [once(tuned)]


def corrects(method):
    """Whether cameras are put right between the stages."""
    return method["changes"] != "photos"


def moves(method, round):
    return ["cameras"] * corrects(method)


def words(experiment, name):
    """The contributions that the method has."""
    method = experiment.methods[name]
    settings = method["alignerf"]
    parts = ["cameras put right"] if corrects(method) else []
    if settings["convolution"]:
        parts.append(f"{settings['features']} features")
    if settings["radius_px"] != 0:
        parts.append("aligned" if settings["matching"] == "patch" else "contextual")
    if settings["error"] != "squared":
        parts.append(settings["error"])
    if settings["frequency_weight"] > 0:
        weights = experiment.config["frequency_weights"]
        parts.append("VGG-19" if weights else "derivative bank")
    return parts
