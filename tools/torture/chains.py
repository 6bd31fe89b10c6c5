"""The whole chain, as small as it can be: run, killed, run again, compared."""

import os
import shutil
import subprocess
import sys
import time
from typing import NamedTuple

import cv2
import numpy as np

from alignerf.io import owned
from tests import judged_cases
from tools.torture import stages

SCENE, JUDGED = "tiny", "theirs"
# Every kind of stage: cameras corrected, optimized poses, alignment on the way, staged
# training.
CONFIG = """
preflight: false
scenes:
  tiny:
    source: courtyard
    poses: truth
    test_every: 4
    perturb_px: 0.5
    courtyard: { views: 10, width: 64, height: 48, supersample: 1, lens_sigma_px: 0.0 }
models:
  base:
    samples: [16, 8]
    proposal: &field
      { kind: grid, levels: 4, log2_hashmap_size: 10, max_resolution: 64, width: 8 }
    field: { <<: *field, view_widths: [8] }
methods:
  mipnerf360: { rounds: 1, changes: cameras }
  learnt: { pose_optimization: {} }
  aligned: { align: { estimator: dis_fine, min_move_px: 0 } }
  alignerf:
    alignerf: { patches: 2, patch_px: 16, radius_px: 4, features: 4 }
training: { steps: 60, batch_rays: 128 }
flow: { estimator: dis_fine, tolerance_px: 4.0 }
"""
TARGETS = (SCENE, "export")


class Chain(NamedTuple):
    """A folder in which the chain runs, of the sources at `root`."""

    root: os.PathLike
    folder: os.PathLike

    def command(self, *more):
        """The words of its Snakemake run, as `make run` has them."""
        return [
            # Before options, of which some take several words.
            *(sys.executable, "-m", "snakemake", *more, "--cores", "1"),
            *("--snakefile", str(self.root / "Snakefile")),
            *("--workflow-profile", str(self.root / "profiles/default")),
            *("--configfile", "tiny.yaml"),
        ]

    def start(self):
        """Begin a run in a session of its own; its words go to run.log."""
        with open(self.folder / "run.log", "ab") as log:
            return subprocess.Popen(
                self.command(*TARGETS),
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def unlock(self):
        """A killed Snakemake leaves its lock, and a user is told to remove it."""
        subprocess.run(
            self.command("--unlock"), cwd=self.folder, capture_output=True, check=False
        )

    def words(self):
        """All that its runs have said."""
        return (self.folder / "run.log").read_text(errors="replace")


def make(root, folder, seed_from=None) -> Chain:
    """A chain in a new folder; compiled programs of another one save its time."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "results").mkdir(parents=True)
    (folder / "tiny.yaml").write_text(CONFIG)
    if seed_from is not None and (cache := cache_of(seed_from)).is_dir():
        shutil.copytree(cache, folder / "results" / ".jax_cache")
    return Chain(root, folder)


def judged(root, folder) -> Chain:
    """A finished judgement of renders that are blurred and shifted by a pixel."""
    judged_cases.project(folder, "kept")
    for path in (folder / "renders").iterdir():
        image = cv2.GaussianBlur(cv2.imread(str(path)), (0, 0), 0.7)
        cv2.imwrite(str(path), np.roll(image, 1, axis=1))
    words = ["--photos", "photos", "--renders", "renders", "--name", JUDGED]
    words += ["--cameras", "transforms.json", "--cores", "1"]
    command = [sys.executable, "-m", "alignerf.cli.judge", *words]
    subprocess.run(command, cwd=folder, capture_output=True, check=True)
    return Chain(root, folder)


def cache_of(chain):
    return chain.folder / "results" / ".jax_cache"


def finish(chain):
    """Run a chain to its end; RuntimeError with its last words where it fails."""
    if chain.start().wait():
        raise RuntimeError("\n".join(chain.words().splitlines()[-30:]))


def kill(child, number):
    """Send a signal to all processes of a session, and wait for the first."""
    for pid in session_of(child.pid):
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            continue
    child.wait()


def session_of(leader):
    """Process ids of a session, the youngest first: Snakemake's jobs are in it."""
    listed = subprocess.run(
        ["ps", "-A", "-o", "sid=,pid="], capture_output=True, text=True, check=True
    )
    pairs = [tuple(map(int, line.split())) for line in listed.stdout.splitlines()]
    return sorted((pid for sid, pid in pairs if sid == leader), reverse=True)


def gone(leader, max_s=20.0):
    """Whether all processes of a session have ended, within some seconds."""
    until = time.monotonic() + max_s
    while time.monotonic() < until:
        if not session_of(leader):
            return True
        time.sleep(0.1)
    return False


def differences(chain, other):
    """Files that two finished chains do not share, times apart."""
    first, second = (
        stages.content(c.folder, f"results/{SCENE}") for c in (chain, other)
    )
    return sorted(
        name
        for name in first.keys() | second.keys()
        if first.get(name) != second.get(name) and not is_process(name)
    )


def is_process(name):
    """Logs, benchmarks and checkpoints tell of processes, not of results."""
    return "/logs/" in name or "/checkpoints/" in name


def leftovers(chain):
    """Temporary files that no living process owns any more."""
    return sorted(
        path
        for path in stages.hidden(chain.folder)
        if os.path.basename(path) not in owned.JUNK
    )
