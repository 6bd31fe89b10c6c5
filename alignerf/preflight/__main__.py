"""The cost of a scene's plan before it starts: `python -m alignerf.preflight`.

Times a step and a rendering of each program that the plan trains, and the flow of two
photos; as many at once as trainings will run. Writes preflight.json: hours, memory and
disk of the plan, task by task, and what was measured. A plan that does not fit this
machine is refused. `--show` prints what such files say.
"""

import argparse
import concurrent.futures
import functools
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from alignerf.decisions import fill
from alignerf.experiment import check, plan
from alignerf.experiment.cluster import work
from alignerf.files import atomic, faults, json_files, yaml_files
from alignerf.preflight import fit, flow, schedule, simulate
from alignerf.scenes import prepared
from alignerf.training import memory


def main(argv=None):
    args = parse(argv)
    if args.show:
        if args.configs:
            renew(args)
        print("\n".join(shown(args.show)))
        return
    write(args, args.scene, json.loads(args.work), args.out)


def renew(args):
    """Measure anew where a preflight.json is of another plan.

    The file keeps its time: with a newer one Snakemake would repeat finished trainings.
    """
    for path, config in zip(args.show, args.configs, strict=True):
        todo = work_of(config, path.parent.name)
        if read(path).get("work") != (todo and work.digest(todo)):
            before = path.stat()
            times_ns = before.st_atime_ns, before.st_mtime_ns
            write(args, path.parent, todo, path, times_ns)


def work_of(config, scene):
    """The work of a scene by its complete config."""
    complete = check.checked(yaml_files.read(config), [str(config)])
    # With `rounds: auto` all rounds are counted that there may be.
    return work.of_scene(plan.Experiment(complete, None), scene)


def write(args, scene, todo, out, times_ns=None):
    """Measure a scene's plan, log its cost, and write preflight.json.

    times_ns: the file's times of access and of change; None for the present.
    """
    filled = decided(todo)
    cost = {} if filled is None else plan_of(args, scene, filled)
    if cost:
        cost["work"] = work.digest(todo)
        print("\n".join(fit.lines(cost, cost["scene"])))
        fit.check(cost)
    with atomic.replace_file(out) as path:
        path.write_text(json.dumps(cost, indent=1) + "\n")
        if times_ns:
            os.utime(path, ns=times_ns)


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.preflight", description=__doc__)
    parser.add_argument("--show", nargs="+", type=Path, help="preflight.json, printed")
    parser.add_argument("--configs", nargs="+", type=Path, help="config.yaml of each")
    parser.add_argument("--scene", type=Path, help="prepared scene folder")
    parser.add_argument("--work", help="JSON: what there is to do; null: say nothing")
    parser.add_argument("--cores", type=int, default=1, help="of the whole plan")
    parser.add_argument("--threads", type=int, default=1, help="of a training")
    parser.add_argument("--out", type=Path, help="preflight.json, written")
    args = parser.parse_args(argv)
    if not args.show and None in (args.scene, args.work, args.out):
        parser.error("--scene, --work and --out, or --show")
    return args


def decided(todo):
    """The work with its decided settings filled in, above all the steps."""
    if todo is None:
        return None
    trainings = [
        one if one.get("external") else one | {"job": fill.fill(one["job"])}
        for one in todo["trainings"]
    ]
    return todo | {"trainings": trainings}


def shown(paths):
    """Lines of existing preflight.json files, and of their sum."""
    costs = [cost for path in paths if (cost := read(path))]
    lines = [line for cost in costs for line in fit.lines(cost, cost["scene"])]
    if len(costs) > 1:
        lines.append(f"all scenes: about {fit.minutes(fit.in_all(costs))}")
    return lines or ["nothing is said with `preflight: false`"]


def read(path):
    """The content of a preflight.json; ValueError names a file that is none."""
    cost = json_files.read(path)
    try:
        if cost and not fit.lines(cost, cost["scene"]):
            raise ValueError("it says nothing")
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        ZeroDivisionError,
    ) as error:
        raise ValueError(f"{path}: not a preflight: {error}") from None
    return cost


