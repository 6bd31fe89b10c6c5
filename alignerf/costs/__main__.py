"""What a scene's trainings take, before they start: `python -m alignerf.costs`.

Times a step of each program that the plan trains, as many at once as trainings will
run. Writes preflight.json, and prints its line. A plan that does not fit into this
machine's memory is refused, as is a budget without a verdict. `--show` prints the line
of such files.

`--compile my.yaml` compiles what a config trains and renders, and no more. Trainings in
the same folder find that, by photos of any size and number. What a scene decides itself
is compiled with it: `max_resolution` by its facts, cameras or costs that are learnt.
"""

import concurrent.futures
import json
import subprocess
import sys
import time
import types
from pathlib import Path

from alignerf.costs import estimate
from alignerf.experiment import check, jobs, plan, sources
from alignerf.io import atomic, faults, json_files, yaml_files
from alignerf.scenes import prepared
from alignerf.training import memory

OPTIONS = {
    "[compile]": "a config's file",
    "[show]": ("preflight.json, printed", {"nargs": "*", "type": Path}),
    "[scene]": ("prepared scene folder", Path),
    "[work]": "JSON: what there is to do",
    "[cores]": ("of the whole plan", 1),
    "[threads]": ("of a training", 1),
    "[gpus]": ("of a training", 1),
    "[out]": ("preflight.json, written", Path),
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    if args.show is not None:
        said = [json_files.read(path, {"said": str})["said"] for path in args.show]
        print("\n".join(said or ["nothing is said with `preflight: false`"]))
        return
    if args.compile:
        compile_ahead(args)
        return
    if None in (args.scene, args.work, args.out):
        raise ValueError("--scene, --work and --out, or --show, or --compile")
    parallel_jobs = max(1, args.cores // args.threads)
    scene = args.scene.name
    found = measured(args, json.loads(args.work), parallel_jobs)
    found["said"] = f"{scene}: {found['said']}"
    with atomic.replace_file(args.out) as path:
        path.write_text(json.dumps(found, indent=1))
        print(found["said"])
        estimate.check(scene, found, memory.free_host_bytes(), parallel_jobs)


def compile_ahead(args):
    """Compile each program of a config, in the cache of a workflow that runs here."""
    config = check.checked(yaml_files.read(args.compile) or {}, [args.compile])
    sources.set_environment()
    experiment, programs = plan.Experiment(config), {}
    for scene in experiment.captures():
        for job in (one.job for one in experiment.trainings(scene).values()):
            if job.ours:
                job = jobs.parse(job.changed(decisions=None, scaled=False).model_dump())
                programs[estimate.program_of(job)] = job
    threads, gpus = sources.OF_TRAINING, sources.gpus(config)
    args = types.SimpleNamespace(scene=None, threads=threads, gpus=gpus)
    with concurrent.futures.ThreadPoolExecutor(
        sources.WHOLE_MACHINE // threads
    ) as pool:
        done = pool.map(lambda job: calibrate(args, job), programs.values())
        for number, _ in enumerate(done, 1):
            print(f"compiled {number} of {len(programs)}", flush=True)


def measured(args, work, parallel_jobs):
    """What `estimate.estimated` says, and the rates that it is from."""
    loaded = prepared.load(args.scene)
    counts = (len(loaded.views(split)) for split in ("train", "test"))
    views = estimate.Views(*counts, loaded.width * loaded.height)
    ours = {one["name"]: estimate.job_of(one) for one in work["trainings"]}
    keys = {name: job and estimate.program_of(job) for name, job in ours.items()}
    programs = {keys[name]: job for name, job in ours.items() if job}
    with concurrent.futures.ThreadPoolExecutor(parallel_jobs) as pool:
        timed = pool.map(lambda job: calibrate(args, job), programs.values())
        rates = {None: estimate.Rates(), **dict(zip(programs, timed, strict=True))}
    of_each = {name: rates[key] for name, key in keys.items()}
    found = estimate.estimated(work, of_each, views, args.cores, parallel_jobs)
    return found | {"rates": {name: rate._asdict() for name, rate in of_each.items()}}


def calibrate(args, job) -> estimate.Rates:
    """The output of `alignerf.costs.calibrate`, run as a process of its own.

    Raises ValueError with the fault of the process, or where the system killed it.
    """
    command = [sys.executable, "-m", "alignerf.costs.calibrate"]
    command += ["--threads", str(args.threads), "--gpus", str(args.gpus)]
    command += ["--scene", str(args.scene)] if args.scene else []
    command += ["--config", json_files.canonical(job.model_dump())]
    command += ["--started", str(time.time())]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode < 0:
        raise ValueError(
            f"timing a training was ended by signal {-done.returncode}, as where "
            "memory is short: --cores 1, a larger downscale or a smaller model"
        )
    if done.returncode:
        said = done.stderr.strip().splitlines() or ["timing a training failed"]
        raise ValueError(said[-1].removeprefix("error: "))
    return estimate.Rates(**json.loads(done.stdout.splitlines()[-1]))


if __name__ == "__main__":
    faults.run(main)
