"""What Snakemake costs: plans of many scenes, and jobs that do nothing.

CPU seconds and the peak of memory are of Snakemake and of all that it starts. Jobs that
do nothing stand in for ours: as many wildcards, a log and a benchmark, and a shell that
touches its output. They are run as they are, by the greedy scheduler, as one group a
scene, and batch by batch.

`python -m tools.bench.planning SCENES` times the latter of so many scenes alone.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import textwrap
from typing import NamedTuple

import yaml

from alignerf.experiment import check
from tools.bench import measure, report

ROOT = measure.ROOT
PLANNED = (1, 10, 50, 200)
GOAL_S, GOAL_GB = 20, 1
METHODS, STEPS, BATCHES = 7, 10, 10
NOTHING = f"""
STEPS = "out/{{scene}}/{{method}}/round{{round}}"
SCENES = [f"scene_{{k:03d}}" for k in range(config["scenes"])]
METHODS = [f"method_{{k}}" for k in range({METHODS})]

wildcard_constraints:
    scene="|".join(SCENES),
    method="|".join(METHODS),
    round=r"\\d+",

rule all:
    input: expand("out/{{scene}}/page", scene=SCENES)

rule page:
    input: expand(STEPS, round={STEPS} - 1, method=METHODS, allow_missing=True)
    output: "out/{{scene}}/page"
    log: "out/{{scene}}/page.log"
    benchmark: "out/{{scene}}/page.tsv"
    shell: "touch {{output}}"

rule step:
    input: lambda w: STEPS.format(**{{**w, "round": int(w.round) - 1}})
        if int(w.round) else []
    output: STEPS
    log: STEPS + ".log"
    benchmark: STEPS + ".tsv"
    shell: "touch {{output}}"
"""
WAYS = {
    "plain": [[]],
    "greedy": [["--scheduler", "greedy"]],
    "group a scene": [["--groups", "step=scene", "page=scene"]],
    f"{BATCHES} batches": [
        ["--batch", f"all={k + 1}/{BATCHES}"] for k in range(BATCHES)
    ],
}
# Runs its arguments as a command; prints CPU seconds, wall seconds and GB of it last.
BETWEEN = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[1:]).returncode
took, used = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
print()
print(json.dumps([used.ru_utime + used.ru_stime, took, used.ru_maxrss * 1024 / 1e9]))
sys.exit(code)
"""


class Cost(NamedTuple):
    """What a process and all that it started took."""

    cpu_s: float
    wall_s: float
    peak_gb: float
    # What it printed.
    text: str = ""

    def __add__(self, other):
        peak = max(self.peak_gb, other.peak_gb)
        return Cost(self.cpu_s + other.cpu_s, self.wall_s + other.wall_s, peak)


def run(options):
    """Rows: plans by number of scenes, then jobs that do nothing, by way."""
    sizes, scenes = ((1, 2), 1) if options.quick else (PLANNED, 14)
    repeats = min(options.repeats, 3)
    rows = [row for size in sizes for row in plan_rows(size, repeats)]
    return rows + nothing_rows(scenes, 1 if options.quick else repeats)


def plan_rows(scenes, repeats):
    """Time and memory of planning so many scenes with the methods of an ablation."""
    with tempfile.TemporaryDirectory() as folder:
        config = pathlib.Path(folder) / "config.yaml"
        config.write_text(yaml.safe_dump(config_of(scenes), sort_keys=False))
        command = ("--snakefile", ROOT / "Snakefile", "--configfile", config, "-n")
        printed = snakemake(folder, *command, "--quiet", "rules").text
        jobs = next(
            int(line.split()[1])
            for line in printed.splitlines()
            if line.startswith("total ")
        )
        costs = [snakemake(folder, *command, "--quiet") for _ in range(repeats)]
    what, note = f"plan {scenes} scenes x {METHODS} methods", f"{jobs} jobs"
    last = scenes == PLANNED[-1]
    return rows_of(what, costs, note, last and (GOAL_S, GOAL_GB))


def rows_of(what, costs, note, goals=None):
    """CPU seconds, wall seconds and gigabytes of repeats."""
    columns = (("CPU s", "cpu_s"), ("wall s", "wall_s"), ("peak GB", "peak_gb"))
    limits = dict(zip(("CPU s", "peak GB"), goals or (), strict=False))
    return [
        measure.Row(
            f"{what}, {unit}",
            unit.split()[1],
            measure.spread([getattr(cost, name) for cost in costs]),
            goal=measure.Goal("ours", "<=", limits[unit]) if unit in limits else None,
            note=note,
        )
        for unit, name in columns
    ]


def config_of(scenes):
    """The ablation's methods on so many scenes that need no files."""
    path = ROOT / "workflow" / "config" / "table4.yaml"
    found = check.sized(yaml.safe_load(path.read_text(encoding="utf-8")))
    del found["vary"]
    (scene,) = found["scenes"].values()
    return found | {"scenes": {f"scene_{k:03d}": dict(scene) for k in range(scenes)}}


def nothing_rows(scenes, repeats):
    """Time and memory of jobs that do nothing, first without Snakemake."""
    jobs = scenes * (METHODS * STEPS + 1)
    what, note = f"{jobs} jobs of nothing", f"{jobs} jobs"
    # What a cluster starts for each job, or for each group, is a Snakemake of its own.
    alone = [["out/scene_000/method_0/round0"]]
    arms = [(f"{what}, one of them alone", alone, [])]
    for name, calls in WAYS.items():
        # A batch has a scene at least.
        if len(calls) <= scenes:
            # A later batch can be planned only when those before have been run.
            first = f"{what}, {name}, planned" + ", the first" * (len(calls) > 1)
            arms.append((first, calls[:1], ["-n", "--quiet"]))
            arms.append((f"{what}, {name}, run", calls, []))
    rows = rows_of(f"{jobs} shells without Snakemake", [shells(jobs)], note)
    for name, calls, more in arms:
        costs = [nothing(scenes, calls, more) for _ in range(repeats)]
        rows += rows_of(name, costs, note)
    return rows


def shells(jobs):
    """What as many shells take that do the same."""
    loop = f"for ((k = 0; k < {jobs}; k++)); do bash -c 'touch $0' out; done"
    with tempfile.TemporaryDirectory() as folder:
        return timed(["bash", "-c", loop], folder)


def nothing(scenes, calls, more):
    """What the calls of Snakemake take together, from nothing."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "Snakefile"
        path.write_text(textwrap.dedent(NOTHING))
        options = ("--cores", "2", *more, "--config", f"scenes={scenes}")
        costs = [snakemake(folder, *call, *options) for call in calls]
        shutil.rmtree(pathlib.Path(folder) / "out", ignore_errors=True)
    return sum(costs[1:], costs[0])


def snakemake(folder, *arguments):
    """What a call of Snakemake takes in a folder."""
    return timed([sys.executable, "-m", "snakemake", *arguments], folder)


def timed(command, folder):
    """What a command takes in a folder, and what it printed."""
    # In a small process between: Linux counts what a parent holds to its child's peak.
    done = subprocess.run(
        [sys.executable, "-c", BETWEEN, *map(str, command)],
        cwd=folder,
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        raise ValueError(f"{command[:3]} failed:\n{done.stderr[-2000:]}")
    text, _, last = done.stdout.rstrip().rpartition("\n")
    return Cost(*json.loads(last), text)


if __name__ == "__main__":
    for count in map(int, sys.argv[1:]):
        print(report.show("planning", nothing_rows(count, 1)), flush=True)
