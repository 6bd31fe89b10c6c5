"""Command-line options of the flow's settings, and the files that it reads."""

from alignerf.experiment import trainings
from alignerf.files import split_paths


def option(name, value):
    """`--name value` for a shell line, nothing where there is no value."""
    return [f"--{name}", str(value)] if value else []


def options(values):
    """`--name value` for each of {name: value}."""
    return [part for name, value in values.items() for part in option(name, value)]


def lpips_options(experiment):
    """Command line of the networks of LPIPS whose weights the config names."""
    found = experiment.config["lpips"].items()
    return [part for net, path in found for part in option(f"lpips-{net}", path)]


def estimator_options(experiment):
    """Command line of the estimator's settings, without the name of `files`.

    Images that the run itself makes have no flows from elsewhere: with estimator
    `files`, theirs are estimated by the default one.
    """
    flow = experiment.config["flow"]
    blur = "--match-blur" if flow["match_blur"] else "--no-match-blur"
    pairs = {"--kernel": flow["kernel"], "--tolerance-px": flow["tolerance_px"]}
    if flow["estimator"] != "files":
        pairs["--method"] = flow["estimator"]
    if flow["blur_by"]:
        pairs["--blur-by"] = flow["blur_by"]
    return [blur, *(str(part) for pair in pairs.items() for part in pair)]


def of_views(experiment, scene, method, round, split=split_paths.MARK):
    """Command line of the flow's settings, for the views that it is estimated of."""
    flow, found = experiment.config["flow"], estimator_options(experiment)
    if flow["estimator"] != "files":
        return found
    names = {"scene": scene, "method": method, "round": round, "split": split}
    folder = flow["folder"].format(**names)
    return [*found, "--method", "files", "--flows", folder]


def of_training_views(experiment, scene, folder):
    """The same for the views of a training, by its folder below the scene's."""
    method, _, round = folder.partition("/")
    if method != "pretrain":
        round = round.removeprefix("round")
    return of_views(experiment, scene, method, round)


def of_reference(experiment, scene):
    """The same for the warped test set."""
    method = experiment.config["reference"]["method"]
    round = experiment.reference_round(scene)
    return of_views(experiment, scene, method, round, "test")


def of_rounds(experiment, scene, method, round):
    """What says whether to go on: the training views' flow after a round, and before.

    Of cameras, the correction that another round would train with.
    """
    k, flow = int(round), "flow/train"
    found = {}
    if k > 0:
        # The decision is the method's own, also where it starts from another's round.
        found["before"] = f"results/{scene}/{method}/round{k - 1}/decision.json"
    training, following = (experiment.at(scene, method, n) for n in (k, k + 1))
    if following.cameras == trainings.corrected(training):
        return found | {"corrections": f"{training.path}/{trainings.CORRECTED}"}
    found["flow"] = f"{training.path}/{flow}"
    if k > 0:
        found["before-flow"] = f"{experiment.folder(scene, method, k - 1)}/{flow}"
    return found


def of_oracle(experiment, input, output):
    """Command line of the flow from render to oracle, and of where it is written."""
    return [
        *estimator_options(experiment),
        *option("oracle", f"{input.truth}/oracle"),
        *option("renders", f"{input.renders}/test"),
        *option("model-flow", output.model),
        *option("model-stats", output.model_stats),
    ]


def aligned_pose_inputs(experiment, scene, folder):
    """What moves a training's test cameras: flows, one to the truth for the overfit."""
    path = f"results/{scene}/{folder}"
    inputs = {"flow": f"{path}/flow/test"}
    if experiment.has_truth(scene):
        inputs["truth-flow"] = f"{path}/flow_oracle/test"
    return inputs
