"""Many small trainings on one machine, a row for each held-out photo.

    python -m tools.bench.finer_trainings results/fox results/chair
        --methods plain aligned learnt --seeds 0 1 2 --steps 3000 --batch-rays 2048
        --jobs 12 --deadline-s 340 --out finer.csv

SCENE: folders as rule `poses` writes them. Each training is that of a config with
`decide: true` and the default model; a scene's decisions.json is taken, else made. As
in the workflow its test views are rendered, their flow taken, and both scored: as they
are (`standard`), and by cameras that are moved until they fit (`aligned_pose`).

Each of --jobs processes imports JAX once and takes one training after another; they
share an accelerator and the compiled programs. Seed by seed, so that a run that is cut
off has whole seeds. None begins that would end after --deadline-s if it took as long as
the last of its process; what still runs then is ended. Where OpenCV has no contributed
modules, DeepFlow is `tools.bench.deepflow`.
"""

import argparse
import contextlib
import csv
import itertools
import json
import multiprocessing
import os
import queue
import shutil
import sys
import time
import traceback
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from alignerf import facts
from alignerf.experiment import check, plan
from alignerf.io import faults, json_files, machine
from tools.bench import deepflow

METHODS = {"plain": {}, "aligned": {"align": {}}, "learnt": {"pose_optimization": {}}}
KEYS = ("scene", "method", "seed")
SCORES = ("view", "test_set", "psnr_db", "ssim")
TIMES = ("train_time_s", "compile_time_s")
COLUMNS = (*KEYS, *SCORES, *TIMES, "whole_time_s", "steps", "batch_rays", "device")
# What is shared: an accelerator's memory, and compiled programs.
ENVIRONMENT = {
    "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.5",
}


class Task(NamedTuple):
    """A training: its scene's folder, its job as JSON, where its files lie."""

    scene: Path
    method: str
    seed: int
    job: str
    folder: Path

    @property
    def labels(self):
        return {"scene": self.scene.name, "method": self.method, "seed": self.seed}


def job_of(method, seed, steps, batch_rays, decided) -> str:
    """A training's job; decided: the path of decisions.json, or None for defaults."""
    # The job does not depend on where a scene's photos come from.
    scene = {"source": "courtyard", "seed": seed, "steps": steps}
    config = {
        "decide": decided is not None,
        "scenes": {"any": scene},
        # A method that others are compared with has to be there.
        "methods": {"plain": METHODS["plain"], method: METHODS[method]},
        "training": {"batch_rays": batch_rays},
    }
    experiment = plan.Experiment(check.checked(config), None)
    job = experiment.at("any", method, 0).job.model_dump()
    return json.dumps(job | {"decisions": decided and str(decided)})


def decisions_of(scene, work):
    """The path of a scene's decisions.json: its own, or one that is made."""
    own = scene / "decisions.json"
    if own.is_file():
        return own
    folder = work / scene.name
    folder.mkdir(parents=True, exist_ok=True)
    found, out = folder / "facts.json", folder / "decisions.json"
    words = ["--scene", scene, "--facts", found, "--decisions", out]
    facts.main(list(map(str, words)))
    return out


def tasks_of(args):
    """The trainings, seed by seed; of a seed, method by method.

    Plain and aligned trainings have the same programs, so the latter find them.
    """
    decided = {
        scene: None if args.defaults else decisions_of(scene, args.work).resolve()
        for scene in args.scenes
    }
    for seed, method, scene in itertools.product(args.seeds, args.methods, args.scenes):
        job = job_of(method, seed, args.steps, args.batch_rays, decided[scene])
        folder = args.work / scene.name / f"{method}-{seed}"
        yield Task(scene, method, seed, job, folder)


def rows_of(task, threads):
    """Train, render and score; rows of the table."""
    # JAX is imported in the processes that train alone.
    from alignerf import align_test_poses, evaluate, render_views, train
    from flow import align

    begun, folder = time.monotonic(), task.folder
    model, cameras = folder / "learnt/model.msgpack", folder / "learnt" / "cameras.npz"
    scene, photos = ["--scene", task.scene], task.scene / "images"
    job = ["--config", task.job, *scene]
    as_trained = [*job, "--model", model]
    at_once = ["--threads", threads]
    call(
        train.main,
        *(*job, "--checkpoints", folder / "checkpoints", *at_once),
        *("--learnt", folder / "learnt", "--timing", folder / "timing.json"),
    )
    call(
        render_views.main,
        *(*as_trained, "--cameras", cameras, "--splits", "test", *at_once),
        *("--renders", folder / "renders", "--depth", folder / "depth"),
        *("--timing", folder / "render"),
    )
    words = (
        *("--renders", folder / "renders/test", "--depth", folder / "depth/test"),
        *("--photos", photos, "--masks", photos / "masks", *at_once),
        *("--flow-out", folder / "flow", "--stats-out", folder / "displacement.csv"),
    )
    options = faults.arguments(list(map(str, words)), None, align.OPTIONS)
    align.main(**vars(options))
    call(
        align_test_poses.main,
        *(
            *as_trained,
            "--cameras",
            cameras,
            "--depth",
            folder / "depth/test",
            *at_once,
        ),
        *("--flow", folder / "flow", "--out", folder / "moved"),
    )
    tables = []
    for kind, renders in (("renders", "renders/test"), ("aligned-pose", "moved")):
        path = folder / f"{kind}.csv"
        call(
            evaluate.main,
            *(*scene, f"--{kind}", folder / renders, "--metrics", path),
        )
        tables.append(pd.read_csv(path)[list(SCORES)])
    timing = json_files.read(folder / "timing.json", {})
    job = json.loads(task.job)
    facts = {name: timing[name] for name in (*TIMES, "steps", "device")}
    facts["whole_time_s"] = round(time.monotonic() - begun, 3)
    facts["batch_rays"] = job["training"]["batch_rays"]
    scores = pd.concat(tables).to_dict("records")
    return [task.labels | row | facts for row in scores]


