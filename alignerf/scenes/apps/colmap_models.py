"""Where COLMAP's models lie in a project, and which of several is taken.

Places, the first that has one counts: sparse/, colmap/sparse/ (nerfstudio), the folder
itself. In each a model lies in a folder of its number, or at once. A model is three
files, .bin or .txt. COLMAP writes several where photos do not hang together: they share
no frame, so the one with most images is taken, and the others are named.
"""

import logging
import struct
from pathlib import Path

from alignerf.files import faults
from alignerf.scenes.apps import model_texts

log = logging.getLogger(__name__)

PLACES = ("sparse", "colmap/sparse", ".")
SUFFIXES = (".bin", ".txt")
PARTS = ("cameras", "images", "points3D")


def find(folder):
    """Paths of all models of the first place that has any, by number; may be empty."""
    for place in PLACES:
        here = Path(folder) / place
        inner = [p for p in here.glob("[0-9]*") if p.name.isdecimal() and p.is_dir()]
        models = [path for path in sorted(inner, key=number_of) if is_model(path)]
        if models:
            return models
        if is_model(here):
            return [here]
    return []


def number_of(path):
    return int(path.name)


def is_model(folder):
    """Whether a folder has the files of a model, whatever they hold."""
    return any(
        (folder / f"cameras{suffix}").is_file()
        and (folder / f"images{suffix}").is_file()
        for suffix in SUFFIXES
    )


def is_text(folder):
    """Whether COLMAP would read a model's texts; with both kinds it reads the other."""
    return not all((folder / f"{part}.bin").exists() for part in PARTS)


def images_in(model):
    """Number of images that a model says it has; 0 of a file that is cut short."""
    if is_text(model) and (model / "images.txt").is_file():
        return model_texts.count(model)
    with faults.opened(model / "images.bin") as file:
        head = file.read(8)
    return struct.unpack("<Q", head)[0] if len(head) == 8 else 0


def largest(folder):
    """The path of the model with most images; None where there is no model."""
    models = find(folder)
    if len(models) < 2:
        return models[0] if models else None
    counts = {model: images_in(model) for model in models}
    chosen = max(models, key=counts.get)
    others = [f"{m.name} of {counts[m]}" for m in models if m != chosen]
    log.warning(
        "%s: %d models: the largest is taken, %s of %d images; left: %s",
        *(chosen.parent, len(models), chosen.name, counts[chosen], ", ".join(others)),
    )
    return chosen


def missing(folder):
    """What a folder that is nearly a project lacks, in words; None of others."""
    for place in PLACES:
        for here in (Path(folder) / place / "0", Path(folder) / place):
            for suffix in SUFFIXES:
                there = [p for p in PARTS if (here / f"{p}{suffix}").is_file()]
                lacks = [p for p in PARTS[:2] if p not in there]
                if there and lacks:
                    names = " and ".join(f"{part}{suffix}" for part in lacks)
                    return f"{here}: a COLMAP model without {names}"
    return None
