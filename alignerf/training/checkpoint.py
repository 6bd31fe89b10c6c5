"""Parameters and training states on disk: whole, checked, never pickled.

A folder of checkpoints holds `state-<step>.msgpack` of two steps and `manifest.json`,
which names the newest one with its SHA-256, the job's fingerprint, the time spent and
the number of micro-batches, and so, in `before`, the one before it.
The manifest is replaced last, so a killed writer leaves the previous state. Where
results lie in a bucket, the folder is copied there.
With a budget of minutes, `budget.json` holds the number of steps; it is written before
the first step.
"""

import contextlib
import hashlib
import json
import logging
import os
import pathlib
import re

import filelock
import flax.serialization
import jax
import numpy as np

from alignerf.io import atomic, bucket, faults, json_files, owned

log = logging.getLogger("alignerf")

# What the files of a folder of checkpoints say, and of what kind it is.
MANIFEST = dict.fromkeys(("file", "sha256", "identity"), str)
MANIFEST |= {"time_s": json_files.NUMBER, "parts": int}
# Those of older versions say nothing of the last numbers, nor of a state before.
ENTRY = MANIFEST | {"final": json_files.OrNone({str: json_files.NUMBER})}
BEFORE = {"before": json_files.OrNone(ENTRY)}
BUDGET = {"identity": str, "steps": int, "steps_per_s": json_files.NUMBER}


