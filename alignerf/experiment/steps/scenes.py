"""Jobs of a scene: photos and cameras, tables and figures, verdict, page, exports."""

import json

from alignerf import methods
from alignerf.experiment import layout, plan, sources, targets, trainings
from alignerf.experiment.step import Step, words
from alignerf.experiment.tables import rows
from alignerf.experiment.tables import scenes as table_scenes
from alignerf.methods import rounds


def poses(experiment, w):
    """Photos in, undistorted images and cameras out; the truth where it is known.

    Crops of another scene have its photos and cameras.
    """
    paths = experiment.scenes[w.scene].paths()
    # What earlier renders were told is the verdict's.
    paths.pop("external_renders.before", None)
    own = {key.replace(".", "_"): path for key, path in paths.items()}
    options, inputs = {"config": plan.scene_config(experiment, w.scene)}, {}
    if parent := experiment.parent(w.scene):
        method, at = experiment.cameras_by(w.scene), layout.Scene(parent)
        cameras = last(experiment, parent, method).cameras if method else at.cameras
        options |= {"whole": at, "cameras": cameras}
        inputs = {"whole": at.images, "report": at.poses, "cameras": cameras}
        # Of crops by other cameras, those with cameras as given choose the places.
        crops = experiment.crops(parent)
        given = [name for name in crops if experiment.cameras_by(name) is None]
        if given and w.scene not in given:
            options["places"] = places = layout.Scene(given[0])
            inputs["places"] = [places.images, places.poses]
    else:
        names = experiment.methods
        adjusted = (methods.input_cameras(experiment, w.scene, n) for n in names)
        options["adjust"] = any(adjusted)
    command = words("alignerf.poses", **options, out=layout.Scene(w.scene))
    records = [experiment.source_of(w.scene)]
    return Step(command, inputs, own, records, threads=sources.WHOLE_MACHINE)


def last(experiment, scene, method):
    """The folder of a method's last round."""
    return last_training(experiment, scene, method).path


def last_training(experiment, scene, method):
    """The training of a method's last round."""
    return experiment.rounds_of(scene, method)[-1]


def prepared(scene):
    """{name: path} of what rule `poses` writes."""
    return {"images": scene.images, "cameras": scene.cameras, "poses": scene.poses}


def facts(experiment, w):
    """What a scene is, and the settings that this calls for."""
    scene = layout.Scene(w.scene)
    written = {"facts": scene.facts, "decisions": scene.decisions}
    return Step(words("alignerf.facts", scene=scene, **written), prepared(scene))


def preflight(experiment, w):
    """Minutes and memory of a scene's trainings, from a timed step of each."""
    scene = layout.Scene(w.scene)
    command = words("alignerf.costs", scene=scene, out=scene.preflight)
    inputs = {"images": scene.images, "cameras": scene.cameras}
    inputs["decisions"] = trainings.decisions_of(experiment.config, w.scene)
    gpus = sources.gpus(experiment.config)
    asked = {"threads": sources.WHOLE_MACHINE, "gpu": gpus}
    return Step(command, inputs, **asked)


def config(experiment, w):
    """What the config and the defaults come to, beside the results that they made."""
    complete = plan.complete_config(experiment, w.scene)
    command = words(
        "alignerf.config", config=complete, out=layout.Scene(w.scene).config
    )
    return Step(command, {})


def collect(experiment, w):
    """Scores and costs, a row each: of a scene's tables, or of one across scenes."""
    made, scene = (
        table_scenes.rows_of(experiment, w.scene, w.table),
        layout.Scene(w.scene),
    )
    written = {"scores": scene.scores(w.table), "trainings": scene.trainings(w.table)}
    command = words("alignerf.tables.collect", rows=rows.as_json(made), **written)
    return Step(command, {"files": rows.files_of(made)})


def tables(experiment, w):
    """A table of a scene, as CSV and LaTeX."""
    scene = layout.Scene(w.scene)
    command = words(
        "alignerf.tabulate",
        table=w.table,
        scenes=rows.as_json([table_scenes.of_scene(experiment, w.scene)]),
        configs=scene.config,
        out=f"{scene.tables}/{w.table}",
    )
    inputs = {"scores": scene.scores(), "trainings": scene.trainings()}
    return Step(command, inputs | {"config": scene.config})


def draw(experiment, w):
    """The figures of a scene."""
    scene, crops = layout.Scene(w.scene), compared(experiment, w.scene)
    shown, at = test_views(experiment, w.scene), experiment.reference_folder(w.scene)
    first = experiment.reference_folder(w.scene, 0)
    inputs = {"photos": scene.images, "curves": scene.scores()}
    inputs |= {"reference": f"{at}/renders/test", "parts": first.parts("test")}
    command = words(
        "flow.figures.scene",
        **inputs,
        testset=scene.testset,
        rounds=rows.as_json(shown),
        crops=rows.as_json(crops) if crops else None,
        out=scene.figures,
    )
    inputs["testset"] = [scene.testset_flow, scene.testset_lengths]
    return Step(command, inputs | {"views": rows.shown_in([*shown, *crops])})


