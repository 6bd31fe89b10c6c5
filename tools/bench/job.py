"""What a job costs besides training: import, compile, load, checkpoint.

`python -m alignerf.train` with one step of the default model on views of the default
size, in a process of its own as the workflow starts it, with compiled programs kept
from run to run. The second run is what every job but a machine's first one pays.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

from tools.bench import cases, measure

# As alignerf.experiment.sources sets it; the folder is a fresh one here.
CACHE = {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.5"}
GOAL_S = 8.0


def run(options):
    """Rows: the whole of the first and of later runs, and the parts of the latter."""
    count, width, height = (4, 32, 32) if options.quick else (48, 200, 150)
    batch = 16 if options.quick else 1024
    job = cases.make_job(
        cases.TINY if options.quick else cases.GRID, batch_rays=batch, steps=1
    )
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        cases.write_scene(folder / "scene", cases.orbit(count, width, height))
        environment = os.environ | CACHE
        environment["JAX_COMPILATION_CACHE_DIR"] = str(folder / "cache")
        first = _train(job, folder, "first", environment)
        later = [
            _train(job, folder, f"later{number}", environment)
            for number in range(1 if options.quick else options.repeats)
        ]
        imports = [
            _seconds([sys.executable, "-c", "import alignerf.train"], environment)
            for _ in later
        ]
    return _rows(first, later, imports, f"{count} views of {width}x{height}")


def _rows(first, later, imports, note):
    rests = [
        run["whole_s"] - run["compile_time_s"] - run["train_time_s"] - import_s
        for run, import_s in zip(later, imports, strict=True)
    ]
    parts = {
        "import, Python's start included": imports,
        "compile, from the cache": [run["compile_time_s"] for run in later],
        "step and checkpoint": [run["train_time_s"] for run in later],
        "the rest: load, first parameters, model's file": rests,
    }
    whole = [run["whole_s"] for run in later]
    goal = measure.Goal("ours", "<=", GOAL_S)
    return [
        _row("first run, nothing compiled", [first["whole_s"]], note),
        _row("of it: compile", [first["compile_time_s"]]),
        _row("later runs", whole, note, goal),
        *(_row(f"of it: {what}", values) for what, values in parts.items()),
    ]


def _row(what, values, note="", goal=None):
    return measure.Row(what, "s", measure.spread(values), goal=goal, note=note)


def _train(job, folder, name, environment):
    """timing.json of a training in a process of its own, with the seconds of all."""
    command = [
        *(sys.executable, "-m", "alignerf.train"),
        *("--config", cases.as_json(job), "--scene", folder / "scene"),
        *("--checkpoints", folder / name / "checkpoints"),
        *("--learnt", folder / name / "learnt"),
        *("--timing", folder / name / "timing.json"),
    ]
    whole_s = _seconds(command, environment)
    timing = json.loads((folder / name / "timing.json").read_text())
    return timing | {"whole_s": whole_s}


def _seconds(command, environment):
    """Of a process that must succeed."""

    def call():
        done = subprocess.run(
            command, cwd=measure.ROOT, env=environment, capture_output=True, text=True
        )
        if done.returncode:
            raise RuntimeError(f"{command[1:3]} failed:\n{done.stdout}{done.stderr}")

    return measure.seconds(call)