def plan_of(args, scene, todo):
    """The content of preflight.json."""
    threads = min(args.threads, args.cores)
    loaded = prepared.load(scene)
    views = views_of(loaded)
    begun = time.perf_counter()
    at_once = max(1, args.cores // threads)
    rates, of_flow = calibrated(scene, loaded, todo, threads, at_once)
    tasks = schedule.tasks_of(todo, rates, of_flow, views, threads=threads)
    missing = [t for t in tasks if not (scene / t.file).exists()]
    wall_s = simulate.wall_s(tasks, args.cores)
    return {
        "scene": scene.name,
        "cores": args.cores,
        "external": [t["name"] for t in todo["trainings"] if t.get("external")],
        "lanes": at_once,
        "wall_s": round(wall_s, 1),
        "hours": round(wall_s / 3600, 3),
        "memory_bytes": simulate.peak_bytes(tasks, args.cores),
        "memory_free_bytes": memory.free_host_bytes(),
        # What is there from before takes no more.
        "disk_bytes": sum(task.new_bytes for task in missing),
        "disk_free_bytes": shutil.disk_usage(scene).free,
        "calibration_s": round(time.perf_counter() - begun, 1),
        "measured": {
            "flow": of_flow._asdict(),
            "trainings": {
                one["name"]: rate._asdict()
                for one, rate in zip(todo["trainings"], rates, strict=True)
            },
        },
        "tasks": [
            task._asdict() | {"seconds": round(task.seconds, 2)} for task in tasks
        ],
    }


def views_of(loaded: prepared.Scene) -> schedule.Views:
    """Number and size of a scene's views."""
    paths = [loaded.folder / "images" / f"{name}.png" for name in loaded.names]
    return schedule.Views(
        train=len(loaded.views("train")),
        test=len(loaded.views("test")),
        pixels=loaded.width * loaded.height,
        image_bytes=sum(path.stat().st_size for path in paths) // len(paths),
        side=min(loaded.width, loaded.height),
    )


def calibrated(scene, loaded: prepared.Scene, todo, threads, at_once):
    """(rates of each training, the flow's), measured `at_once` at a time."""
    ours = [t["job"] for t in todo["trainings"] if not t.get("external")]
    jobs = {json_files.canonical(schedule.program_of(job)): job for job in ours}
    pairs = [(key, what) for what in ("train", "render") for key in jobs]
    measure = functools.partial(calibrate, scene, threads)
    pool = concurrent.futures.ThreadPoolExecutor(max(1, min(at_once, len(jobs))))
    try:
        photos, names = loaded.folder / "images", loaded.names
        of_flow = pool.submit(flow.measure, photos, names, todo["flow"])
        futures = {one: pool.submit(measure, jobs[one[0]], one[1]) for one in pairs}
        of_flow = of_flow.result()
        results = {one: future.result() for one, future in futures.items()}
    finally:
        # After a fault, what has not begun is left.
        pool.shutdown(cancel_futures=True)
    rates = {
        key: schedule.Rates(**results[key, "train"], **results[key, "render"])
        for key in jobs
    }
    return [
        schedule.UNKNOWN
        if one.get("external")
        else rates[json_files.canonical(schedule.program_of(one["job"]))]
        for one in todo["trainings"]
    ], of_flow


def calibrate(scene, threads, job, what):
    """The output of `alignerf.preflight.calibrate`, run as a process of its own.

    Raises ValueError with the fault of the process, or where the system killed it.
    """
    command = [sys.executable, "-m", "alignerf.preflight.calibrate", "--what", what]
    command += ["--scene", str(scene), "--threads", str(threads)]
    command += ["--config", json.dumps(job), "--started", str(time.time())]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode < 0:
        raise ValueError(
            f"timing a {what} was ended by signal {-done.returncode}, as where memory "
            "is short: --cores 1, a larger downscale or a smaller model"
        )
    if done.returncode:
        said = done.stderr.strip().splitlines()
        raise ValueError(said[-1].removeprefix("error: ") if said else what)
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    faults.run(main)
