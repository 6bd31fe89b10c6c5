"""An accelerator that is there for ten minutes, used well: figures of the paper's size.

    python -m tools.gpu.ten_minutes FOLDER --prepare    # before, on a CPU
    python -m tools.gpu.ten_minutes FOLDER [--peer multinerf] [--gsplat gsplat]
    python -m tools.gpu.ten_minutes FOLDER --dry        # all of it, tiny, on a CPU

Compiles all programs, each in a process of its own, into a cache in FOLDER. Then, one
after another: (a) rays/s of the published model beside google-research/multinerf, and
of a hash grid; (b) the methods of workflow/config/evidence/published.yaml, 90 s and
240 s each; (c) splats by gsplat's trainer, by cameras as they came and adjusted.

Writes CSVs to --out, row by row: a kill loses none, and what is done is not done again.
stages.csv says what became of each stage; one that does not fit into what is left of
the minutes is skipped. --prepare needs COLMAP and the data in ALIGNERF_DATA; FOLDER is
then all that the other machine needs beside this program, in 64 MiB.
"""

import argparse
import concurrent.futures
import itertools
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
import types
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import yaml

from alignerf.experiment import check, plan, trainings
from alignerf.io import atomic, faults, machine, provenance, yaml_files
from tools.bench import measure
from tools.gpu import stages
from tools.gpu.worker import Worker

ROOT = provenance.ROOT
EVIDENCE = ROOT / "workflow" / "config" / "evidence"
DATA = os.environ.get("ALIGNERF_DATA", str(ROOT / ".." / "shared" / "data"))
SCENES = "published_courtyard", "published_flower"
# Each method of a scene, so many seconds.
LENGTHS_S, DRY_S = (90, 240), (1, 2)
# Splats of these scenes of real_cures.yaml, so wide.
SPLATS, SPLATS_PX = ("chair", "chair_adjusted"), 640
WEIGHTS = {
    "vgg19.npz": "vgg19_block1.npz",
    "lpips_alex.npz": "lpips_alex_v0.1.npz",
}
MAX_BYTES = 64 * 2**20
# Beside the seconds of a stage: loading programs and photos, rendering, scores.
BESIDE_S = 15
# What a stage needs that has no seconds of its own: rates, a splat.
RATES_S, SPLAT_S = 40, 90
# Of all minutes, for compiling: what takes longer is compiled in its stage.
COMPILING = 0.3
COLUMNS = ("stage", "state", "seconds", "note", "commit")


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--prepare", action="store_true")
    parser.add_argument("--dry", action="store_true")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--out", type=Path, help="default: FOLDER/measured")
    parser.add_argument("--peer", type=Path, help="checkout of multinerf")
    parser.add_argument("--gsplat", type=Path, help="checkout of gsplat")
    args = parser.parse_args(argv)
    if not 0 < args.minutes < math.inf:
        raise ValueError(f"--minutes: {args.minutes:g} is no time")
    if args.prepare or (args.dry and not args.folder.is_dir()):
        prepare(args.folder, dry=args.dry)
    if args.prepare:
        return
    if not all((args.folder / scene).is_dir() for scene in SCENES):
        raise ValueError(f"{args.folder}: not prepared, as --prepare does on a CPU")
    args.folder = args.folder.resolve()
    args.out = (args.out or args.folder / "measured").resolve()
    args.out.mkdir(parents=True, exist_ok=True)
    # As of `sources.set_environment`: CPUs of another kind have other programs.
    programs = args.folder / "programs" / machine.processor()
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(programs))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    if args.dry:
        # What runs for a moment is compiled in a third of the time.
        os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=0")
    # One card: trainings in one process would take another each. Several processes
    # compile on it.
    os.environ.setdefault("CUDA_VISIBLE_DEVICES", "0")
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
    carry_out(*planned(args), args.out, seconds=60 * args.minutes)


class Stage(NamedTuple):
    """A function of `tools.gpu.stages`.

    needs_s: it is skipped where less is left; most_s: then it is stopped.
    """

    name: str
    needs_s: float
    function: Any
    arguments: tuple
    options: Any = types.MappingProxyType({})
    most_s: float = math.inf


def carry_out(programs, todo, out, *, seconds, clock=time.monotonic):
    """Compile at once, then run stages in turn, as long as there is time.

    A line of stages.csv says what became of each. One that is done, and has nothing to
    note, is not done again.
    """
    end, path = clock() + seconds, out / "stages.csv"
    # A copy of the sources alone has no commit.
    commit, done = provenance.commit() or "", set()
    if path.exists():
        ended = pd.read_csv(path, dtype=str, keep_default_na=False)
        ended = ended[(ended["state"] == "done") & (ended["note"] == "")]
        done = set(ended.loc[ended["commit"] == commit, "stage"])

    def tell(stage, state, took_s, note):
        row = stage.name, state, round(took_s, 1), note, commit
        measure.append(path, COLUMNS, dict(zip(COLUMNS, row, strict=True)))
        print(f"{stage.name}: {state}, {took_s:.0f} s {note}".rstrip(), flush=True)

    def run(worker, stage, until):
        if stage.needs_s > until - clock():
            left_s = max(0, until - clock())
            return "skipped", 0, f"needs {stage.needs_s:.0f} s of {left_s:.0f} s"
        began = clock()
        state, note = worker.run(stage, limit_s=min(until - began, stage.most_s))
        return state, clock() - began, note

    workers = []

    def compiled(stage):
        workers.append(worker := Worker(out / "log.txt"))
        try:
            return run(worker, stage, end - (1 - COMPILING) * seconds)
        finally:
            worker.end()

    left = [stage for stage in todo if stage.name not in done]
    with concurrent.futures.ThreadPoolExecutor(machine.cores()) as pool:
        programs = programs if left else []
        try:
            for stage, told in zip(programs, pool.map(compiled, programs), strict=True):
                tell(stage, *told)
        except KeyboardInterrupt:
            # The pool is left when its threads have ended, and these wait for workers.
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in workers:
                worker.end()
            raise
    worker = Worker(out / "log.txt")
    try:
        for stage in left:
            tell(stage, *run(worker, stage, end))
    finally:
        worker.end()