def test_views(experiment, scene):
    """Test views of the reference round by round, then of others that fix, named."""
    if "test" not in experiment.capture(scene).splits(experiment.scenes[scene]):
        return []
    method = experiment.config.reference.method
    every = range(experiment.methods[method].rounds + 1)
    shown = [(experiment.folder(scene, method, k), None) for k in every]
    moved = [n for n in experiment.methods if experiment.moves(n, 0)]
    others = at_length(experiment, scene, [*experiment.names("in_loop"), *moved])
    for name in dict.fromkeys(others):
        shown.append((experiment.folder(scene, name, 0), name))
    return [rows.Renders(f"{f}/renders/test", f"{f}/flow/test", m) for f, m in shown]


def at_length(experiment, scene, methods):
    """Those of methods that are trained at a scene's length."""
    return [name for name in methods if experiment.is_scored(scene, name)]


def compared(experiment, scene):
    """Test views side by side: a baseline, the same warped, and what is set against it.

    Of all methods of ours that are no baseline; the reference's without such.
    """
    if "test" not in experiment.capture(scene).splits(experiment.scenes[scene]):
        return []
    ours = experiment.names("ours")
    others = [n for n in experiment.names("from_scratch", False) if n in ours]
    others = at_length(experiment, scene, others)
    bases = [experiment.baseline(method) for method in others]
    chosen = []
    for method in dict.fromkeys(bases or [experiment.config.reference.method]):
        chosen += [(method, k) for k in {0, experiment.methods[method].rounds}]
    chosen += [(method, 0) for method in dict.fromkeys(others) if method not in bases]
    found = []
    for method, k in chosen:
        at = experiment.folder(scene, method, k)
        name = method_name(method, k)
        found.append(rows.Renders(f"{at}/renders/test", f"{at}/flow/test", name))
    return found


def method_name(method, round):
    """How a figure calls a method after a round."""
    return f"{method}, round {round}" if round else method


def verdict(experiment, w):
    """What is wrong with a scene, in words; every photo, and why it stands out."""
    scene, capture = layout.Scene(w.scene), experiment.capture(w.scene)
    base = experiment.judged_folder(w.scene)
    aligned, corrected = {}, {}
    tells, own = {"overfit": scene.testset_overfit}, {}
    if not capture.trains:
        tells["overfit"] = base.overfit
        own["before"] = capture.before(experiment.scenes[w.scene])
        own |= {f"lpips_{net}": path for net, path in experiment.config.lpips if path}
    else:
        tells["misalignment"] = scene.misalignment
        for name in at_length(experiment, w.scene, experiment.names("in_loop")):
            aligned[name] = f"{experiment.folder(w.scene, name, 0)}/timing.json"
        corrected = corrections(experiment, w.scene)
    command = words(
        "alignerf.verdict",
        **tells,
        **own,
        scene=scene,
        base=experiment.reference_folder(w.scene, 0),
        aligned=json.dumps(aligned) if aligned else None,
        corrected=json.dumps(corrected) if corrected else None,
        **crops(experiment, w.scene),
        out=scene.verdict,
        views=scene.views,
        transients=scene.transients,
    )
    inputs = prepared(scene) | seen(experiment, w.scene) | tells
    inputs |= {"corrected": [*corrected.values()]}
    return Step(command, inputs | {"crops": seen_crops(experiment, w.scene)}, own)


def corrections(experiment, scene):
    """{method: cameras.npz} of the methods whose training has moved cameras."""
    if experiment.parent(scene):
        return {}
    return {
        name: experiment.folder(scene, name, 0).cameras
        for name in at_length(experiment, scene, experiment.methods)
        if "cameras" in experiment.moves(name, 0)
    }


def seen(experiment, scene):
    """{name: path} of what the verdict looks at: the reference's round 0, its flow."""
    at = experiment.judged_folder(scene)
    files = {"timing": at.timing}
    for split in experiment.splits(scene, at.name):
        files |= {
            f"{split}_renders": f"{at.renders}/{split}",
            f"{split}_depth": f"{at.depth}/{split}",
            f"{split}_flow": f"{at.flow}/{split}",
            f"{split}_lengths": f"{at.displacement}/{split}.csv",
            f"{split}_parts": at.parts(split, "_photos"),
            f"{split}_stats": at.decomposition(split, "_photos"),
        }
    return files


def judging(experiment, scene):
    """{option: scene} of the crops that a scene is judged by: one of each kind."""
    found = {}
    for name in experiment.crops(scene):
        moved = experiment.cameras_by(name) is not None
        found.setdefault("crops_corrected" if moved else "crops", name)
    return found if "crops" in found else {}


