"""A chain that is ended at random moments, again and again, ends in equal bytes."""

import contextlib
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time

from tools.torture import chains, stages

# Seconds from a start to a kill: long enough for Snakemake to plan, now and then.
KILL_S = (1.0, 25.0)
STOPS = {"SIGTERM": signal.SIGTERM, "Ctrl-C": signal.SIGINT}
# A training with checkpoints every second, which tells a file when its steps begin, and
# when each alignment begins and ends.
TRAINING = """
import os, sys
from alignerf.training import loop
from alignerf import train
from alignerf.alignment import aligner
from alignerf.io import faults
loop.CHECKPOINT_EVERY_S = 1.0
file = open(os.environ["TOLD"], "a", buffering=1)
align, run_steps = aligner.Aligner.align, loop.run_steps
def told_align(self, params, step):
    print("aligning", file=file)
    align(self, params, step)
    print("aligned", file=file)
def told_run(*arguments):
    print("running", file=file)
    run_steps(*arguments)
aligner.Aligner.align, loop.run_steps = told_align, told_run
faults.run(lambda: train.main(sys.argv[1:]))
"""
# Seconds to a kill from the first step, from an alignment's beginning, and from the
# start of a training that is killed before its first step.
STEPS_KILL_S, ALIGNMENT_KILL_S, START_KILL_S = (0.0, 8.0), (0.0, 0.3), (1.0, 6.0)
# Of so many alignments in a life, one is not survived.
ALIGNMENTS = 3
# Keys of the jobs that are killed, each of a training that takes about 40 s.
KINDS = {
    "training": {},
    "training that aligns": {
        "align": {
            "cameras_at": [round(0.05 + 0.06 * i, 2) for i in range(16)],
            "photos_at": [round(0.08 + 0.06 * i, 2) for i in range(15)],
            "estimator": "dis_fine",
            "min_move_px": 0.0,
        }
    },
}


def killed(reference, folder, kills, rng, until=math.inf):
    """Findings of chains that are killed `kills` times in all, and how many there were.

    Each chain ends equal to the reference, and leaves nothing half-written behind.
    until: when the last one may go on to its end.
    """
    found, done, number = [], 0, 0
    while done < kills and time.monotonic() < until:
        chain = chains.make(reference.root, folder / f"killed{number}", reference)
        number += 1
        ended = False
        while not ended:
            child = chain.start()
            try:
                # Once all kills are done, the chain may end.
                goes_on = done < kills and time.monotonic() < until
                limit_s = rng.uniform(*KILL_S) if goes_on else None
                ended = child.wait(limit_s) == 0
                if not ended:
                    found.append(f"chain {number}: " + last_words(chain))
                    return found, done
            except subprocess.TimeoutExpired:
                chains.kill(child, signal.SIGKILL)
                done += 1
                chain.unlock()
        found += [f"differs: {name}" for name in chains.differences(reference, chain)]
        found += [f"left behind: {path}" for path in chains.leftovers(chain)]
    return found, done


def last_words(chain):
    return " / ".join(chain.words().split("\n")[-4:])


def stopped(reference, folder, rng):
    """Findings of a chain that is asked to end, by each signal, while a job runs."""
    found = []
    chain = chains.make(reference.root, folder / "stopped", reference)
    for name, number in STOPS.items():
        child = chain.start()
        time.sleep(rng.uniform(10, 20))
        if child.poll() is not None:
            continue
        if name == "Ctrl-C":
            # The terminal sends it to all.
            chains.kill(child, number)
        else:
            child.send_signal(number)
            child.wait()
        if not chains.gone(child.pid):
            found.append(f"{name}: jobs still run after 20 s")
            chains.kill(child, signal.SIGKILL)
        if child.returncode == 0:
            found.append(f"{name}: exit 0")
        if "Traceback" in chain.words():
            found.append(f"{name}: traceback")
        chain.unlock()
    chains.finish(chain, *chains.SHORT)
    found += [
        f"differs: {name}" for name in chains.differences(reference, chain, short=True)
    ]
    return found + [f"left behind: {path}" for path in chains.leftovers(chain)]


