"""A model."""

import math

from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys import model as model_keys

# What no machine is asked for: parameters and all of their training.
MOST_BYTES = 2**38
# A side, as of a grid's finest level: their third power is a 64-bit number.
MOST_CELLS = 2**20
# In units of the largest camera coordinate.
MOST_FAR = 100


def check_model(model, *place):
    """Its depths are in order, and its fields' parameters fit into a machine."""
    where = ".".join(place)
    if model["near"] >= model.get("far", math.inf):
        fault(where, "near must be smaller than far")
    if model_keys.field_kind(model) == "nerf" and model["far"] > MOST_FAR:
        # Sines of distant points are noise, and nothing contracts them.
        fault(f"{where}.far", f"field nerf sees no farther than {MOST_FAR}")
    kind = model_keys.KINDS[model["kind"]]
    for key in getattr(kind, "HAS_NO", ()):
        if key in model["training"]:
            fault(f"{where}.training.{key}", f"kind {model['kind']} has none")
    squares = model["kind"] == "mipnerf360" and model_keys.squares_errors(model)
    if squares and "distortion_weight" in model["training"]:
        reason = "none with field nerf, or with a background"
        fault(f"{where}.training.distortion_weight", reason)
    if model["kind"] == "ngp":
        cells = model["finest"] * model["side"]
        if not model["coarsest"] < cells <= MOST_CELLS:
            fault(
                f"{where}.finest",
                f"{cells:g} cells over the box are not from {model['coarsest'] + 1} to "
                f"{MOST_CELLS}",
            )
    parts = {key: model[key] for key in ("proposal", "field") if key in model}
    for key, field in (parts or {"width": model}).items():
        if "log2_entries" in field:
            values = field["levels"] * field["features"] * 2 ** field["log2_entries"]
        elif "depth" in field:
            networks = getattr(kind, "NETWORKS", 1)
            values = networks * field["depth"] * field["width"] ** 2
        else:
            continue
        # Besides the parameters, their gradients and the two moments of Adam.
        if 16 * values > MOST_BYTES:
            size = f"{16 * values / 2**30:.0f} GiB to train are more than"
            fault(f"{where}.{key}", f"{size} {MOST_BYTES / 2**30:g} GiB")
