"""Input files and command-line options of the rules that train, score and export."""

from alignerf import methods, testsets
from alignerf.experiment import (
    arguments,
    layout,
    plan,
    sources,
    targets,
    trainings,
)
from alignerf.methods import rounds


def is_given(experiment, folder):
    """Whether a folder below results/SCENE/ is of a method whose renders are given."""
    return folder.partition("/")[0] in experiment.names("trains", False)


def renders_of(experiment, scene, folder, moved=""):
    """The folder of the renders that are scored: a training's, or another program's.

    moved: `_aligned_pose` for renders by moved cameras, else "". It is the wildcard in
    metrics{moved}.csv.
    """
    if is_given(experiment, folder):
        method = experiment.methods[folder.partition("/")[0]]
        return method["renders"].replace("{scene}", scene)
    return f"results/{scene}/{folder}/{'aligned_pose' if moved else 'renders/test'}"


def decisions_of(experiment, scene):
    """The path of decisions.json, or [] where the config leaves no setting open."""
    return trainings.decisions_of(experiment.config, scene) or []


def of_poses(experiment, scene, local):
    """{name: path} of the inputs of rule `poses`; local: of a path in no storage.

    Windows of another scene have the photos that it has, and what was made of it.
    """
    paths = experiment.capture(scene).paths(experiment.scenes[scene])
    found = {k.replace(".", "_"): local(path) for k, path in paths.items() if path}
    if whole := experiment.parent(scene):
        found |= {"whole": f"results/{whole}/images"}
        found |= {"report": f"results/{whole}/poses.json"}
        found["cameras"] = layout.output_of(cameras_of(experiment, scene))
        if places := places_of(experiment, scene):
            found["places"] = [f"{places}/images", f"{places}/poses.json"]
    return found


def places_of(experiment, scene):
    """The folder of windows with cameras as given, at whose places others lie too."""
    windows = experiment.windows(experiment.parent(scene))
    given = [name for name in windows if experiment.cameras_by(name) is None]
    return f"results/{given[0]}" if given and scene not in given else None


def cameras_of(experiment, scene):
    """The file of the cameras that windows of another scene have."""
    whole, method = experiment.parent(scene), experiment.cameras_by(scene)
    if method is None:
        return f"results/{whole}/cameras.npz"
    return f"{last_training(experiment, whole, method).learnt}/cameras.npz"


def poses_options(experiment, scene):
    """Options of `alignerf.poses`: of windows, the whole scene and its cameras."""
    whole = experiment.parent(scene)
    if whole is None:
        return ["--adjust"] * adjusts(experiment, scene)
    cameras = cameras_of(experiment, scene)
    places = places_of(experiment, scene)
    chosen = {"whole": f"results/{whole}", "cameras": cameras, "places": places}
    return arguments.options(chosen)


def adjusts(experiment, scene):
    """Whether a method of a scene begins with adjusted cameras that are not its own."""
    return any(
        methods.input_cameras(experiment, scene, name) for name in experiment.methods
    )


def truth_of(experiment, scene):
    """{"truth": folder} of the scene's truth; {} where the truth is not known."""
    truth = experiment.truth_of(scene)
    return {"truth": truth} if truth else {}


def of_training(experiment, scene, folder):
    """{name: path} of the inputs of rule `train`: outputs of other rules."""
    training = experiment.training(scene, folder)
    needed = layout.outputs_of(training.inputs())
    needed |= {
        "decisions": decisions_of(experiment, scene),
        "given": f"results/{scene}/cameras.npz",
        "images": f"results/{scene}/images",
    }
    return needed


def training_options(experiment, scene, folder):
    """Options of `alignerf.train` that name the photos, cameras and other inputs."""
    training = experiment.training(scene, folder)
    return arguments.options({"scene": f"results/{scene}"} | training.inputs())


def of_external(experiment, scene, folder):
    """{name: path} of the inputs of rule `external_data`."""
    training = experiment.training(scene, folder)
    own = {"images": f"results/{scene}/images", "given": f"results/{scene}/cameras.npz"}
    return layout.outputs_of(training.inputs()) | own


def external_options(experiment, scene, folder):
    """Options of `alignerf.others.data`: photos and cameras, seed of the points."""
    words = arguments.options(experiment.training(scene, folder).inputs())
    return [*words, "--seed", str(experiment.scenes[scene]["seed"])]


def external_data(experiment, scene, folder):
    """What another program learns from; [] of finished renders, which need none."""
    training = experiment.training(scene, folder)
    return [] if training.job.external.renders else f"{training.path}/data"


def external_folders(experiment, scene, folder):
    """Folders of finished renders and of their depth, on the disk; [] of commands."""
    chosen = experiment.training(scene, folder).job.external
    found = filter(None, (chosen.renders, chosen.depth))
    return [path.replace("{scene}", scene) for path in found]


def external_keys(experiment, folder):
    """The key `external` of the method that a training is named after."""
    return experiment.methods[folder.partition("/")[0]]["external"]


