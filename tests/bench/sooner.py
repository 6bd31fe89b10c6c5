"""Quality against training seconds: the defaults as they were and as they are.

Each point of a curve is a training of its own, with a schedule that ends there, in its
own process as the workflow starts it; old and new take turns within a seed and a
budget. Seconds are those of the training's steps; compilation, which no cache
shortens, stands apart. Beside the rows: sooner_curves.csv, written anew after each
training, and sooner.png.

With --before, a checkout of the program at an older commit (the defaults changed after
6aa0b72), the old settings are trained by its code; else by today's, with the old
numbers.

Poses are made once and kept in scenes/ beside the results. After a change of how they
are made, remove the scene's folder there.
"""

import json
import pathlib
import statistics
import tempfile

from alignerf import evaluate
from alignerf.command import machine
from alignerf.experiment import slices
from alignerf.metrics import image as image_metrics
from alignerf.scenes import prepared
from tests.bench import cases, curves, measure, report, sooner_settings, split

SEEDS = (0, 2, 3)
QUICK_BUDGETS = (1,)
# Nothing is read off a longer training of an MLP, and one takes minutes.
MOST_OF_MLPS = 1
PAIRS = (("old", "new"), ("mlp_old", "mlp_new"))
# What the old defaults come to on fox.
FOX_DB = 25.2

# Names of the comparisons.
GAIN = "dB above {old} in the seconds of its 1 x"
SAME = "seconds to the dB of {old}'s 1 x, of {old}'s"
BEST = "seconds to the dB of {old}'s 4 x, of {old}'s"
FIXED = f"seconds to {FOX_DB:g} dB, of {{old}}'s 1 x"
# By scene, newer setting and comparison.
GOALS = {
    ("courtyard", "new", GAIN): measure.Goal("ours", ">=", 1.4),
    ("courtyard", "new", BEST): measure.Goal("ours", "<=", 0.5),
    ("fox", "new", FIXED): measure.Goal("ours", "<=", 1 / 3),
    ("courtyard", "mlp_new", SAME): measure.Goal("ours", "<=", 1.0),
}


def run(options):
    """Rows: PSNR by scene, setting and budget, then new against old."""
    options.out.mkdir(parents=True, exist_ok=True)
    points, skipped = [], []
    with tempfile.TemporaryDirectory() as scratch:
        for name in ["tiny"] if options.quick else options.scenes:
            if note := missing(name, options):
                skipped.append(measure.Row(name, "dB", None, note=note))
                continue
            for point in trainings(name, options, pathlib.Path(scratch)):
                points.append(point)
                print(" ".join(map(str, point)), flush=True)
                curves.write(options.out / "sooner_curves.csv", points)
    if points:
        curves.draw(options.out / "sooner.png", points)
    return [*point_rows(points), *comparisons(points), *skipped]


def missing(name, options):
    """Why a scene cannot be had; nothing where it can."""
    path = not options.quick and sooner_settings.CASES[name].scene.get("path")
    if path and not (options.data / path).is_dir():
        return f"skipped: no {path} in {options.data}"
    return ""


def trainings(name, options, scratch):
    """The points of a scene: in each seed and budget, each setting in its turn."""
    seeds = SEEDS[:1] if options.quick else SEEDS[: options.repeats]
    for seed in seeds:
        if options.quick:
            folder, jobs = scratch / "tiny", sooner_settings.quick_jobs()
            cases.write_scene(folder, cases.orbit(width=16, height=16))
            test_set = "standard"
        else:
            experiment = sooner_settings.experiment_of(name, seed, options.data)
            folder = posed(name, seed, experiment, options.out.resolve())
            jobs = sooner_settings.jobs_of(name, experiment, seed)
            test_set = sooner_settings.CASES[name].test_set
        for budget in QUICK_BUDGETS if options.quick else options.budgets:
            for setting, job in jobs.items():
                if budget > MOST_OF_MLPS and setting.startswith("mlp"):
                    continue
                place = {"scene": name, "setting": setting, "seed": seed}
                job = sooner_settings.with_budget(job, budget)
                root = root_of(setting, options)
                found = train(root, job, folder, test_set)
                yield curves.Point(**place, budget=budget, test_set=test_set, **found)


def posed(name, seed, experiment, out):
    """The scene's folder with images and poses, made where it is not there yet."""
    made_by_seed = sooner_settings.CASES[name].made_by_seed
    folder = out / "scenes" / (f"{name}_seed{seed}" if made_by_seed else name)
    if not (folder / "poses.json").exists():
        config = slices.of_scene(experiment, name)
        split.stage("alignerf.poses", config=config, out=folder)
    return folder


def root_of(setting, options):
    """The checkout that trains a setting: for the old ones that of --before."""
    return options.before if "old" in setting and options.before else measure.ROOT


