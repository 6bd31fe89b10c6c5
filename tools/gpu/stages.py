"""What `tools.gpu.ten_minutes` runs on the device; each adds rows to a CSV as it goes.

Trainings, renders and scores are those of the workflow, called as its jobs call them.
"""

import json
import subprocess
import sys
from pathlib import Path

import jax
import pandas as pd

from alignerf import evaluate, render_views, train
from alignerf.experiment import jobs
from alignerf.scenes import prepared
from alignerf.training import batches, compose, program, renderer
from tools.bench import cases, measure, multinerf, speed

TRAININGS = ("scene", "method", "seconds", "stage", "steps", "rays_per_step")
TRAININGS += ("rays_per_s", "train_s", "compile_s", "micro_batches", *measure.ORIGIN)
SCORES = ("scene", "method", "seconds", *evaluate.COLUMNS, *measure.ORIGIN)
SPLATS = ("scene", "steps", "psnr_db", "ssim", "lpips", "gaussians", *measure.ORIGIN)
# Seconds of a turn where a device is fast, and turns.
TURN_S, TURNS = 1.0, 3
# Of the paper's trainings.
STEPS = 250_000
# gsplat's trainer, in a checkout of it.
GSPLAT, GSPLAT_STEPS = Path("examples/simple_trainer.py"), 7000


def compile_training(config, scene):
    """Compile a job's steps, and the program that renders what it trains."""
    job, loaded = jobs.parse(json.loads(config)), prepared.load(scene)
    chosen = loaded.views("train")
    key, shapes = jax.random.key(job.seed), batches.view_shapes(loaded, chosen)
    # The second is that after its look at the photos.
    for learning in (False, True) if job.part and job.stage == "full" else (False,):
        method = compose.make_method(job, loaded, learning=learning)
        program.build(job, method, jax.eval_shape(method.init, key), shapes)
    method = compose.make_method(job, loaded)
    params = jax.jit(method.init)(key)
    renderer.compile_ahead(method, params, loaded.width, loaded.height)


def rates(out, config, peer, *, dry, grid, repeats=TURNS):
    """Rays/s of the published model beside multinerf's, or of a hash grid.

    config: the job of ours, whose batch both have. Returns why multinerf is not there.
    Without repeats all is compiled.
    """
    size = (16, 12) if dry else (400, 300)
    # How many steps there are changes no program.
    job = jobs.with_steps(jobs.parse(json.loads(config)), STEPS)
    if grid:
        case = speed.Case.of("hash grid", cases.GRID, job.rays_per_step, size)
        modules, why = None, ""
    else:
        photos = cases.orbit(width=size[0], height=size[1])
        model = cases.TINY if dry else cases.PUBLISHED
        case = speed.Case("published size", job, photos, model)
        modules, why = peer_of(peer)
    for row in speed.rows(case, modules, repeats=repeats, least_s=0 if dry else TURN_S):
        row["note"] += f", no multinerf ({why})" * bool(why)
        measure.append(out / speed.FILE, measure.RATES, row)
    return why and f"no multinerf: {why}"


def peer_of(path):
    """(modules of multinerf or None, why not)."""
    if not path:
        return None, "no --peer"
    try:
        return multinerf.load(path), ""
    except ValueError as error:
        return None, str(error)


def method(out, scene, chain, names):
    """Train a method's jobs, one from another, then score its renders of test views.

    chain: (job as JSON, folder of its own, that of its initial parameters or None) of
    each; one that was trained before is not trained again. names: {column: value}.
    """
    origin = measure.origin()
    for config, at, initial in chain:
        made = at / "job.json"
        if made.is_file() and made.read_text() == config:
            continue
        words = {"config": config, "scene": scene, "checkpoints": at / "checkpoints"}
        words |= {"learnt": at / "learnt", "timing": at / "timing.json"}
        if initial:
            words["initial"] = initial / "learnt" / "model.msgpack"
        train.main(words_of(words))
        timing, job = json.loads((at / "timing.json").read_text()), json.loads(config)
        row = names | origin | {"stage": job["stage"], "steps": timing["steps"]}
        row["rays_per_step"] = timing["rays_seen"] // timing["steps"]
        row["rays_per_s"] = round(timing["rays_seen"] / timing["train_time_s"])
        row |= {
            "train_s": timing["train_time_s"],
            "compile_s": timing["compile_time_s"],
        }
        row["micro_batches"] = timing["micro_batches"]
        measure.append(out / "trainings.csv", TRAININGS, row)
        made.write_text(config)
    words = {"scene": scene, "config": config, "model": at / "learnt" / "model.msgpack"}
    words |= {"cameras": at / "learnt" / "cameras.npz", "splits": "test"}
    render_views.main(words_of(words | {"renders": at, "timing": at / "rendering"}))
    words = {"scene": scene, "renders": at / "test", "metrics": at / "metrics.csv"}
    if (truth := scene / "images" / "truth").is_dir():
        words["truth"] = truth
    if (lpips := scene.parent / "lpips_alex.npz").is_file():
        words["lpips-alex"] = lpips
    evaluate.main(words_of(words))
    scores = pd.read_csv(at / "metrics.csv", keep_default_na=False)
    for row in scores.to_dict("records"):
        measure.append(out / "scores.csv", SCORES, names | origin | row)


def words_of(options):
    """{option: value} as a command's arguments."""
    return [str(word) for key, value in options.items() for word in (f"--{key}", value)]


def splat(out, folder, at, gsplat):
    """gsplat's own training of an export, every eighth photo held out, and its scores.

    Returns why there is none.
    """
    trainer = gsplat and Path(gsplat).resolve() / GSPLAT
    if not trainer or not trainer.is_file():
        return f"no gsplat: {gsplat or 'no --gsplat'} has no {GSPLAT}"
    command = [sys.executable, str(trainer), "default", "--disable_viewer"]
    command += ["--data_dir", str(folder), "--data_factor", "1"]
    command += ["--result_dir", str(at), "--max_steps", str(GSPLAT_STEPS)]
    command += ["--eval_steps", str(GSPLAT_STEPS), "--disable_video"]
    subprocess.run(command, cwd=trainer.parent, check=True)
    found = json.loads((at / "stats" / f"val_step{GSPLAT_STEPS - 1}.json").read_text())
    keys = {"psnr_db": "psnr", "ssim": "ssim", "lpips": "lpips", "gaussians": "num_GS"}
    row = {name: found.get(key) for name, key in keys.items()}
    row |= {"scene": folder.name, "steps": GSPLAT_STEPS}
    measure.append(out / "splats.csv", SPLATS, row | measure.origin())
    return ""