def weights_of(experiment, scene, folder):
    """[file] of the VGG-19 weights of a fine-tuning's frequency loss; [] without."""
    weights = experiment.training(scene, folder).job.weights
    return [weights] if weights else []


def threads_of_views(experiment, scene):
    """Threads of the flow and its parts: all, where nothing else runs beside it."""
    return 1 if experiment.capture(scene).trains else sources.WHOLE_MACHINE


def last_training(experiment, scene, method):
    """The training of a method's last round."""
    return experiment.at(scene, method, experiment.last_round(scene, method))


def of_export(experiment, scene, method, what):
    """{name: path} of the inputs of rules `export_photos`, `export_cameras`.

    what: `cameras` exports photos as taken, `photos` the warped photos.
    """
    cameras, warped = exported(experiment, scene, method, what)
    inputs = {"learnt": cameras} | held_out_of(experiment, scene, method, what) | warped
    if method in experiment.names("in_loop"):
        inputs["verdict"] = f"results/{scene}/verdict.json"
    return layout.outputs_of(inputs)


def exported(experiment, scene, method, what):
    """(cameras.npz, {"photos": folder, "valid": folder} where warped) of an export.

    What a method's last round learnt from; of renders that are judged, what a next
    training is to learn from.
    """
    training = last_training(experiment, scene, method)
    if not experiment.capture(scene).trains:
        following = rounds.after(training, training.folder, training.job, what)
        return following.cameras, following.warped
    warped = training.warped if what == "photos" else {}
    return f"{training.learnt}/cameras.npz", warped


def is_adjusted(training):
    """Whether a training's cameras are the adjusted ones, and nothing more."""
    adjusted = training.cameras == layout.adjusted(training.scene, "train.npz")
    return adjusted and "cameras" not in training.job.moves


def held_out_of(experiment, scene, method, what):
    """{"flow": folder, "depth": folder} of test views whose cameras are to be fitted.

    Those that the others have left behind, where the config wants them fitted by flow.
    With "corrected_by", a report, where that flow is of the renders before the others
    were put right.
    """
    training, fits = last_training(experiment, scene, method), None
    capture = experiment.capture(scene)
    if not capture.trains:
        splits = capture.splits(experiment.scenes[scene])
        fits = what == "cameras" and "test" in splits
    elif targets.moves_cameras(training) and not is_adjusted(training):
        fits = experiment.config["aligned_pose"]
    if not fits:
        return {}
    found = {name: f"{training.path}/{name}/test" for name in ("flow", "depth")}
    by = {"corrected_by": f"{training.path}/{trainings.CORRECTED}"}
    return found if capture.trains else found | by


def export_options(experiment, scene, method, what):
    """Options of `alignerf.export`: sizes, cameras, warped photos, held-out views."""
    training = last_training(experiment, scene, method)
    cameras, warped = exported(experiment, scene, method, what)
    chosen = {
        "config": plan.scene_config(experiment, scene),
        "width": experiment.config["export_width_px"],
        "cameras": cameras,
    }
    if warped:
        chosen |= {"warped": warped["photos"], "valid": warped["valid"]}
        # Photos that a training has warped on its way are warped by the usual kernel.
        by_flow = training.valid or not experiment.capture(scene).trains
        chosen |= {"kernel": by_flow and experiment.config["flow"]["kernel"]}
    words = arguments.options(chosen)
    if held_out := held_out_of(experiment, scene, method, what):
        words += ["--fit-held-out", held_out["flow"], held_out["depth"]]
        words += arguments.options({"corrected-by": held_out.get("corrected_by")})
    judged = not experiment.capture(scene).trains
    if (judged and what == "cameras") or is_adjusted(training):
        words += ["--adjusted", layout.adjusted(scene)]
    if method in experiment.names("in_loop"):
        # Where the verdict says that alignment gained nothing, exports are as given.
        words += ["--if-pays", f"results/{scene}/verdict.json", training.owner]
    return words


def testset_of(scene, moved):
    """The folder of the warped test set; None for renders by moved cameras."""
    return None if moved else f"results/{scene}/testset"


def of_scores(experiment, scene, folder, moved):
    """{name: path} of inputs of rule `evaluate` besides renders: truth, test sets."""
    inputs = truth_of(experiment, scene)
    if testset := testset_of(scene, moved):
        sets = ("flow", "warped", *testsets.image_folders())
        inputs |= {name: f"{testset}/{name}" for name in sets}
    return inputs


def scores_options(experiment, scene, folder, moved):
    """Options of `alignerf.evaluate`: renders, test sets, LPIPS.

    Renders by moved cameras are scored in PSNR alone, so LPIPS is left out.
    """
    renders = renders_of(experiment, scene, folder, moved)
    chosen = {"aligned-pose" if moved else "renders": renders}
    chosen["testset"] = testset_of(scene, moved)
    words = arguments.options(chosen | truth_of(experiment, scene))
    return words + ([] if moved else arguments.lpips_options(experiment))