def fingerprint(*parts) -> str:
    """SHA-256 over JSON-able values that decide what a run computes."""
    text = json.dumps(parts, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def digest(tree):
    """SHA-256 of the arrays of a tree: the data that a training starts from."""
    sha256 = hashlib.sha256()
    for leaf in jax.tree.leaves(jax.device_get(tree)):
        sha256.update(np.ascontiguousarray(leaf))
    return sha256.hexdigest()


@contextlib.contextmanager
def lock(folder):
    """Hold a checkpoint folder alone; a second trainer is refused, not queued.

    A killed Snakemake leaves its training running: two writers would ruin both. An
    empty folder takes what the bucket has of it.
    """
    folder = pathlib.Path(folder)
    owned.check_links(folder / "lock")
    folder.mkdir(parents=True, exist_ok=True)
    held = filelock.FileLock(folder / "lock", timeout=0)
    try:
        with held:
            if not manifest_of(folder).exists():
                bucket.fetch(folder)
            yield
    except filelock.Timeout:
        raise ValueError(
            f"{folder}: another process is training here; wait for it or end it"
        ) from None


def save(folder, state, *, identity, time_s, micro_batches, final):
    """Write a state as the folder's newest checkpoint, and keep the one before it.

    micro_batches: their number, on which the rounding of a step depends. final: the
    numbers of the last steps.
    """
    path = manifest_of(folder)
    facts = {"identity": identity, "time_s": time_s, "parts": micro_batches}
    data, step = flax.serialization.to_bytes(state), int(state.step)

    def stays(entry):
        found = re.fullmatch(r"state-(\d+)\.msgpack", entry["file"])
        # One of this job beyond this step was not usable, or it had been resumed.
        own = entry["identity"] == identity
        return found and (int(found[1]) < step if own else int(found[1]) != step)

    try:
        others = [entry for entry in _read_manifest(path) if stays(entry)]
    except (OSError, ValueError):
        others = []
    facts |= {"final": final, "before": others[0] if others else None}
    write_named(path, "state", step, data, **facts)


def write_named(manifest, prefix, number, data, *, before=None, **facts):
    """Write <prefix>-<number>.msgpack and the manifest of it; older ones go.

    before: the entry of one that stays.
    """
    file = manifest.with_name(f"{prefix}-{number}.msgpack")
    write(file, data)
    named = {"file": file.name, "sha256": hashlib.sha256(data).hexdigest(), **facts}
    write(manifest, json.dumps(named | {"before": before}, indent=1).encode())
    kept = {file.name, before and before["file"]}
    files = manifest.parent.glob(f"{prefix}-*.msgpack")
    gone = [old for old in files if old.name not in kept]
    for old in gone:
        old.unlink()
    bucket.put([file, manifest], gone)


def read_named(path, manifest, prefix):
    """The bytes that a manifest names; ValueError where they are damaged."""
    # No other file is read, wherever a manifest points.
    if not re.fullmatch(rf"{prefix}-\d+\.msgpack", manifest["file"]):
        raise ValueError(f"file is {faults.shown(manifest['file'])}")
    data = faults.content(path.with_name(manifest["file"]))
    if hashlib.sha256(data).hexdigest() != manifest["sha256"]:
        raise ValueError(f"{manifest['file']} is damaged")
    return data


def manifest_of(folder):
    """The path of a folder's manifest."""
    return pathlib.Path(folder) / "manifest.json"


def read_micro_batches(folder) -> int | None:
    """Micro-batches of the checkpoint, even if another job's; None without one.

    `restore` logs the faults of a manifest.
    """
    try:
        return _read_manifest(manifest_of(folder))[0]["parts"]
    except (OSError, ValueError):
        return None


def save_budget(folder, *, identity, steps, steps_per_s):
    """Write budget.json: the steps of a job's budget, and the measured speed."""
    budget = {"identity": identity, "steps": steps, "steps_per_s": steps_per_s}
    path = pathlib.Path(folder) / "budget.json"
    write(path, json.dumps(budget, indent=1).encode())
    bucket.put([path])


def read_budget(folder, *, identity) -> dict | None:
    """{steps, steps_per_s} of this very job's budget; None where none was written."""
    path = pathlib.Path(folder) / "budget.json"
    if not path.exists():
        return None
    try:
        budget = json_files.read(path, BUDGET)
        if budget["identity"] != identity:
            log.info("%s: of another configuration or code, timing anew", path)
            return None
        if not (budget["steps"] >= 1 and budget["steps_per_s"] > 0):
            raise ValueError(f"{path}: no such speed")
    except (OSError, ValueError) as error:
        log.warning("timing anew: %s", error)
        return None
    return {key: budget[key] for key in ("steps", "steps_per_s")}


def restore(folder, template, *, identity):
    """The newest whole state of a job and its entry in the manifest, or None.

    A damaged checkpoint, or one of another job (other config, photos or initial
    weights, or, after the last slash of its identity, other code or steps), is logged
    and ignored; without another one training starts anew.
    """
    try:
        entries = _read_manifest(manifest_of(folder))
        own = [entry for entry in entries if entry["identity"] == identity]
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.warning("%s: checkpoint not usable, starting anew: %s", folder, error)
        return None
    for entry in own:
        try:
            data = read_named(manifest_of(folder), entry, "state")
            return _from_bytes(template, data, folder), entry
        except (OSError, ValueError) as error:
            log.warning("%s: checkpoint not usable: %s", folder, error)
    job = identity.rpartition("/")[0]
    same = job and entries[0]["identity"].rpartition("/")[0] == job
    # It takes two checkpoints until the one that is left is gone.
    if same and not own:
        said = "of this configuration by other code, or in other steps: keep a copy"
        log.warning("%s: %s is %s; starting anew", folder, entries[0]["file"], said)
    else:
        said = "checkpoint of another configuration, " * (not own)
        log.info("%s: %sstarting anew", folder, said)
    return None


def _read_manifest(path):
    """Its entries, the newest first; ValueError where it is no manifest."""
    if not path.exists():
        raise FileNotFoundError(path)
    newest = json_files.read(path, ENTRY | BEFORE)
    entries = [newest, *filter(None, [newest.pop("before", None)])]
    for entry in entries:
        entry["final"] = entry.get("final") or {}
        if not (entry["time_s"] >= 0 and entry["parts"] >= 1):
            raise ValueError("time_s or parts is negative")
    return entries


def write_params(path, params):
    """Trained parameters as flax msgpack, written whole."""
    write(pathlib.Path(path), flax.serialization.to_bytes(jax.device_get(params)))


def read_params(path, template):
    """Parameters of the template's shapes; else ValueError naming the file."""
    return _from_bytes(template, faults.content(path), path)


def _from_bytes(template, data, where):
    """Parameters from bytes. flax accepts surplus entries, other shapes and NaN; this
    raises ValueError for them."""
    wanted = flax.serialization.to_state_dict(template)
    try:
        stored = flax.serialization.msgpack_restore(data)
        same = jax.tree.structure(stored) == jax.tree.structure(wanted)
    # What msgpack raises on bytes that are none, or that nest without end.
    except (ValueError, KeyError, TypeError, RecursionError, MemoryError) as error:
        raise ValueError(f"{where}: not a file of parameters ({error})") from None
    if not same:
        raise ValueError(f"{where}: not parameters of this model")
    params = flax.serialization.from_state_dict(template, stored)
    for (path, wanted), leaf in zip(
        jax.tree_util.tree_leaves_with_path(template),
        jax.tree.leaves(params),
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
    return params


def write(path, data):
    """Write bytes atomically, and flush them to the disk."""
    with atomic.replace_file(path) as temporary, open(temporary, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
