"""What a machine does to a run: full disks, folders one may not write.

Each function returns what it found wrong, None where this machine lets it not be tried.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import time

from tools.torture import chains, interrupts, running

DISK_MIB = (1, 2, 4, 6)
NOBODY = 65534
# Of resident memory from a third of a training to its end.
MAX_GROWTH = 0.05


def full_disks(reference, folder):
    """A run on a disk that is full ends in a line; on a larger one it goes on.

    One chain meets every size in turn, and at last has room.
    """
    if os.geteuid() != 0:
        return None
    place = folder / "disk"
    place.mkdir(parents=True, exist_ok=True)
    if not mounted(place, DISK_MIB[0]):
        return None
    try:
        chain = chains.Chain(reference.root, place)
        (place / "tiny.yaml").write_text(chains.CONFIG)
        # Compiled programs would fill it first, and are no loss.
        cache = {"JAX_COMPILATION_CACHE_DIR": str(chains.cache_of(reference))}
        found = []
        for size in DISK_MIB:
            mounted(place, size, "remount")
            found += [f"{size} MiB: {fault}" for fault in full_disk(chain, cache)]
        mounted(place, 256, "remount")
        chains.finish(chain, environment=cache)
        return found + [f"differs: {n}" for n in chains.differences(reference, chain)]
    except RuntimeError as error:
        return [*found, f"does not go on: {error}"[-300:]]
    finally:
        subprocess.run(["umount", place], check=False)


def mounted(place, size_mib, *more):
    options = ",".join([*more, f"size={size_mib}m"])
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", place]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def full_disk(chain, cache):
    """Findings of a run that has too little room."""
    for log in chain.folder.rglob("*.log"):
        log.unlink()
    child = chain.start(environment=cache)
    code, said = child.wait(), words(chain)
    chain.unlock()
    if code == 0:
        return ["it fitted"]
    if "No space left" not in said + chain.words():
        return ["no word of a full disk"]
    # Snakemake's own tracebacks, of its records, are not ours.
    if ours := re.search(r'File "[^"]*/(alignerf|flow)/.*', said):
        return [f"traceback: {said[ours.start() :][:1000]!r}"]
    return []


def words(chain):
    """What was said, of logs that found room: a full disk may cut its own."""
    logs = [*chain.folder.rglob("*.log")]
    return "\n".join(path.read_text(errors="replace") for path in logs)


def unwritable(reference, folder):
    """A normal user whose results may not be written: one line, nothing else."""
    chain = chains.make(reference.root, folder / "unwritable")
    (chain.folder / "results").chmod(0o555)
    scene = {"source": "courtyard", "courtyard": {"views": 4, "width": 40}}
    command = [sys.executable, "-m", "alignerf.poses", "--config", json.dumps(scene)]
    command += ["--out", "results/scene"]
    if os.geteuid() == 0:
        user = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"]
        if shutil.which("setpriv") is None:
            return None
        command = [*user, *command]
    environment = {"PYTHONPATH": str(reference.root)}
    ended = running.run(command, chain.folder, environment)
    fault = running.fault_of(ended, ["results"])
    return [f"{fault}: {ended.output[-200:]}"] if fault else []


def memory_growth(reference, folder):
    """A long training holds at its end what it held when it had begun."""
    scene = reference.folder / "results" / chains.SCENE
    out = folder / "long"
    shutil.rmtree(out, ignore_errors=True)
    told = folder / "long.told"
    told.unlink(missing_ok=True)
    child = subprocess.Popen(
        [sys.executable, "-c", interrupts.TRAINING, *interrupts.arguments(scene, out)],
        cwd=reference.root,
        env=os.environ | {"TOLD": str(told)},
        stderr=subprocess.DEVNULL,
    )
    held = []
    while child.poll() is None:
        # What is loaded and compiled before the first step is no growth.
        if told.exists() and told.stat().st_size:
            held.append(resident_mib(child.pid))
        time.sleep(0.5)
    if child.returncode:
        return [f"exit {child.returncode}"]
    steady = [value for value in held[len(held) // 3 :] if value]
    growth = steady[-1] / steady[0] - 1
    return [f"{100 * growth:.0f} % more"] if growth > MAX_GROWTH else []


def resident_mib(pid):
    """0 of a process that has ended."""
    try:
        with open(f"/proc/{pid}/statm") as file:
            pages = int(file.read().split()[1])
    except OSError:
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