def crops(experiment, scene):
    """Options that name the trainings of these crops."""
    every = judging(experiment, scene).items()
    return {name: experiment.judged_folder(one) for name, one in every}


def seen_crops(experiment, scene):
    """What the verdict looks at of these crops."""
    files = []
    for name in judging(experiment, scene).values():
        one = layout.Scene(name)
        files += [*seen(experiment, name).values(), one.cameras, one.poses]
    return files


def page(experiment, w):
    """What a visitor opens: verdict, images, tables and costs in one file."""
    scene = layout.Scene(w.scene)
    shown, base = (
        test_views(experiment, w.scene),
        experiment.reference_folder(w.scene, 0),
    )
    options = crops(experiment, w.scene)
    by = judging(experiment, w.scene)
    if corrected := by.get("crops_corrected"):
        options["crops_by"] = experiment.cameras_by(corrected)
    moved_by, moved = moved_cameras(experiment, w.scene) or (None, None)
    command = words(
        "alignerf.page",
        **options,
        scene=scene,
        rounds=rows.as_json(shown),
        base=base,
        moved=moved,
        moved_by=moved_by,
        out=scene.page,
    )
    files = seen(experiment, w.scene)
    splits = [split for split in ("train", "test") if f"{split}_renders" in files]
    inputs = prepared(scene) | files
    inputs["warped"] = [f"{base}/warped/{split}" for split in splits]
    inputs["truth"], inputs["moved"] = experiment.truth_of(w.scene), moved
    inputs["crops"] = seen_crops(experiment, w.scene)
    inputs["photos"] = [layout.Scene(name).images for name in by.values()]
    inputs["preflight"] = targets.preflight_of(experiment, w.scene)
    inputs["tables"] = targets.of_page(experiment, w.scene)
    return Step(command, inputs | {"views": rows.shown_in(shown)})


def moved_cameras(experiment, scene):
    """(who moved them, cameras.npz) of a scene; None where no camera has moved.

    Of a method that aligns or learns its cameras, else of the reference's last round.
    Of renders that are judged: what the verdict's flow says of their cameras.
    """
    reference = experiment.config.reference.method
    capture = experiment.capture(scene)
    if not capture.trains:
        if not capture.can_export(experiment.scenes[scene]):
            return None
        return "flow", exported(experiment, scene, reference, "cameras")[0]
    known = at_length(experiment, scene, experiment.methods)
    moving = [name for name in known if "cameras" in experiment.moves(name, 0)]
    order = {n: methods.of_method(m).order for n, m in experiment.methods.items()}
    moving.sort(key=lambda name: -order[name])
    for name in (*moving, reference):
        training = last_training(experiment, scene, name)
        if targets.moves_cameras(training):
            return name, training.path.cameras
    return None


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
    return training.path.cameras, warped


def export_folder(experiment, w):
    """A folder for other programs: photos as taken (`cameras`) or warped (`photos`)."""
    scene, capture = layout.Scene(w.scene), experiment.capture(w.scene)
    training = last_training(experiment, w.scene, w.method)
    at = training.path
    cameras, warped = exported(experiment, w.scene, w.method, w.what)
    inputs = prepared(scene) | {"learnt": cameras} | warped
    options = {"config": plan.scene_config(experiment, w.scene), "cameras": cameras}
    options["width"] = experiment.config.export_width_px
    if warped:
        options |= {"warped": warped["photos"], "valid": warped["valid"]}
    adjusted = (
        training.cameras == scene.adjusted_train and "cameras" not in training.job.moves
    )
    # Held-out cameras that the others have left behind are fitted by flow. Where that
    # flow is of renders before the others were corrected, a report says so.
    as_given, fits = w.what == "cameras" and not capture.trains, None
    if not capture.trains:
        splits = capture.splits(experiment.scenes[w.scene])
        fits = as_given and "test" in splits
    elif targets.moves_cameras(training) and not adjusted:
        fits = experiment.config.aligned_pose
    if fits:
        held_out = [f"{at.flow}/test", f"{at.depth}/test"]
        options["fit_held_out"] = inputs["held_out"] = held_out
        if as_given:
            options["corrected_by"] = inputs["corrected_by"] = at.corrections
    if not capture.trains:
        options["transients"] = inputs["transients"] = scene.transients
    if adjusted or as_given:
        options["adjusted"] = scene.adjusted
    if w.method in experiment.names("in_loop"):
        # Where the verdict says that alignment gained nothing, exports are as given.
        options["if_pays"] = [scene.verdict, training.owner]
        inputs["verdict"] = scene.verdict
    out, records = scene.export(w.method, w.what), [experiment.source_of(w.scene)]
    command = words("alignerf.export", scene=scene, **options, out=out)
    return Step(command, inputs, records=records, threads=sources.WHOLE_MACHINE)
