"""The corrections of a training's alignments, on disk beside its checkpoint.

`alignment-<step>.msgpack` holds the arrays of the newest alignment, its cameras and
offsets. `alignment.json` names this file with its SHA-256, the training's fingerprint
and the report. The JSON is replaced last, as in `training.checkpoint`.
"""

import hashlib
import json
import logging
import pathlib
import re

import flax.serialization
import numpy as np

from alignerf.files import faults, json_files
from alignerf.training import checkpoint

log = logging.getLogger("alignerf")

MANIFEST = dict.fromkeys(("file", "sha256", "identity"), str) | {"step": int}
MANIFEST |= {"report": list}
# Arrays that it always has; of warped photos there are more.
NEEDED = {"pixtocams", "camtoworlds"}
# No other file is read, wherever a manifest points.
FILE = re.compile(r"alignment-\d+\.msgpack\Z")


def write(folder, arrays, *, identity, step, report):
    """Write the arrays {name: array} of the alignment before a step."""
    folder = pathlib.Path(folder)
    data = flax.serialization.msgpack_serialize(arrays)
    name = f"alignment-{step}.msgpack"
    checkpoint.write(folder / name, data)
    manifest = {
        "file": name,
        "sha256": hashlib.sha256(data).hexdigest(),
        "identity": identity,
        "step": step,
        "report": report,
    }
    text = json.dumps(manifest, indent=1)
    checkpoint.write(folder / "alignment.json", text.encode())
    for old in folder.glob("alignment-*.msgpack"):
        if old.name != name:
            old.unlink()


def read(folder, *, identity, size):
    """(arrays, manifest) of this very training's newest alignment; None without one.

    size: {name: (shape, dtype)} of what there may be. What is damaged is said so, and
    counts as none.
    """
    folder = pathlib.Path(folder)
    path = folder / "alignment.json"
    if not path.exists():
        return None
    try:
        manifest = json_files.read(path, MANIFEST)
        if manifest["identity"] != identity:
            return None
        if not FILE.match(manifest["file"]):
            raise ValueError(f"file is {manifest['file']!r:.60}")
        data = faults.content(folder / manifest["file"])
        if hashlib.sha256(data).hexdigest() != manifest["sha256"]:
            raise ValueError("its arrays are damaged")
        arrays = flax.serialization.msgpack_restore(data)
        check(arrays, size)
    except (OSError, ValueError, KeyError, TypeError) as error:
        log.warning("%s: alignment not usable: %s", path, error)
        return None
    return arrays, manifest


def check(arrays, size):
    """ValueError where arrays are not of these shapes, or hold what is not finite."""
    kinds = {name: (a.shape, a.dtype.name) for name, a in arrays.items()}
    if not (kinds.keys() >= NEEDED and kinds.items() <= size.items()):
        raise ValueError("its arrays are not this training's")
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{name} is not finite")
