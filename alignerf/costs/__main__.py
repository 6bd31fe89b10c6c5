"""The cost of a scene's plan before it starts: `python -m alignerf.costs`.

Times a step of each program that the plan trains, and the flow of some photos; as many
at once as trainings will run. Writes preflight.json: hours, memory and disk of the
plan, task by task, and what was measured. A plan that does not fit this machine is
refused. `--show` prints what such files say.
"""

import concurrent.futures
import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from alignerf.costs import plan, summary
from alignerf.experiment import jobs
from alignerf.io import atomic, csv_files, faults, json_files
from alignerf.scenes import prepared
from alignerf.training import memory

# Photos whose flow is timed. Of small ones some more: on a machine that has other work
# too, a process of less than a second has more than its share.
PHOTOS, MAX_PHOTOS, MORE_PIXELS = 2, 8, 300_000


OPTIONS = {
    "[show]": ("preflight.json, printed", {"nargs": "*", "type": Path}),
    "[scene]": ("prepared scene folder", Path),
    "[work]": "JSON: what there is to do",
    "[cores]": ("of the whole plan", 1),
    "[threads]": ("of a training", 1),
    "[out]": ("preflight.json, written", Path),
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    if args.show is not None:
        print("\n".join(shown(args.show)))
        return
    if None in (args.scene, args.work, args.out):
        raise ValueError("--scene, --work and --out, or --show")
    with atomic.replace_file(args.out) as path:
        path.write_text(json.dumps(measured(args, json.loads(args.work)), indent=1))
        found = summary.read(path)
        print("\n".join(summary.lines(found)))
        summary.check(found)


def shown(paths):
    """Lines of existing preflight.json files, and of their sum."""
    plans = [summary.read(path) for path in paths]
    lines = [line for one in plans for line in summary.lines(one)]
    if len(plans) > 1:
        whole_s = sum(one["wall_s"] for one in plans)
        lines.append(f"all scenes: about {summary.minutes(whole_s)}")
    return lines or ["nothing is said with `preflight: false`"]


def measured(args, work):
    """The content of preflight.json."""
    threads = min(args.threads, args.cores)
    parallel_jobs = max(1, args.cores // threads)
    loaded = prepared.load(args.scene)
    photos = [loaded.folder / "images" / f"{name}.png" for name in loaded.names]
    views = plan.Views(
        train=len(loaded.views("train")),
        test=len(loaded.views("test")),
        pixels=loaded.width * loaded.height,
        image_bytes=sum(path.stat().st_size for path in photos) // len(photos),
        side=min(loaded.width, loaded.height),
    )
    ours = {one["name"]: plan.job_of(one) for one in work["trainings"]}
    keys = {name: job and plan.program_of(job) for name, job in ours.items()}
    programs = {keys[name]: job for name, job in ours.items() if job}
    with concurrent.futures.ThreadPoolExecutor(parallel_jobs) as pool:
        flow = pool.submit(flow_of, photos, views.pixels, work["flow"])
        timed = {
            key: pool.submit(calibrate, args.scene, threads, job)
            for key, job in programs.items()
        }
    rates = {
        name: timed[key].result() if key else plan.Rates() for name, key in keys.items()
    }
    tasks = plan.tasks_of(work, rates, flow.result(), views, threads)
    every = [task for own in tasks.values() for task in own]
    # What is there from before takes no more.
    new = [task.new_bytes for task in every if not (args.scene / task.file).exists()]
    return {
        "scene": args.scene.name,
        "cores": args.cores,
        "parallel_jobs": parallel_jobs,
        "external": [name for name, key in keys.items() if not key],
        "wall_s": round(plan.wall_s(work, tasks, args.cores), 1),
        "memory_bytes": plan.peak_bytes(work, tasks, parallel_jobs),
        "memory_free_bytes": memory.free_host_bytes(),
        "disk_bytes": sum(new),
        "disk_free_bytes": shutil.disk_usage(args.scene).free,
        "flow": flow.result()._asdict(),
        "rates": {name: rate._asdict() for name, rate in rates.items()},
        "length": plan.length_of(work, rates, views),
        "tasks": [task._asdict() for task in every],
    }


def calibrate(scene, threads, job) -> plan.Rates:
    """The output of `alignerf.costs.calibrate`, run as a process of its own.

    Raises ValueError with the fault of the process, or where the system killed it.
    """
    command = [sys.executable, "-m", "alignerf.costs.calibrate", "--scene", str(scene)]
    command += ["--config", json_files.canonical(jobs.as_dict(job))]
    command += ["--threads", str(threads), "--started", str(time.time())]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode < 0:
        raise ValueError(
            f"timing a training was ended by signal {-done.returncode}, as where "
            "memory is short: --cores 1, a larger downscale or a smaller model"
        )
    if done.returncode:
        said = done.stderr.strip().splitlines() or ["timing a training failed"]
        raise ValueError(said[-1].removeprefix("error: "))
    return plan.Rates(**json.loads(done.stdout.splitlines()[-1]))


def flow_of(photos, pixels, options) -> plan.Flow:
    """The cost of `flow.align` between each of some photos and the one before it.

    Raises ValueError with the command's error where it fails.
    """
    count = min(max(PHOTOS, MORE_PIXELS // pixels), MAX_PHOTOS, len(photos))
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        command = [sys.executable, "-m", "flow.align", *options]
        for kind in ("photos", "renders"):
            (root / kind).mkdir()
            command += [f"--{kind}", str(root / kind)]
        for k in range(count):
            for kind, path in (("photos", photos[k]), ("renders", photos[k - 1])):
                (root / kind / photos[k].name).symlink_to(path.resolve())
        for kind in ("flow", "warped", "stats"):
            command += [f"--{kind}-out", str(root / kind)]
        begun = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True)
        whole_s = time.perf_counter() - begun
        if done.returncode:
            raise ValueError(f"flow.align: {done.stderr.strip()[-300:]}")
        views_s = float(csv_files.read(root / "stats").time_s.sum())
        files = [
            path for kind in ("flow", "warped") for path in (root / kind).iterdir()
        ]
        size = sum(path.stat().st_size for path in files)
    return plan.Flow(max(0.0, whole_s - views_s), views_s / count, size / count)


if __name__ == "__main__":
    faults.run(main)
