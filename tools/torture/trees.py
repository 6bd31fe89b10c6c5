"""Trees of a user's folders, with links, and any command: nothing of theirs changes.

A stand-in for the workflow engine does what can hurt: it checks the config as the
Snakefile does, and then replaces folders of each scene.
"""

import contextlib
import hashlib
import io
import os
import shutil
from pathlib import Path
from unittest import mock

import cv2
import numpy as np
import yaml

from alignerf.cli import __main__ as photos
from alignerf.cli import configs, export, judge, poses, workflow
from alignerf.experiment import check
from alignerf.experiment.checks import results
from alignerf.io import atomic, owned
from tests import judged_cases

# Where a user may have put something, below the folder of all; `work` is where commands
# run, and has the results.
PLACES = (
    *("photos", "work", "work/photos", "work/results", "work/results/my"),
    *("work/results/my/images", "work/results/my/deep/er", "work/results/logs"),
    *("work/results/old", "work/results/old/images", "work/results/theirs/renders"),
    *("work/results/my/theirs/export/cameras", "renders", "work/renders"),
)
NAMES = ("my", "old", "other", "theirs", "photos")
COMMANDS = ("photos", "judge", "poses", "export")
MAINS = {"photos": photos, "judge": judge, "poses": poses, "export": export}
PICTURES = [
    cv2.resize(judged_cases.picture(i), (64, 48), interpolation=cv2.INTER_AREA)
    for i in range(4)
]
# Of a scene, what jobs replace.
REPLACED = ("images", "theirs/renders", "theirs/export/cameras", "aligned/images")


def attack(number, seed):
    """What is wrong with what a command does in the tree of a number, or None."""
    rng = np.random.default_rng([seed, number])
    root = Path(os.path.realpath(os.curdir)) / f"tree{number}"
    shutil.rmtree(root, ignore_errors=True)
    (root / "work").mkdir(parents=True)
    places = grow(root, rng)
    words = command(rng, root, places)
    before = hashes(root)
    ended = run(root / "work", words)
    after = hashes(root)
    if lost := sorted(path for path, one in before.items() if after.get(path) != one):
        return f"{words}: changed {lost[:3]}: {ended}"
    if ended not in ("it ran", "refused"):
        return f"{words}: {ended}"
    if new := sorted(
        path for path in after.keys() - before.keys() if not is_ours(path)
    ):
        return f"{words}: put {new[:3]} there"
    shutil.rmtree(root)
    return None


def grow(root, rng):
    """Put photos, cameras, configs, links and results of before into a folder."""
    others = rng.choice(PLACES, 2, False)
    # The stranger ones as often as the others.
    places = [root / one for one in ("photos", "renders", *others)]
    for place in places:
        if rng.random() < 0.1 and not os.path.lexists(place):
            link(place, root / rng.choice(PLACES), rng)
        with contextlib.suppress(OSError):
            fill(place, rng)
    for name in NAMES:
        if rng.random() < 0.1:
            made_before(root / "work/results" / name, rng)
    # A run of before, which an export goes on from.
    run(root / "work", ["photos", f"--name={rng.choice(NAMES)}", "--", "../photos"])
    return places


def link(place, to, rng):
    with contextlib.suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        place.symlink_to(
            os.path.relpath(to, place.parent) if rng.random() < 0.5 else to
        )


def fill(place, rng):
    """A user's files."""
    place.mkdir(parents=True, exist_ok=True)
    inner = place / rng.choice([".", "images"])
    inner.mkdir(exist_ok=True)
    for i, picture in enumerate(PICTURES):
        cv2.imwrite(str(inner / f"v{i:02}.png"), picture + rng.integers(0, 9))
    if inner != place and rng.random() < 0.6:
        judged_cases.transforms(
            place / "transforms.json", [f"v{i:02}" for i in range(4)]
        )
    for name in ("notes.txt", "config.yaml", "verdict.json"):
        if rng.random() < 0.4:
            (place / name).write_text(f"mine {rng.random()}")


def made_before(folder, rng):
    """Results of this program's, with a user's files among them."""
    with contextlib.suppress(OSError, ValueError):
        owned.claim(folder)
        for name in REPLACED:
            write(folder / name, b"ours")
            if rng.random() < 0.3:
                (folder / name / "inside.txt").write_text("mine")
            if rng.random() < 0.1:
                (folder / name / owned.MARK).unlink()
                (folder / name / "v00.png").write_bytes(b"mine")


def write(folder, content):
    """What a job does with a folder of its own."""
    with atomic.replace_folder(folder) as fresh:
        (fresh / "v00.png").write_bytes(content)


def command(rng, root, places):
    """The words of a command on one of the places, or on what leads there."""
    which = str(rng.choice(COMMANDS))
    first, second = (places[i] for i in rng.choice(len(places), 2, replace=False))
    paths = [
        os.path.relpath(one, root / "work") if rng.random() < 0.5 else str(one)
        for one in (first, second)
    ]
    name = [f"--name={rng.choice(NAMES)}"] * (rng.random() < 0.5)
    if which == "judge":
        return [which, f"--photos={paths[0]}", f"--renders={paths[1]}", *name]
    if which == "export":
        return [which, rng.choice(NAMES) if name else paths[0]]
    return [which, *name, "--", paths[0]]


def run(folder, words):
    """How a command ended."""
    said, main = io.StringIO(), MAINS[words[0]].main
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
        mock.patch.object(workflow, "run", engine),
    ):
        try:
            main(words[1:])
        except (ValueError, OSError, SystemExit):
            return "refused"
        except Exception as error:
            return f"{type(error).__name__}: {error!s:.200}"
    return "it ran"


def engine(path, *_, **__):
    """What Snakemake and its jobs do to folders; see Snakefile."""
    config = check.checked(yaml.safe_load(Path(path or "none").read_text()))
    results.check_folders(config.scenes, config.methods)
    folders = [Path("results", s, one) for s in config.scenes for one in REPLACED]
    kept = [one for one in folders if "export" in one.parts]
    gone = [one for one in folders if one not in kept]
    results.claim(config.scenes, gone)
    for folder in gone:
        # As Snakemake does: of a link itself.
        if folder.is_symlink():
            folder.unlink()
        shutil.rmtree(folder, ignore_errors=True)
    for folder in folders:
        write(folder, b"new")
    return 0


def hashes(root):
    """{path: digest} of a user's files below a folder; a link's is where it leads."""
    found = {}
    for folder, inner, names in os.walk(root):
        at = Path(folder)
        for name in [*names, *(one for one in inner if (at / one).is_symlink())]:
            path = at / name
            if path.is_symlink():
                found[str(path.relative_to(root))] = os.readlink(path)
            elif name not in owned.JUNK | listed(at) and not is_config(path):
                content = hashlib.sha256(path.read_bytes()).hexdigest()
                found[str(path.relative_to(root))] = content
    return found


def is_config(path):
    """Whether a file is a config of ours that nobody has changed."""
    return path.suffix == ".yaml" and configs.is_untouched(path)


def listed(folder):
    """Names of files in a folder that its mark, or one above, says are ours."""
    return {Path(name).name for name in owned.listed(folder)}


def is_ours(path):
    """Whether a new file is where one of this program's may be."""
    parts = Path(path).parts
    return parts[:2] in (("work", "results"), ("work", ".snakemake"))
