"""Where a table comes from: commit, libraries, device, seeds, configs, trainings.

It lies beside the table, in `<stem>.provenance.json`. Unknown facts are null: the
commit where the sources are no git checkout, the lock where they were installed.
"""

import functools
import hashlib
import json
import os
import shlex
import subprocess
from pathlib import Path

from alignerf.io import json_files, yaml_files

# Of this program; pyproject.toml takes it from here.
VERSION = "0.2.0"
ROOT = Path(__file__).resolve().parents[2]
LOCK = "requirements.lock"
# Where Snakefile, workflow/ and results/published lie: beside the sources, or in the
# package where that was installed.
PIPELINE = ROOT if (ROOT / "Snakefile").is_file() else ROOT / "alignerf" / "pipeline"
# What a training's timing.json tells of it.
KEYS = ("commit", "lock", "device", "environment")
# Variables that may change a number's last digits: of XLA, JAX, CUDA, NumPy, OpenCV.
ENVIRONMENT = (
    *("XLA_FLAGS", "JAX_DISABLE_MAX_OPTIMIZATIONS", "JAX_NUM_CPU_DEVICES"),
    *("LIBTPU_INIT_ARGS", "NVIDIA_TF32_OVERRIDE", "NPY_DISABLE_CPU_FEATURES"),
    *("OPENBLAS_CORETYPE", "OMP_NUM_THREADS"),
    *("OPENCV_CPU_DISABLE", "OPENCV_IPP", "OPENCV_OPENCL_DEVICE"),
)
# The command that exports what a run makes, for its jobs (see `export_command`).
EXPORT = "ALIGNERF_EXPORT"
# The command as it was typed, for the page that it makes.
COMMAND = "ALIGNERF_COMMAND"
# Set where a user has typed `why-blurry`, and no `make`.
TYPED = "ALIGNERF_TYPED"
CHANGES = ("status", "--porcelain", "--untracked-files=no")


def is_verbose():
    """Whether a user wants to see all output, as by `make run VERBOSE=1`."""
    return bool(os.environ.get("VERBOSE"))


def as_json(described):
    """The content of a provenance file; described: as of `describe`."""
    return json.dumps(described, indent=2) + "\n"


def describe(trainings, configs, *, seeds=(), devices=()):
    """The provenance of a table, as JSON can have it.

    trainings: mappings of the `path` and KEYS of each that the table is made of.
    configs: paths of the scenes' complete configs. seeds, devices: further ones, which
    neither configs nor trainings name. Raises ValueError naming a file that is damaged.
    """
    trained_on = {one["device"] for one in trainings}
    contents = {str(path): yaml_files.read(path) for path in configs}
    of_configs = [
        s for path, config in contents.items() for s in seeds_of(path, config)
    ]
    return facts() | {
        "device": sorted({*devices, *trained_on} - {None}),
        "seeds": sorted({*seeds, *of_configs}),
        "configs": contents,
        "trainings": trainings,
    }


def export_command():
    """The command that writes this run's files for other programs, as it says itself.

    A job is told by the workflow; without one it is that of the default config.
    """
    return os.environ.get(EXPORT) or "snakemake --cores 1 export"


def typed(make, installed):
    """A command as its user can type it: of make, or as it is installed."""
    return installed if os.environ.get(TYPED) else make


def as_command(command, given, options=""):
    """A command as its user can type it; given: {variable of make: path}."""
    quoted = {key: shlex.quote(str(path)) for key, path in given.items()}
    made = (f"{key}={path}" for key, path in quoted.items())
    named = (
        path if key == "FOLDER" else f"--{key.lower()} {path}"
        for key, path in quoted.items()
    )
    by_make = [f"make {command}", *made]
    by_make += [f'OPTIONS="{options}"'] * bool(options)
    own = filter(None, [f"why-blurry {command}", options, *named])
    return typed(" ".join(by_make), " ".join(own))


def facts():
    """Commit and lock of the sources that run, and what their numbers may hang on."""
    return {"commit": commit(), "lock": lock(), "environment": environment()}


def environment(environ=os.environ):
    """Those of ENVIRONMENT that are set, as a shell would have them; None for none."""
    given = ((name, environ.get(name)) for name in ENVIRONMENT)
    words = [f"{name}={shlex.quote(value)}" for name, value in given if value]
    return " ".join(words) or None


@functools.cache
def commit():
    """Git's commit of these sources, `-dirty` where files differ; or None."""
    # A package installed below another project's checkout is no part of that.
    if git("ls-files", "--error-unmatch", "--", str(Path(__file__).resolve())) is None:
        return None
    head, changes = git("rev-parse", "HEAD"), git(*CHANGES)
    if head is None or changes is None:
        return None
    return head + ("-dirty" if changes else "")


def git(*arguments):
    """Git's output in the folder of the sources; None where git fails or is missing."""
    # A hook's variables would name another repository.
    ours = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE")
    environment = {key: value for key, value in os.environ.items() if key not in ours}
    try:
        done = subprocess.run(
            ["git", "--no-optional-locks", "-C", str(ROOT), *arguments],
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
            env=environment,
        )
    except (OSError, ValueError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


@functools.cache
def lock():
    """16 digits of the SHA-256 of the lock of the libraries' versions; or None."""
    try:
        content = (ROOT / LOCK).read_bytes()
    except OSError:
        return None
    return hashlib.sha256(content).hexdigest()[:16]


def of_training(path):
    """KEYS of a training, None for those that its timing.json lacks."""
    timing = json_files.read(path, dict.fromkeys(KEYS, json_files.OrNone(str)))
    return {key: timing.get(key) for key in KEYS}


def seeds_of(path, config):
    """Seeds of the scenes of a complete config, which was read from the path."""
    try:
        return [int(scene["seed"]) for scene in config["scenes"].values()]
    except (AttributeError, KeyError, OverflowError, TypeError) as error:
        raise ValueError(f"{path}: not a scene's config: {error}") from None