def trainings(reference, folder, kind, kills, rng, until=math.inf):
    """Findings of a training with many checkpoints that is killed again and again.

    Returns them, how many kills there were, and how many of these fell within an
    alignment: of a training that aligns, every other one is meant to.
    """
    # An earlier torture's checkpoints would be gone on from.
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    scene = reference.folder / "results" / chains.SCENE
    made, log, within, done = {}, folder / "killed.log", 0, 0

    def mortal(times):
        return done < times and time.monotonic() < until

    for name, times in (("killed", kills), ("once", 0)):
        words = arguments(scene, folder / name, kind)
        life = Life(reference, folder / name, words, aligns=bool(KINDS[kind]))
        while (code := life.lived(mortal(times) and rng, done)) is None:
            done += 1
            within += life.is_aligning()
        if code:
            return [f"{name}: exit {code}"], done, within
        timing = json.loads((folder / name / "timing.json").read_text())
        made[name] = {
            "final numbers": timing["final"],
            "model or poses": stages.content(folder / name, "learnt"),
        }
    killed, once = made.values()
    found = [f"another {what}" for what in once if once[what] != killed[what]]
    if done and "resuming at step" not in log.read_text():
        found.append("it never resumed: nothing was tried")
    if done > 1 and KINDS[kind] and not within:
        found.append("no kill fell within an alignment: nothing was tried")
    return found, done, within


class Life:
    """A training that is started again and again, in one folder."""

    def __init__(self, reference, out, words, *, aligns):
        self.root, self.out, self.aligns = reference.root, out, aligns
        self.command = [sys.executable, "-c", TRAINING, *words]
        self.file = out.with_suffix(".told")
        self.variables = {
            "TOLD": str(self.file),
            # What the first life has compiled, the others read.
            "JAX_COMPILATION_CACHE_DIR": str(out.parent / "cache"),
        }

    def lived(self, rng, number):
        """Start it; its exit code, None where it was killed. rng: None lets it live.

        By its number a life ends while it starts, at an alignment, or at any step.
        """
        before = len(self.told())
        with open(self.out.with_suffix(".log"), "ab") as log:
            child = subprocess.Popen(
                self.command,
                cwd=self.root,
                stderr=log,
                env=os.environ | self.variables,
                start_new_session=True,
            )
        if not rng:
            return child.wait()
        word, count, pause_s = "running", 1, rng.uniform(*STEPS_KILL_S)
        if number % 5 == 4:
            count, pause_s = 0, rng.uniform(*START_KILL_S)
        elif number % 2 and self.aligns:
            word, count = "aligning", rng.integers(ALIGNMENTS) + 1
            pause_s = rng.uniform(*ALIGNMENT_KILL_S)
        while child.poll() is None and self.told()[before:].count(word) < count:
            time.sleep(0.005)
        with contextlib.suppress(subprocess.TimeoutExpired):
            return child.wait(pause_s)
        chains.kill(child, signal.SIGKILL)
        return None

    def told(self):
        """What the training has told so far, of all its lives."""
        return self.file.read_text().splitlines() if self.file.exists() else []

    def is_aligning(self):
        """Whether an alignment had begun, and not ended, when it was killed."""
        return self.told()[-1:] == ["aligning"]


def arguments(scene, out, kind="training"):
    """Of a training that takes about 40 s."""
    job = {
        "seed": 0,
        "stage": "full",
        "alignerf": None,
        "model": {"samples": [16, 8], "field": {"log2_hashmap_size": 12, "levels": 4}},
        "training": {"steps": 8000, "batch_rays": 256},
    } | KINDS[kind]
    return [
        *("--config", json.dumps(job), "--scene", str(scene), "--threads", "1"),
        *("--checkpoints", str(out / "checkpoints")),
        *("--timing", str(out / "timing.json"), "--learnt", str(out / "learnt")),
    ]
