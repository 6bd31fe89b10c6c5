"""Jobs of a training: itself, its renders, their flow, their parts, their scores."""

from alignerf import testsets
from alignerf.experiment import layout, sources, trainings
from alignerf.experiment.step import Step, estimator_of, flow_options, words


def train(experiment, w):
    """A training; of an external method its commands, of finished renders nothing."""
    training, scene = experiment.training(w.scene, w.training), layout.Scene(w.scene)
    at, read = training.path, training.inputs()
    inputs = read | {"given": scene.cameras, "images": scene.images}
    options = {"config": training.job.text, "scene": scene} | read
    options |= {"learnt": at.learnt, "timing": at.timing}
    asked = asks(experiment, training)
    if not training.job.ours:
        seed = experiment.scenes[w.scene].seed
        command = words("alignerf.external.train", **options, training=at, seed=seed)
        return Step(command, inputs, records=[experiment.source_of(w.scene)], **asked)
    command = words("alignerf.train", **options, checkpoints=f"{at}/checkpoints")
    inputs["decisions"] = trainings.decisions_of(experiment.config, w.scene)
    own = {"weights": training.job.weights}
    return Step(command, inputs, own, experiment.records_of(training), **asked)


def asks(experiment, training):
    """Threads, accelerators and memory of a training, or of its rendering."""
    if not experiment.capture(training.scene).trains:
        return {"threads": sources.WHOLE_MACHINE}
    if not training.job.ours:
        keys = experiment.methods[training.owner].external
        found = {"gpu": keys.gpu, "memory_mb": keys.mem_mb}
        return found | {"threads": sources.OF_TRAINING}
    gpus = sources.gpus(experiment.config)
    return {"gpu": gpus, "threads": sources.OF_TRAINING}


def render(experiment, w):
    """Renders of test views, and of training views where their flow is asked for."""
    training, scene = experiment.training(w.scene, w.training), layout.Scene(w.scene)
    at = training.path
    options = {"scene": scene, "splits": experiment.splits(w.scene, w.training)}
    options |= {"renders": at.renders, "depth": at.depth, "timing": at.render}
    inputs, own = {"learnt": at.learnt, "cameras": scene.cameras}, {}
    records = [experiment.source_of(w.scene)]
    if not experiment.capture(w.scene).trains:
        inputs["images"] = scene.images
        command = words("alignerf.external.render", **options)
    elif not training.job.ours:
        external = training.job.external
        folders = (external.renders, external.depth)
        own["finished"] = [f.replace("{scene}", w.scene) for f in folders if f]
        options |= {"config": training.job.text, "cameras": at.cameras, "training": at}
        command = words("alignerf.external.render", **options)
    else:
        inputs["decisions"] = trainings.decisions_of(experiment.config, w.scene)
        options |= {
            "config": training.job.text,
            "cameras": at.cameras,
            "model": at.model,
        }
        command, records = words("alignerf.render_views", **options), training.records
    return Step(command, inputs, own, records, **asks(experiment, training))


def align(experiment, w):
    """Flow from renders to photos, and the photos warped onto the renders.

    Always from the original photo, so that nothing compounds over the rounds. Where
    the truth is known, also the flow from test renders to it.
    """
    scene, at = layout.Scene(w.scene), layout.training(w.scene, w.training)
    method, _, round = w.training.partition("/round")
    splits = experiment.splits(w.scene, w.training)
    inputs = {"renders": at.renders, "depth": at.depth, "photos": scene.images}
    known = experiment.has_truth(w.scene) and "test" in splits
    command = words(
        "flow.align",
        **inputs,
        **flow_of(experiment, scene=w.scene, method=method, round=round),
        masks=f"{scene.images}/masks",
        oracle=f"{scene.truth}/oracle" if known else None,
        splits=splits,
        flow_out=at.flow,
        warped_out=at.warped,
        stats_out=at.displacement,
    )
    records, threads = estimator_of(experiment), threads_of_views(experiment, w)
    return Step(command, inputs, records=records, threads=threads)


def threads_of_views(experiment, w):
    """All, where nothing else runs beside the flow and its parts."""
    return 1 if experiment.capture(w.scene).trains else sources.WHOLE_MACHINE


def flow_of(experiment, **names):
    """The same for renders of these names, whose flows may come from elsewhere."""
    flow, found = experiment.config.flow, flow_options(experiment)
    if flow.estimator != "files":
        return found
    folder = flow.folder.format(**{"split": "{split}"} | names)
    return found | {"method": "files", "flows": folder}


def testset(experiment, w):
    """The warped test set, made by the reference model for all methods."""
    scene = layout.Scene(w.scene)
    at = experiment.reference_folder(w.scene)
    method = experiment.config.reference.method
    names = {"scene": w.scene, "method": method, "split": "test"}
    command = words(
        "flow.align",
        **flow_of(experiment, **names, round=experiment.reference_round(w.scene)),
        renders=f"{at.renders}/test",
        depth=f"{at.depth}/test",
        photos=scene.images,
        masks=f"{scene.images}/masks",
        flow_out=scene.testset_flow,
        warped_out=scene.testset_warped,
        stats_out=scene.testset_lengths,
    )
    inputs = {"renders": at.renders, "depth": at.depth, "photos": scene.images}
    return Step(command, inputs, records=estimator_of(experiment))