def call(main, *words):
    """A command of the workflow, in this process."""
    main(list(map(str, words)))


def work_off(number, todo, done, threads, ends, keep, log):
    """A process: trainings one after another, until none is left or time is short."""
    # Progress of many at once is no use on a screen.
    with open(log, "wb", buffering=0) as file:
        os.dup2(file.fileno(), sys.stdout.fileno())
        os.dup2(file.fileno(), sys.stderr.fileno())
    deepflow.stand_in()
    import cv2

    cv2.setNumThreads(threads)
    last_s = 0.0
    with contextlib.suppress(queue.Empty):
        while time.time() + last_s < ends:
            task = todo.get(timeout=1)
            begun, rows, fault = time.time(), [], None
            try:
                rows = rows_of(task, threads)
            except Exception:
                fault = traceback.format_exc()
            if not keep:
                shutil.rmtree(task.folder, ignore_errors=True)
            done.put((number, task, rows, fault))
            last_s = time.time() - begun
    done.put((number, None, [], None))


def run(tasks, args):
    """Let processes work off the trainings; write rows as they come.

    Returns the number of trainings that have failed, or were not done.
    """
    context, begun = multiprocessing.get_context("spawn"), time.time()
    todo, done = context.Queue(), context.Queue()
    for task in tasks:
        todo.put(task)
    count = min(args.jobs, len(tasks))
    threads, ends = max(1, machine.cores() // count), begun + args.deadline_s
    workers = [
        context.Process(
            target=work_off,
            args=(
                *(number, todo, done, threads, ends, args.keep),
                args.work / f"process-{number}.log",
            ),
            daemon=True,
        )
        for number in range(count)
    ]
    for worker in workers:
        worker.start()
    working, missing = set(range(count)), len(tasks)
    with open(args.out, "w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        file.flush()
        while working and time.time() < ends:
            with contextlib.suppress(queue.Empty):
                number, task, rows, fault = done.get(timeout=1)
                if task is None:
                    working.discard(number)
                    continue
                table.writerows(rows)
                file.flush()
                missing -= fault is None
                print(said(task, rows, fault, time.time() - begun), flush=True)
            # One that was killed says nothing.
            working = {n for n in working if workers[n].is_alive() or not done.empty()}
    for worker in workers:
        worker.terminate()
    todo.cancel_join_thread()
    return missing


def said(task, rows, fault, passed_s):
    """A line on a training."""
    name = "/".join(map(str, task.labels.values()))
    if fault:
        return f"{passed_s:6.1f} s  {name}: failed\n{fault}"
    table = pd.DataFrame(rows)
    means = table.groupby("test_set", sort=False)["psnr_db"].mean().round(2)
    first, numbers = rows[0], ", ".join(f"{k} {v} dB" for k, v in means.items())
    times = (
        f"train {first['train_time_s']:.1f} s, compile {first['compile_time_s']:.1f} s"
        f", whole {first['whole_time_s']:.1f} s"
    )
    return f"{passed_s:6.1f} s  {name}: {numbers}; {times}, {first['device']}"


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", type=Path, nargs="+", metavar="SCENE")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--steps", type=int, default=4000)
    parser.add_argument("--batch-rays", type=int, default=512)
    parser.add_argument("--jobs", type=int, default=1, help="processes at once")
    parser.add_argument("--jax-cache", type=Path, help="default: below --work")
    parser.add_argument("--deadline-s", type=float, default=float("inf"))
    parser.add_argument("--defaults", action="store_true", help="decide nothing")
    parser.add_argument("--work", type=Path, default=Path("results/finer"))
    parser.add_argument("--keep", action="store_true", help="models and renders")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)
    begun = time.monotonic()
    args.work.mkdir(parents=True, exist_ok=True)
    cache = args.jax_cache or args.work / "jax_cache"
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(cache.resolve()))
    tasks = list(tasks_of(args))
    args.deadline_s -= time.monotonic() - begun
    if missing := run(tasks, args):
        print(f"{missing} of {len(tasks)} trainings are missing", flush=True)


if __name__ == "__main__":
    main()