def train(root, job, scene, test_set):
    """What a training took, and the PSNR of its renders of the test views."""
    if root != measure.ROOT:
        job = sooner_settings.as_known_before(job)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        shared = {"root": root, "config": json.dumps(job), "scene": scene.resolve()}
        shared["model"] = folder / "model.msgpack"
        split.stage(
            "alignerf.train",
            **shared,
            checkpoints=folder / "checkpoints",
            timing=folder / "timing.json",
        )
        split.stage(
            "alignerf.render_views",
            **shared,
            split="test",
            renders=folder / "renders",
            timing=folder / "render.json",
        )
        timing = json.loads((folder / "timing.json").read_text())
        psnr_db = mean_psnr_db(scene, folder / "renders", test_set)
    names = ("steps", "rays_seen", "train_time_s", "compile_time_s")
    found = {name: timing[name] for name in names}
    return found | {"threads": machine.cores(), "psnr_db": psnr_db}


def mean_psnr_db(scene, renders, test_set):
    """Mean over the test views, as `evaluate` scores them."""
    loaded = prepared.load(scene)
    truth = scene / "truth" if test_set == "oracle" else None
    found = []
    for view in loaded.views("test"):
        target, valid = evaluate.targets_of(loaded, view, None, truth)[test_set]
        (render,) = prepared.read_images(loaded, [view], renders)
        found.append(image_metrics.psnr_db(target, render, valid))
    return statistics.mean(found)


def point_rows(points):
    """A row for each scene, setting and budget: dB over the seeds, and what it took."""
    curves_of = list(dict.fromkeys((p.scene, p.setting) for p in points))
    kinds = dict.fromkeys((p.scene, p.setting, p.budget) for p in points)
    for kind in sorted(kinds, key=lambda kind: (curves_of.index(kind[:2]), kind[2])):
        scene, setting, budget = kind
        found = [p for p in points if (p.scene, p.setting, p.budget) == kind]
        first = found[0]
        seconds, compile_s = (
            report.text(measure.spread(getattr(p, name) for p in found))
            for name in ("train_time_s", "compile_time_s")
        )
        yield measure.Row(
            what=f"{scene}, {setting}, {budget:g} x",
            unit="dB",
            ours=measure.spread(p.psnr_db for p in found),
            note=f"{first.test_set}, {first.steps} steps, {first.rays_seen:,} rays, "
            f"{seconds} s, compile {compile_s} s",
        )


def comparisons(points):
    """Rows of new against old, paired by seed, where both have the budgets."""
    for scene in dict.fromkeys(p.scene for p in points):
        for old, new in PAIRS:
            seeds = {
                p.seed: [by_budget(points, scene, s, p.seed) for s in (old, new)]
                for p in points
                if (p.scene, p.setting) == (scene, new)
            }
            for name, (budget, compare) in COMPARISONS.items():
                if name == FIXED and scene != "fox":
                    continue
                if seeds and all(budget in curve for curve, _ in seeds.values()):
                    found = {seed: compare(*pair) for seed, pair in seeds.items()}
                    yield comparison(scene, old, new, name, found)


def comparison(scene, old, new, name, found):
    """A row of {seed: (value or None, note)}; empty where a seed has no value."""
    values = [value for value, _ in found.values()]
    notes = [f"seed {seed}: {note}" for seed, (_, note) in found.items() if note]
    return measure.Row(
        what=f"{scene}, {new}: {name.format(old=old)}",
        unit="dB" if name == GAIN else "1",
        ours=None if None in values else measure.spread(values),
        goal=GOALS.get((scene, new, name)),
        note="; ".join(notes),
    )


def by_budget(points, scene, setting, seed):
    """{budget: point} of one curve."""
    chosen = (scene, setting, seed)
    return {p.budget: p for p in points if (p.scene, p.setting, p.seed) == chosen}


def gain(old, new):
    """(dB above old's 1 x, note) of new in as many seconds.

    Where new's own 1 x takes no longer, its dB count; else those on its curve.
    """
    target = old[1]
    if new[1].train_time_s <= target.train_time_s:
        return new[1].psnr_db - target.psnr_db, ""
    found = curves.psnr_at(curves.curve_of(new.values()), target.train_time_s)
    if found is None:
        return None, "all of its trainings take longer"
    return found - target.psnr_db, ""


def share(new, psnr_db, seconds):
    """(new's seconds to these dB / seconds, note)."""
    curve = curves.curve_of(new.values())
    found = curves.seconds_to(curve, psnr_db)
    if found is None:
        best_db = max(point.psnr_db for point in new.values())
        return None, f"not reached: {best_db:.2f} of {psnr_db:.2f} dB"
    note = "at most" if curves.begins_above(curve, psnr_db) else ""
    return found / seconds, note


# Which budget of old's a comparison looks at, and what it comes to.
COMPARISONS = {
    GAIN: (1, gain),
    SAME: (1, lambda old, new: share(new, old[1].psnr_db, old[1].train_time_s)),
    BEST: (4, lambda old, new: share(new, old[4].psnr_db, old[4].train_time_s)),
    FIXED: (1, lambda old, new: share(new, FOX_DB, old[1].train_time_s)),
}
