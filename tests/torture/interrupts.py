"""A chain that is ended at random moments, again and again, ends in equal bytes."""

import json
import signal
import subprocess
import sys
import time

from tests.torture import chains

# Seconds from a start to a kill: long enough for Snakemake to plan, now and then.
KILL_S = (1.0, 25.0)
STOPS = {"SIGTERM": signal.SIGTERM, "Ctrl-C": signal.SIGINT}
# Says which training is run with checkpoints every second.
TRAINING = """
import sys
from alignerf.training import loop
from alignerf import train
from alignerf.files import faults
loop.CHECKPOINT_EVERY_S = 1.0
faults.run(lambda: train.main(sys.argv[1:]))
"""


def killed(reference, folder, kills, rng):
    """Findings of chains that are killed `kills` times in all, and how many there were.

    Each chain ends equal to the reference, and leaves nothing half-written behind.
    """
    found, done, number = [], 0, 0
    while done < kills:
        chain = chains.make(reference.root, folder / f"killed{number}", reference)
        number += 1
        ended = False
        while not ended:
            child = chain.start()
            try:
                # Once all kills are done, the chain may end.
                limit_s = rng.uniform(*KILL_S) if done < kills else None
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
    chains.finish(chain)
    found += [f"differs: {name}" for name in chains.differences(reference, chain)]
    return found + [f"left behind: {path}" for path in chains.leftovers(chain)]


def trainings(reference, folder, kills, rng):
    """Findings of a training with many checkpoints that is killed again and again."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = reference.folder / "results" / chains.SCENE
    models = {}
    for name, times in (("once", 0), ("killed", kills)):
        out = folder / name
        command = [sys.executable, "-c", TRAINING, *arguments(scene, out)]
        done = 0
        while True:
            child = subprocess.Popen(
                command,
                cwd=reference.root,
                stderr=open(out.with_suffix(".log"), "ab"),  # noqa: SIM115
                start_new_session=True,
            )
            try:
                code = child.wait(rng.uniform(4, 9) if done < times else None)
            except subprocess.TimeoutExpired:
                chains.kill(child, signal.SIGKILL)
                done += 1
                continue
            if code:
                return [f"training {name}: exit {code}"], done
            break
        timing = json.loads((out / "timing.json").read_text())
        models[name] = (out / "model").read_bytes(), timing["final"]
    found = []
    if models["once"] != models["killed"]:
        found.append("a killed training ends in another model")
    if kills and "resuming at step" not in (folder / "killed.log").read_text():
        found.append("it never resumed: nothing was tried")
    return found, done


def arguments(scene, out):
    """Of a training that takes about 40 s."""
    job = {
        "seed": 0,
        "stage": "full",
        "alignerf": None,
        "model": {"samples": [16, 8], "field": {"log2_entries": 12, "levels": 4}},
        "training": {"steps": 8000, "batch_rays": 256},
    }
    return [
        *("--config", json.dumps(job), "--scene", str(scene), "--threads", "1"),
        *("--checkpoints", str(out / "checkpoints"), "--model", str(out / "model")),
        *("--timing", str(out / "timing.json"), "--learnt", str(out / "learnt")),
    ]
