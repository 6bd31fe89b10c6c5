"""Are the settings that facts decide right? Against fixed ones, short and long.

Each training is a process of its own on one scene, scored on its test views; all of a
scene run one after the other. A row for each setting, and one that holds what was
decided against the best of the fixed ones: at most 0.1 dB below it in 1.2 times its
seconds, or at most 0.3 dB in half of them.
"""

import json
import pathlib
import statistics
import tempfile

import yaml

from alignerf import evaluate, testsets
from alignerf.experiment import check, plan
from alignerf.metrics import image as image_metrics
from alignerf.scenes import prepared
from tools.bench import measure, split

COURTYARD = {"source": "courtyard", "downscale": 2}
# Of COLMAP's or LLFF's poses, which have points or bounds; paths lie in the data.
SCENES = {
    "courtyard": COURTYARD,
    "courtyard, twice as wide": COURTYARD | {"downscale": 1},
    "courtyard, half as wide": COURTYARD | {"downscale": 4},
    "courtyard, 20 views": COURTYARD | {"test_every": 8, "courtyard": {"views": 20}},
    "fox": {
        "source": "photos",
        "path": "scenes/fox/images",
        "downscale": 4,
        "colmap": {"max_size_px": 960},
    },
    "flower": {"source": "llff", "path": "scenes/flower", "downscale": 4},
    "treehill": {"source": "photos", "path": "scenes/treehill/images", "downscale": 2},
}
FIXED_STEPS = (2000, 8000)
TINY = {"views": 16, "width": 128, "height": 112}
QUICK = {"courtyard": COURTYARD | {"poses": "truth", "courtyard": TINY}}
CLOSE_DB, CLOSE_TIMES = 0.1, 1.2
NEAR_DB, NEAR_TIMES = 0.3, 0.5


def run(options):
    """Rows: dB of each setting on each scene; and whether the decided one will do."""
    rows, steps = [], (4,) if options.quick else FIXED_STEPS
    for name, scene in (QUICK if options.quick else SCENES).items():
        if "path" in scene:
            scene = scene | {"path": str(options.data.resolve() / scene["path"])}
            if not pathlib.Path(scene["path"]).is_dir():
                note = f"skipped: no {scene['path']}"
                rows.append(measure.Row(name, "dB", None, note=note))
                continue
        found = {}
        for setting, point in trainings(name, scene, steps, options):
            found[setting] = point
            rows.append(row_of(name, setting, point))
            print(rows[-1].what, rows[-1].ours.median, rows[-1].note, flush=True)
        rows.append(judged(name, found))
    return rows


def trainings(name, scene, steps, options):
    """(setting, what its training took and came to), the decided one first."""
    folder = (
        options.out.resolve() / "scenes" / name.replace(", ", "_").replace(" ", "_")
    )
    experiment = plan.Experiment(check.checked(config_of(scene)))
    if not (folder / "poses.json").exists():
        split.stage(
            "alignerf.poses", config=plan.scene_config(experiment, "s"), out=folder
        )
    facts, out = folder / "facts.json", folder / "decisions.json"
    split.stage("alignerf.facts", scene=folder, facts=facts, decisions=out)
    test_set = "oracle" if (folder / "images" / "truth").is_dir() else "standard"
    chosen = {"decide": True} | ({"training": {"steps": 4}} if options.quick else {})
    settings = {"decided": chosen}
    settings |= {f"{count} steps": {"training": {"steps": count}} for count in steps}
    for setting, config in settings.items():
        experiment = plan.Experiment(check.checked(config_of(scene) | config))
        job = experiment.at("s", "mipnerf360", 0).job.model_dump()
        if job["decisions"]:
            job["decisions"] = str(out)
        yield setting, train(job, folder, test_set)


def train(job, scene, test_set):
    """What a training took, and the PSNR of its renders of the test views."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        shared = {"config": json.dumps(job), "scene": scene.resolve()}
        split.stage(
            "alignerf.train",
            **shared,
            checkpoints=folder / "checkpoints",
            learnt=folder / "learnt",
            timing=folder / "timing.json",
        )
        split.stage(
            "alignerf.render_views",
            **shared,
            model=folder / "learnt" / "model.msgpack",
            splits="test",
            renders=folder / "renders",
            timing=folder / "render",
        )
        timing = json.loads((folder / "timing.json").read_text())
        psnr_db = mean_psnr_db(scene, folder / "renders/test", test_set)
    names = ("steps", "train_time_s")
    return {name: timing[name] for name in names} | {"psnr_db": psnr_db}


def mean_psnr_db(scene, renders, test_set):
    """Mean over the test views, as `evaluate` scores them."""
    loaded = prepared.load(scene)
    truth = scene / "images" / "truth" if test_set == "oracle" else None
    views = []
    for view in loaded.views("test"):
        target, valid = testsets.named(test_set).make(
            evaluate.View(loaded, view, None, truth)
        )
        (render,) = prepared.read_images(loaded, [view], renders)
        views.append(image_metrics.psnr_db(target, render, valid))
    return statistics.mean(views)


def config_of(scene):
    """A config of this scene alone, made of text as a user's."""
    return yaml.safe_load(json.dumps({"scenes": {"s": scene}}))


def row_of(name, setting, point):
    """What one training came to."""
    note = f"{point['steps']} steps, {point['train_time_s']:.0f} s"
    return measure.Row(
        f"{name}, {setting}", "dB", measure.one(point["psnr_db"]), note=note
    )


def judged(name, found):
    """1 where the decided settings are as good as the best fixed ones, else 0."""
    decided, fixed = found["decided"], [p for s, p in found.items() if s != "decided"]
    best = max(fixed, key=lambda point: point["psnr_db"])
    below_db = best["psnr_db"] - decided["psnr_db"]
    times = decided["train_time_s"] / best["train_time_s"]
    close = below_db <= CLOSE_DB and times <= CLOSE_TIMES
    near = below_db <= NEAR_DB and times <= NEAR_TIMES
    return measure.Row(
        what=f"{name}: decided against the best fixed setting",
        unit="1",
        ours=measure.one(close or near),
        goal=measure.Goal("ours", ">=", 1.0),
        note=f"{-below_db:+.2f} dB in {times:.2f} of its seconds",
    )