def planned(args):
    """(stages that compile, stages that measure)."""
    config, lengths = config_of(args.dry), DRY_S if args.dry else LENGTHS_S
    weights = args.folder / "vgg19.npz"
    config["frequency_weights"] = str(weights) if weights.is_file() else None
    # What a job computes does not depend on where the photos are from.
    config["scenes"] = {name: {"source": "courtyard"} for name in SCENES}
    compiling, measuring, later = {}, [], []
    for seconds in lengths:
        config["training"]["budget_min"] = seconds / 60
        experiment = plan.Experiment(check.checked(config))
        for scene, name in itertools.product(SCENES, config["methods"]):
            names = {"scene": scene, "method": name, "seconds": seconds}
            label = f"{scene} {name} {seconds} s"
            chain, needs_s = [], BESIDE_S * (not args.dry)
            for one in trainings.lead_to(experiment.at(scene, name, 0)):
                at, before = (
                    args.folder / "trained" / f"{seconds}s" / scene / folder
                    for folder in (one.folder, one.after[0].folder if one.after else "")
                )
                chain.append((one.job.text, at, before if one.initial else None))
                needs_s += 60 * one.job.budget_min
                # Scenes and lengths share a program, and pre-training has the plain
                # one's; what is learnt besides is each scene's own.
                if one.job.part or (scene == SCENES[0] and one.job.stage != "pretrain"):
                    arguments = one.job.text, args.folder / scene
                    compiling[f"{scene} {name}"] = stages.compile_training, arguments
            arguments = args.out, args.folder / scene, chain, names
            later.append(Stage(label, needs_s, stages.method, arguments))
    plain = experiment.at(SCENES[0], next(iter(config["methods"])), 0).job.text
    for what in ("published", "grid"):
        arguments = args.out, plain, args.peer
        options = {"dry": args.dry, "grid": what == "grid"}
        needs_s = RATES_S * (not args.dry)
        most_s = math.inf if args.dry else 3 * needs_s
        stage = Stage(
            f"rates {what}", needs_s, stages.rates, arguments, options, most_s
        )
        measuring.append(stage)
        compiling[stage.name] = stage.function, arguments, options | {"repeats": 0}
    for name in SPLATS:
        at = args.folder / "trained" / name
        arguments = args.out, args.folder / "splats" / name, at, args.gsplat
        needs_s = SPLAT_S * bool(args.gsplat)
        later.append(Stage(f"splat {name}", needs_s, stages.splat, arguments))
    compiled = [Stage(f"compile {name}", 0, *one) for name, one in compiling.items()]
    return compiled, measuring + later


def config_of(dry):
    """The config of the trainings."""
    config = yaml_files.read(EVIDENCE / "published.yaml")
    if dry:
        changes = yaml_files.read(Path(__file__).with_name("dry.yaml"))
        for key, own in changes.items():
            config[key] = own if key == "scenes" else config[key] | own
    return config


def prepare(folder, *, dry):
    """Make the folder that is carried: scenes, weights and exports for splats."""
    config = config_of(dry) | {"frequency_weights": None}
    with atomic.replace_folder(folder) as made, tempfile.TemporaryDirectory() as work:
        work, made = Path(work), Path(made)
        results = snakemake(work, config, SCENES, ["cameras.npz"])
        for scene in SCENES:
            shutil.copytree(results / scene, made / scene)
        for name, file in WEIGHTS.items():
            if (weights := Path(DATA) / "weights" / file).is_file():
                shutil.copy(weights, made / name)
        if not dry:
            config = yaml_files.read(EVIDENCE / "real_cures.yaml")
            config["scenes"] = {name: config["scenes"][name] for name in SPLATS}
            snakemake(work, config, SPLATS, ["cameras.npz", "config.yaml"])
            for scene in SPLATS:
                out = made / "splats" / scene
                words = ["--scene", str(results / scene), "--out", str(out)]
                run("alignerf.export", *words, "--width", str(SPLATS_PX))
        size = sum(path.stat().st_size for path in made.rglob("*"))
        if size > MAX_BYTES:
            raise ValueError(f"{folder}: {size / 2**20:.0f} MiB: more than is carried")
    print(f"{folder}: {size / 2**20:.0f} MiB")


def snakemake(work, config, scenes, files):
    """Prepare scenes of a config in a folder; its results."""
    path = work / "config.yaml"
    path.write_text(yaml.safe_dump(config))
    where = ["--directory", str(work), "--snakefile", str(ROOT / "Snakefile")]
    words = ["--cores", str(machine.cores()), "--workflow-profile", "none", *where]
    targets = [f"results/{scene}/{file}" for scene in scenes for file in files]
    run("snakemake", *words, "--configfile", str(path), "--", *targets)
    return work / "results"


def run(module, *words):
    """Run a module's command; ValueError where it fails, after what it says."""
    environment = os.environ | {"ALIGNERF_DATA": str(Path(DATA).resolve())}
    command = [sys.executable, "-m", module, *words]
    if code := subprocess.run(command, env=environment, cwd=ROOT).returncode:
        raise ValueError(f"python -m {module}: ended with {code}")


if __name__ == "__main__":
    faults.run(main)
