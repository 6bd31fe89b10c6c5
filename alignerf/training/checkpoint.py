"""Parameters and training states on disk: whole, checked, never pickled.

A folder of checkpoints holds `state-<step>.msgpack` and `manifest.json`, which
names the newest one with its SHA-256, the job's fingerprint, the time spent and the
number of micro-batches.
The manifest is replaced last, so a killed writer leaves the previous state.
With a budget of minutes `budget.json` says how many steps they are; it is written
before the first one.
"""

import contextlib
import hashlib
import json
import logging
import os
import pathlib

import filelock
import flax.serialization
import jax
import numpy as np

from alignerf.command import whole

log = logging.getLogger("alignerf")


def fingerprint(*parts) -> str:
    """SHA-256 over JSON-able values that decide what a run computes."""
    text = json.dumps(parts, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def digest(tree):
    """SHA-256 of the arrays of a tree: the data that a training starts from."""
    found = hashlib.sha256()
    for leaf in jax.tree.leaves(jax.device_get(tree)):
        found.update(np.ascontiguousarray(leaf))
    return found.hexdigest()


@contextlib.contextmanager
def lock(folder):
    """Hold a checkpoint folder alone; a second trainer is refused, not queued.

    A killed Snakemake leaves its training running: two writers would ruin both.
    """
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    held = filelock.FileLock(folder / "lock", timeout=0)
    try:
        with held:
            yield
    except filelock.Timeout:
        raise ValueError(
            f"{folder}: another process is training here; wait for it or end it"
        ) from None


def save(folder, state, *, identity, time_s, parts):
    """Write a state as the folder's newest checkpoint.

    `parts` is the number of micro-batches, on which the rounding of a step hangs.
    """
    folder = pathlib.Path(folder)
    state = jax.device_get(state)
    data = flax.serialization.to_bytes(state)
    name = f"state-{int(state.step)}.msgpack"
    _write(folder / name, data)
    manifest = {
        "file": name,
        "sha256": hashlib.sha256(data).hexdigest(),
        "identity": identity,
        "time_s": time_s,
        "parts": parts,
    }
    _write(folder / "manifest.json", json.dumps(manifest, indent=1).encode())
    for old in folder.glob("state-*.msgpack"):
        if old.name != name:
            old.unlink()


def read_parts(folder) -> int | None:
    """Micro-batches of the folder's checkpoint, whosever it is; None without one.

    What is wrong with the manifest is left to `restore` to say.
    """
    try:
        manifest = json.loads((pathlib.Path(folder) / "manifest.json").read_text())
        parts = manifest["parts"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return parts if isinstance(parts, int) and parts > 0 else None


def save_budget(folder, *, identity, steps, steps_per_s):
    """Write down how many steps a job's budget holds, and the speed that says so."""
    found = {"identity": identity, "steps": steps, "steps_per_s": steps_per_s}
    _write(pathlib.Path(folder) / "budget.json", json.dumps(found, indent=1).encode())


def read_budget(folder, *, identity) -> dict | None:
    """{steps, steps_per_s} of this very job's budget; None where none was written."""
    path = pathlib.Path(folder) / "budget.json"
    try:
        found = json.loads(path.read_text())
        if found.pop("identity") != identity:
            log.info("%s: of another configuration, timing anew", path)
            return None
        steps, steps_per_s = int(found["steps"]), float(found["steps_per_s"])
        if steps < 1:
            raise ValueError
    except FileNotFoundError:
        return None
    except (KeyError, TypeError, ValueError, AttributeError):
        log.warning("%s: not readable, timing anew", path)
        return None
    return {"steps": steps, "steps_per_s": steps_per_s}


def restore(folder, template, *, identity):
    """The newest state and its manifest, or None where none fits.

    A checkpoint of another job (other config, photos or initial weights) or a
    damaged one is said so and left out; training then starts anew.
    """
    folder = pathlib.Path(folder)
    try:
        manifest = json.loads((folder / "manifest.json").read_text())
        data = (folder / manifest["file"]).read_bytes()
    except FileNotFoundError:
        return None
    except (KeyError, TypeError, json.JSONDecodeError):
        log.warning("%s: manifest not readable, starting anew", folder)
        return None
    if manifest.get("identity") != identity:
        log.info("%s: checkpoint of another configuration, starting anew", folder)
        return None
    if hashlib.sha256(data).hexdigest() != manifest["sha256"]:
        log.warning("%s: checkpoint is damaged, starting anew", folder)
        return None
    return _from_bytes(template, data, folder), manifest


def write_params(path, params):
    """Trained parameters as flax msgpack, written whole."""
    _write(pathlib.Path(path), flax.serialization.to_bytes(jax.device_get(params)))


def read_params(path, template):
    """Parameters of the template's shapes; anything else names the file."""
    try:
        data = pathlib.Path(path).read_bytes()
    except FileNotFoundError:
        raise ValueError(f"{path}: model file not found") from None
    return _from_bytes(template, data, path)


def _from_bytes(template, data, where):
    """flax accepts surplus entries, other shapes and NaN: all are checked here."""
    try:
        stored = flax.serialization.msgpack_restore(data)
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{where}: not a file of parameters ({error})") from None
    wanted = flax.serialization.to_state_dict(template)
    if jax.tree.structure(stored) != jax.tree.structure(wanted):
        raise ValueError(f"{where}: not parameters of this model")
    found = flax.serialization.from_state_dict(template, stored)
    for (path, wanted), leaf in zip(
        jax.tree_util.tree_leaves_with_path(template),
        jax.tree.leaves(found),
        strict=True,
    ):
        name = jax.tree_util.keystr(path)
        leaf = np.asarray(leaf)
        if leaf.shape != wanted.shape or leaf.dtype != wanted.dtype:
            raise ValueError(
                f"{where}: {name} is {leaf.dtype}{leaf.shape}, "
                f"the model has {wanted.dtype}{wanted.shape}"
            )
        if not np.isfinite(leaf).all():
            raise ValueError(f"{where}: {name} is not finite")
    return found


def _write(path, data):
    with whole.replace_file(path) as temporary, open(temporary, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
