"""What the page of a scene is made from, besides the scene's tables."""

from alignerf import methods
from alignerf.experiment import arguments, inputs, layout, targets
from alignerf.experiment.tables import rows


def files(experiment, scene):
    """Outputs of rules: renders, flows, warped photos, truth, windows, cameras."""
    found = rows.of_verdict(experiment, scene)
    base = experiment.reference_folder(scene, 0)
    for split in ("train", "test"):
        if f"{split}_renders" in found:
            found[f"{split}_warped"] = f"{base}/warped/{split}"
    found |= inputs.truth_of(experiment, scene)
    if moved := moved_cameras(experiment, scene):
        found["moved"] = moved[1]
    return layout.outputs_of(found)


def of_windows(experiment, scene):
    """Outputs of rules that show windows at the photos' own size."""
    found = rows.files_of_windows(experiment, scene)
    named = rows.judging(experiment, scene).values()
    return list(dict.fromkeys([*found, *(f"results/{n}/images" for n in named)]))


def options(experiment, scene):
    """Options of `alignerf.page` that name windows and cameras that were put right."""
    judging = rows.judging(experiment, scene)
    chosen = {name: experiment.judged_folder(one) for name, one in judging.items()}
    if corrected := judging.get("windows-corrected"):
        chosen["windows-by"] = experiment.cameras_by(corrected)
    if moved := moved_cameras(experiment, scene):
        chosen |= {"moved-by": moved[0], "moved": moved[1]}
    return arguments.options(chosen)


def moved_cameras(experiment, scene):
    """(who put them right, cameras.npz) of a scene; None where no camera has moved.

    Of a method that aligns or learns its cameras, else of the reference's last round.
    Of renders that are judged: what the verdict's flow says of their cameras.
    """
    reference = experiment.config["reference"]["method"]
    capture = experiment.capture(scene)
    if not capture.trains:
        if not capture.can_export(experiment.scenes[scene]):
            return None
        return "flow", inputs.exported(experiment, scene, reference, "cameras")[0]
    chosen = {n: experiment.methods[n] for n in experiment.trained()}
    moving = [n for n, m in chosen.items() if "cameras" in methods.moves(m, 0)]
    moving.sort(key=lambda name: -methods.of_method(chosen[name]).order)
    for name in (*moving, *[reference] * (reference in chosen)):
        training = inputs.last_training(experiment, scene, name)
        if targets.moves_cameras(training):
            return name, f"{training.learnt}/cameras.npz"
    return None
