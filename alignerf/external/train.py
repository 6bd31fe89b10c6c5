"""Train by another program: `python -m alignerf.external.train`.

Its command gets a folder of photos and cameras (`write_data`), and one for
its model. Both stay when the job is killed or fails, for a program that can resume; a
training of something else finds no model. Writes timing.json, and the cameras that its
renders are seen by. Of finished renders nothing is trained.
"""

import hashlib
import json
import logging
import shutil
from pathlib import Path

import numpy as np

from alignerf.exports import formats, points, warps, written
from alignerf.external import commands
from alignerf.io import atomic, faults, owned
from alignerf.scenes import prepared

log = logging.getLogger("alignerf")

# Beside the model while it is not done.
BEGUN = "model.begun"


OPTIONS = commands.OPTIONS | {
    "cameras": "of the round",
    "photos": "folder of photos",
    "[valid]": "folder of <view>.npz with valid pixels",
    "[seed]": ("of the points", 0),
    "[sources]": ("hash: other code starts anew", ""),
    "learnt": ("folder, written", Path),
    "timing": ("file, written", Path),
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    job = args.config = commands.job_of(args.config)
    seconds = train(job, args) if job.train else None
    timing = commands.timing(job.steps, seconds)
    with (
        atomic.replace_file(args.timing) as path,
        atomic.replace_folder(args.learnt) as folder,
    ):
        shutil.copyfile(args.cameras, folder / "cameras.npz")
        path.write_text(json.dumps(timing, indent=1))


def train(job: commands.Job, args) -> float:
    """Run the command in a folder of its own; returns its seconds.

    A file beside the folder says what it is of while it is not done.
    """
    begun, model = args.training / BEGUN, args.training / commands.MODEL
    digest = digest_of(job, args)
    if not (begun.is_file() and faults.content(begun) == digest.encode()):
        owned.clear(model)
        given = {"cameras": args.cameras, "warped": args.photos, "valid": args.valid}
        out = args.training / commands.DATA
        write_data(out, args.scene, **given, seed=args.seed)
    elif model.is_dir() and any(model.iterdir()):
        log.info("{model} is that of a run that was stopped")
    model.mkdir(parents=True, exist_ok=True)
    with atomic.replace_file(begun) as path:
        path.write_text(digest)
    seconds = commands.run_of_job(job.train, args)
    begun.unlink()
    if not any(model.iterdir()):
        log.warning("the command has written nothing below {model}")
    owned.seal(model)
    log.info("trained in %.1f s", seconds)
    return seconds


def write_data(out, scene, *, cameras=None, warped=None, valid=None, seed=0):
    """Write the folder `out` of a prepared scene, from which a program learns.

    It has images/, transforms.json (nerfstudio, instant-ngp), sparse/0 with points
    (COLMAP, Gaussian splatting) and masks/ where not all pixels count, at the scene's
    training size. Training views have the photos of the round, test views theirs as
    taken; all have the cameras of the round.

    cameras: cameras.npz, if not the scene's. warped: folder of photos, if not the
    scene's; valid: of <view>.npz with valid pixels. seed: of the points.
    """
    own, out = Path(scene) / "cameras.npz", Path(out)
    path = Path(cameras or own)
    loaded = prepared.load(scene, cameras)
    prepared.check_images(loaded, range(len(loaded.names)), loaded.folder / "images")
    views = written.as_trained(loaded, path)
    if valid:
        views = warps.as_trained(
            views, loaded, warped or loaded.folder / "images", valid
        )
    moved = written.has_moved(prepared.read_cameras(own), prepared.read_cameras(path))
    with (
        atomic.replace_folder(out) as folder,
        atomic.scratch_folder(out.parent, name="points") as work,
    ):
        masked = written.write(folder, views, alpha=False)
        arrays = written.arrays_of(views)
        # Test views stay where they were given: their cameras agree with no others.
        agreeing = np.arange(len(views.names))
        if moved:
            agreeing = points.agreeing(arrays, ())
        model, _ = points.of(
            *(folder, work, arrays, views.points),
            seed=seed,
            moved=moved,
            views=agreeing,
        )
        formats.write_colmap(folder, model, arrays)
        formats.write_transforms(
            folder / "transforms.json",
            arrays,
            masked=masked,
            points=(folder / formats.POINTS).is_file(),
        )


def digest_of(job: commands.Job, args):
    """SHA-256 of the command, its numbers and all that it learns from."""
    told = [job.train, job.seed, job.steps, args.seed, args.sources]
    found = hashlib.sha256(json.dumps(told).encode())
    for folder in filter(None, (args.photos, args.valid)):
        for path in sorted(Path(folder, name) for name in owned.files_of(folder)):
            found.update(path.name.encode() + faults.content(path))
    found.update(faults.content(args.cameras))
    return found.hexdigest()


if __name__ == "__main__":
    faults.run(main)