def control_sets(experiment, w):
    """What of the warped test set's gain is not alignment."""
    scene = layout.Scene(w.scene)
    renders = experiment.reference_folder(w.scene).renders
    inputs = {"photos": scene.images, "flow": scene.testset_flow}
    inputs["truth"] = experiment.truth_of(w.scene)
    command = words(
        "flow.control_sets",
        **flow_options(experiment),
        **inputs,
        renders=f"{renders}/test",
        masks=f"{scene.images}/masks",
        out=scene.testset,
    )
    inputs["renders"] = renders
    return Step(command, inputs, records=estimator_of(experiment))


def control_folders(scene):
    """Folders of images beside the warped test set, of a `layout.Scene`."""
    return [f"{scene.testset}/{name}" for name in testsets.image_folders()]


def overfit(experiment, w):
    """What the estimator invents in judged scenes, which have no test sets."""
    scene, at = layout.Scene(w.scene), layout.training(w.scene, w.training)
    split = experiment.splits(w.scene, w.training)[0]
    inputs = {"renders": f"{at.renders}/{split}", "photos": scene.images}
    inputs["flow"] = f"{at.flow}/{split}"
    options = flow_options(experiment) | {"masks": f"{scene.images}/masks"}
    command = words("flow.control_sets", **options, **inputs, lengths=at.overfit)
    records = estimator_of(experiment)
    return Step(command, inputs, records=records, threads=sources.WHOLE_MACHINE)


def correct_poses(experiment, w):
    """Cameras of a training, corrected by what their motion explains of its flow."""
    scene, at = layout.Scene(w.scene), layout.training(w.scene, w.training)
    inputs = {"flow": f"{at.flow}/train", "depth": f"{at.depth}/train"}
    inputs["truth"] = experiment.truth_of(w.scene)
    command = words(
        "alignerf.correct_poses",
        **inputs,
        scene=scene,
        cameras=at.cameras,
        out=at.corrected,
        report=at.corrections,
    )
    inputs |= {"learnt": at.learnt, "cameras": scene.cameras}
    return Step(command, inputs, threads=sources.WHOLE_MACHINE)


def decompose(experiment, w):
    """What the misalignment of views is made of: the camera's part and the rest.

    Of test views for the tables, less the model's own part where the truth is known.
    For the verdict (`_photos`) as anybody's photos allow it: by the cameras of the
    renders, of all views that are aligned.
    """
    scene, at = layout.Scene(w.scene), layout.training(w.scene, w.training)
    known = experiment.has_truth(w.scene) and not w.photos
    cameras = at.cameras if w.photos else scene.cameras
    inputs = {"renders_depth": f"{at.depth}/{w.split}", "flow": f"{at.flow}/{w.split}"}
    command = words(
        "flow.decompose",
        **inputs,
        model_flow=f"{at.flow}/oracle" if known else None,
        cameras=cameras,
        split=w.split,
        out_flow=at.parts(w.split, w.photos),
        stats_out=at.decomposition(w.split, w.photos),
    )
    inputs["cameras"] = cameras
    return Step(command, inputs, threads=threads_of_views(experiment, w))


def align_test_poses(experiment, w):
    """Test views by cameras that are moved until they fit their photos."""
    training, scene = experiment.training(w.scene, w.training), layout.Scene(w.scene)
    at = training.path
    truth = experiment.truth_of(w.scene)
    command = words(
        "alignerf.align_test_poses",
        config=training.job.text,
        scene=scene,
        model=at.model,
        cameras=at.cameras,
        depth=f"{at.depth}/test",
        renders=f"{at.renders}/test",
        flow=f"{at.flow}/test",
        truth=truth,
        truth_flow=f"{at.flow}/oracle" if truth else None,
        out=at.aligned_pose,
    )
    inputs = {"learnt": at.learnt, "depth": at.depth, "flow": at.flow, "truth": truth}
    inputs |= {"renders": at.renders, "photos": scene.images, "cameras": scene.cameras}
    inputs["decisions"] = trainings.decisions_of(experiment.config, w.scene)
    gpus = sources.gpus(experiment.config)
    asked = {"gpu": gpus, "threads": sources.OF_TRAINING}
    return Step(command, inputs, records=training.records, **asked)


def evaluate(experiment, w):
    """Scores of test views in all test sets; by moved cameras a file of their own.

    Renders by moved cameras are scored on the photos alone, and in PSNR alone.
    """
    scene, at = layout.Scene(w.scene), layout.training(w.scene, w.training)
    own, inputs = {}, {"truth": experiment.truth_of(w.scene)}
    options = {"scene": scene} | inputs
    if w.moved:
        options["aligned_pose"] = inputs["renders"] = at.aligned_pose
    else:
        lpips = experiment.config.lpips
        own["weights"] = [path for _, path in lpips if path]
        options |= {f"lpips_{net}": path for net, path in lpips}
        options["renders"] = inputs["renders"] = f"{at.renders}/test"
        options["testset"] = scene.testset
        inputs["testset"] = [scene.testset_flow, scene.testset_warped]
        inputs["testset"] += control_folders(scene)
    inputs |= {"images": scene.images, "cameras": scene.cameras}
    metrics = at.metrics_aligned_pose if w.moved else at.metrics
    return Step(words("alignerf.evaluate", **options, metrics=metrics), inputs, own)
